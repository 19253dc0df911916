"""Tracks of files or arrays, as arrays, tables, plots, files and scores."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from toolkit.body.skeleton import REPORTED
from toolkit.io.errors import UsageError
from toolkit.io.progress import Count, silent
from toolkit.sensing.recording import Recording
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import STATE_NAMES, RunInfo
from toolkit.tracks.runs import Person, load_persons, person_runs

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from toolkit.evaluation.scores import EvaluationTable
    from toolkit.output.rendering.open3d_geometry import Open3DFrame

    Trackable = str | Path | np.ndarray | Recording | Any
    """Any: PointCloud and RGBDImage of Open3D, and lists of them."""


class Track:
    """One person, one row per frame of the recording.

    Attributes
    ----------
    person : the track with its body, as used by the functions of `toolkit`
    """

    joint_names: tuple[str, ...] = REPORTED

    def __init__(self, person: Person, open_recording: Callable[[], Recording] | None = None) -> None:
        self.person = person
        self._open_recording = open_recording

    @classmethod
    def load(cls, run: str | Path) -> list[Track]:
        """Load all people of a run folder of `depthmocap track`; raises as `load_persons`."""
        people = load_persons(run)
        opened = cache(RunInfo.load(person_runs(run)[0]).open_recording)
        return [cls(person, opened) for person in people]

    @property
    def recording(self) -> Recording:
        """Return the recording of the track; that of a run folder is opened on first use.

        Raises
        ------
        RecordingError
            The recording of a run folder is missing or has changed.
        UsageError
            The track was made frame by frame, without a recording.
        """
        if self._open_recording is None:
            raise UsageError("a track made frame by frame has no recording; track it whole with depthmocap.track")
        return self._open_recording()

    def __len__(self) -> int:
        return len(self.person.track)

    def __repr__(self) -> str:
        return f"<depthmocap.Track of {self.name}: {len(self)} frames, {int((self.state == 'tracked').sum())} tracked>"

    @property
    def name(self) -> str:
        """Return the name of the person in files."""
        return self.person.name

    @property
    def joints(self) -> np.ndarray:
        """Joints, float32 (T, 20, 3): x right, y down, z forward from the camera, metres; NaN out of sight."""
        return np.where(self.person.there[:, None, None], self.person.track.joints, np.float32(np.nan))

    @property
    def confidence(self) -> np.ndarray:
        """Confidence, float32 (T, 20): probability that the joint is within 10 cm."""
        return _read_only(self.person.track.confidence)

    @property
    def observed(self) -> np.ndarray:
        """Observed joints, bool (T, 20): False for a joint inferred without measured depth around it."""
        return _read_only(self.person.track.observed)

    @property
    def state(self) -> np.ndarray:
        """State, text (T,): "tracked", "lost" (present, but not explained) or "empty" (out of sight)."""
        return np.array(STATE_NAMES)[self.person.track.state]

    @property
    def pose(self) -> np.ndarray:
        """Pose of the body, float64 (T, P), y up; `person.track.pose_names` names its entries."""
        return _read_only(self.person.track.pose)

    @property
    def timestamps(self) -> np.ndarray:
        """Timestamps, float64 (T,): seconds."""
        return _read_only(self.person.track.timestamps)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a table with a row per frame, by `time_s`; columns as in the CSV export in the camera's frame.

        Raises
        ------
        UsageError
            pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise UsageError("a data frame needs the package pandas; type `pip install pandas`") from error
        from toolkit.output.export.tables import joint_columns

        columns = joint_columns(self.person, level=False)
        return pandas.DataFrame(columns, index=pandas.Index(self.timestamps, name="time_s"))

    def plot(self) -> Figure:
        """Plot some skeletons over time, seen from the camera, above the heights of hands, feet and head."""
        from toolkit.output.rendering.track_plot import plot_person

        return plot_person(self.person)

    def to_open3d(self, frame: int) -> Open3DFrame:
        """Return measured cloud, fitted body and skeleton of a frame as geometry of Open3D, camera frame, metres.

        Raises
        ------
        UsageError
            There is no such frame, or no recording; see `recording`.
        RecordingError
            The recording of a run folder is gone or has changed.
        """
        from toolkit.output.rendering.open3d_geometry import (
            Open3DFrame,
            body_geometries,
            cloud_geometry,
            skeleton_geometry,
        )

        if not 0 <= frame < len(self):
            raise UsageError(f"frame {frame} is not one of the {len(self)} frames of the track; count from 0")
        recording = self.recording
        cloud = cloud_geometry(recording.depth(frame), recording.camera, recording.color(frame))
        (body,) = body_geometries([self.person], frame)
        return Open3DFrame(cloud, body, skeleton_geometry(self.person, frame))

    def export(self, path: str | Path, *, rig: str | None = None, origin: str | None = None) -> Path:
        """Write the track as .glb, .bvh, .c3d, .trc, .csv or .json; returns the file's path.

        Parameters
        ----------
        path : the file; its suffix is the format
        rig : joint names of GLB and BVH: mixamo, cmu or classic
        origin : "floor" or "camera"; default: that of the format

        Raises
        ------
        UsageError
            The format is unknown, or needs a package that is not installed.
        OutputError
            The file cannot be written.
        """
        if not isinstance(path, (str, Path)):
            raise UsageError(f"path is {path!r}; give the name of a file, such as motion.glb")
        from toolkit.output.export.run import export_run

        return export_run([self.person], path, rig=rig, origin=origin)[0]


def _read_only(values: np.ndarray) -> np.ndarray:
    """Return a view through which the track cannot be changed."""
    view = values.view()
    view.flags.writeable = False
    return view


@overload
def track(depth: Trackable, *, people: Literal[1] = 1, **options: Any) -> Track: ...
@overload
def track(depth: Trackable, *, people: int | Literal["all"], **options: Any) -> Track | list[Track]: ...
def track(
    depth: Trackable,
    *,
    intrinsics: Any = None,
    frame_rate: float | None = None,
    people: int | Literal["all"] = 1,
    timestamps: np.ndarray | None = None,
    background: np.ndarray | None = None,
    database: str | Path | None = None,
    config: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: Count = silent,
    **options: Any,
) -> Track | list[Track]:
    """Track the person, or the people, in depth, as `depthmocap track` does.

    Intermediate files are in a temporary folder. Ctrl-C raises KeyboardInterrupt after the current frame.

    Parameters
    ----------
    depth : a recording's path (any that `depthmocap track` reads), an open recording, or an array (T, H, W): integers
        are millimetres, floats metres, 0 or NaN = no measurement. Or a PointCloud or RGBDImage of Open3D, or a list of
        them, one per frame; see `toolkit.recordings.open3d_frames.recording_of_open3d`
    intrinsics : fx, fy, cx, cy in pixels, the path of a JSON file, or for Open3D's types its PinholeCameraIntrinsic;
        required for an array and for RGBDImage
    frame_rate : frames a second where there are no timestamps
    people : 1 tracks one person; a number or "all" several, returned as a list in order of appearance
    timestamps, background : of an array or of Open3D's types: seconds (T,), and the depth of the empty scene (H, W)
    database : file of a pose database; default: the packaged one
    config : name or file of settings: hybrid, baak2013, swarm, qammaz, lopez2011
    settings : single settings by dotted names, such as {"sensing.segment": "person"}
    progress : called with the frames done and all frames, in each pass over the recording
    options : reader options of `depthmocap track`: depth_unit, up_camera, mirrored, ...

    Raises
    ------
    DepthMocapError
        The recording cannot be read, a setting is invalid, or the person cannot be segmented.

    Warns
    -----
    PlausibilityWarning
        The recording, or the track, is probably not what was meant (`docs/troubleshooting.md`).
    """
    from toolkit.app.pipeline import track_recording

    count = count_of(people)
    given = {"intrinsics": intrinsics, "frame_rate": frame_rate, **options}
    tracker = tracker_of(database, config, settings)
    recording = _recording(depth, timestamps, background, {k: v for k, v in given.items() if v is not None})
    with TemporaryDirectory(prefix="depthmocap-") as run:
        summary = track_recording(
            recording, tracker, run, people=count,
            progress=lambda name, doing, done, total: progress(done, total),
        )  # fmt: skip
        if summary.interrupted:
            raise KeyboardInterrupt
        found = load_persons(run) if person_runs(run) else ()
    tracks = [Track(replace(person, recording=recording.name), lambda: recording) for person in found]
    return Track(replace(tracks[0].person, name=recording.name), lambda: recording) if people == 1 else tracks


def _recording(
    depth: Trackable, timestamps: np.ndarray | None, background: np.ndarray | None, options: dict[str, Any]
) -> Recording:
    """Return the upright recording of the arguments."""
    from toolkit.recordings.open3d_frames import is_open3d, recording_of_open3d
    from toolkit.recordings.opening import open_upright, recording_of, upright

    if not isinstance(depth, (str, Path, Recording)):
        read = recording_of_open3d if is_open3d(depth) else recording_of
        return upright(
            lambda **turned: read(depth, timestamps=timestamps, background=background, **{**options, **turned})
        )
    if timestamps is not None or background is not None:
        raise UsageError("timestamps and background belong to an array; a recording contains its own")
    if isinstance(depth, (str, Path)):
        return open_upright(depth, **options)
    if options:
        raise UsageError(f"{', '.join(options)} belong to a path or an array; this recording is already open")
    return depth


def count_of(people: int | Literal["all"]) -> int | None:
    """Return the number of people, None for all; raises UsageError for anything else."""
    if people != "all" and (isinstance(people, bool) or not isinstance(people, int) or people < 1):
        raise UsageError(f"people is {people!r}; give a number of people, or 'all'")
    return None if people == "all" else people


def tracker_of(database: str | Path | None, config: str | Path | None, settings: Mapping[str, Any] | None) -> Tracker:
    """Return the recipe of a tracker, with the packaged database if it needs one and none is named."""
    from toolkit.app.pipeline.trackers import TrackerRecipe
    from toolkit.database import DEFAULT_DATABASE

    recipe = TrackerRecipe(config, dict(settings or {}), database)
    if recipe.needs_database() and database is None:
        recipe = replace(recipe, database=DEFAULT_DATABASE)
    return recipe.build()


def evaluate(
    tracks: Track | Sequence[Track] | str | Path, truth: np.ndarray | str | Path | None = None
) -> EvaluationTable:
    """Return scores of tracks or run folders: a table with `mean()`, `to_csv()` and `to_json()`.

    Parameters
    ----------
    tracks : of `depthmocap.track`, or the path of a run folder or of a folder of runs
    truth : joints (T, 20, 3), or (N, T, 20, 3) of several people in any order: metres, camera frame, NaN = unknown. For
        run folders a file, or a folder matched by the recording's name; default: the true joints in the recording

    Raises
    ------
    UsageError
        Tracks in memory have no truth, or frames and joints do not match.
    DepthMocapError
        See `toolkit.evaluation.evaluate.evaluate_runs`.
    """
    from toolkit.evaluation.evaluate import evaluate_runs, evaluate_tracks

    if isinstance(tracks, (str, Path)):
        return evaluate_runs([tracks], None if truth is None else [Path(str(truth))])
    if truth is None:
        raise UsageError("tracks in memory have no truth; give truth=, joints (frames, 20, 3) in metres")
    several = [tracks] if isinstance(tracks, Track) else list(tracks)
    return evaluate_tracks([(each.name, each.person.track) for each in several], np.asarray(truth, dtype=np.float64))
