"""People tracked frame by frame, as the frames come from a camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from depthmocap.tracks import Track, count_of, tracker_of
from toolkit.app.pipeline.live import begin_live
from toolkit.body.body import Body
from toolkit.io.errors import RecordingError, UsageError
from toolkit.io.interrupts import interrupts_deferred
from toolkit.motion.contact import foot_contacts
from toolkit.people.evidence import furniture
from toolkit.people.vertical import floor_height
from toolkit.recordings.opening import recording_of
from toolkit.sensing.recording import Recording
from toolkit.sensing.stream import Frame
from toolkit.tracking import tracker_protocol as protocol
from toolkit.tracking.live_people import LivePeople, LivePose
from toolkit.tracking.multi_person import Row
from toolkit.tracks import STATE_NAMES
from toolkit.tracks import Track as Rows
from toolkit.tracks.runs import Person
from toolkit.tracks.track import row_of, row_type


class Pose(NamedTuple):
    """Pose of one person in one frame; the arrays are copies that cannot be written.

    Attributes
    ----------
    frame : number of the frame, from 0
    timestamp : seconds
    state : "tracked", "lost" or "empty"
    joints : float32 (20, 3), metres, camera frame; where the person is out of view, their last ones
    confidence : float32 (20,), probability that the joint is within 10 cm
    observed : bool (20,), False for a joint that was estimated without a measurement
    pose : float64 (P,), pose vector of the body
    person : 1, 2, ... in order of appearance
    provisional : the person's body is still being learned; the final pose of the frame is in `Tracker.tracks` later
    """

    frame: int
    timestamp: float
    state: str
    joints: np.ndarray
    confidence: np.ndarray
    observed: np.ndarray
    pose: np.ndarray
    person: int = 1
    provisional: bool = False

    @classmethod
    def of(cls, live: LivePose) -> Pose:
        """Return the pose of a row of a track."""
        row, found = live.row, live.row.result
        arrays = [_read_only(each) for each in (found.joints, found.confidence, found.observed, found.pose)]
        joints, confidence, observed, pose = arrays
        return cls(
            row.frame, row.timestamp, STATE_NAMES[found.state], joints, confidence, observed, pose, row.person,
            live.provisional,
        )  # fmt: skip


def _read_only(values: np.ndarray) -> np.ndarray:
    copy = np.array(values)
    copy.flags.writeable = False
    return copy


class Tracker:
    """Tracks the people in frames that are given one by one.

    Each frame has its poses at once. A person's body is learned in the first seconds in which they are in view (setting
    `shape.seconds`); until then their poses are provisional, with the body as learned so far. The frames since they
    came are then tracked again with the learned body, a few beside each new frame: `tracks` has these poses.

    Parameters
    ----------
    intrinsics : fx, fy, cx, cy in pixels, or the path of a JSON file
    people : 1 tracks one person, in a room the largest one; a number or "all" several
    database, config, settings : see `depthmocap.track`
    background : (H, W), depth of the empty scene; without it a room is learned from the first 4, 8 and 20 seconds
    keep_track : True to keep the poses for `track` and `tracks`: 1 kB for each person and frame
    options : see `depthmocap.track`: depth_unit, up_camera, mirrored, rotate, ...
    """

    def __init__(
        self,
        *,
        intrinsics: Any,
        people: int | Literal["all"] = 1,
        database: str | Path | None = None,
        config: str | Path | None = None,
        settings: Mapping[str, Any] | None = None,
        background: np.ndarray | None = None,
        keep_track: bool = True,
        **options: Any,
    ) -> None:
        self._count = count_of(people)
        self._tracker = tracker_of(database, config, settings)
        self._options = {"intrinsics": intrinsics, **options}
        self._background, self._keep_track = background, keep_track
        self._recording: Recording | None = None
        self._people: LivePeople | None = None
        self._height: float | None = None
        self._kind = ""
        self._rows: dict[int, list[Row]] = {}

    def step(self, depth: np.ndarray, timestamp: float) -> list[Pose]:
        """Track the next frame and return the pose of each person in it, by rising number.

        Ctrl-C during a step takes effect after it: the frame is in `tracks`.

        Parameters
        ----------
        depth : (H, W), whole numbers are millimetres, others metres, 0 or NaN = no measurement
        timestamp : seconds, greater than that of the frame before

        Raises
        ------
        RecordingError
            The frame has another size or type than the first one, or its time is not after that of the one before.
            The tracker is as before: the next frame can be given.
        SegmentationError
            The person cannot be separated from the scene.
        """
        image = np.asarray(np.ma.filled(depth, 0))  # masked = no measurement
        with interrupts_deferred():
            if self._recording is None or self._people is None:
                self._begin(image, timestamp)
            self._check_kind(image)
            assert self._recording is not None and self._people is not None
            frame = Frame(self._recording.convert(image, self._people.frames), float(timestamp))
            found = self._people.advance(frame)
            self._keep(found.rows)
            return [Pose.of(pose) for pose in found.poses]

    def finish(self) -> None:
        """Track the frames again that are not caught up with yet, so that `tracks` has all; no frame may follow."""
        if self._people is not None:
            with interrupts_deferred():
                self._keep(self._people.finish())

    @property
    def track(self) -> Track:
        """The track of the one person so far.

        Raises
        ------
        UsageError
            No pose with a learned body is known yet, or several people are tracked.
        """
        found = self.tracks
        if len(found) != 1:
            raise UsageError(f"{len(found)} people are tracked; take one of tracker.tracks")
        return found[0]

    @property
    def tracks(self) -> list[Track]:
        """The tracks of all people so far, in order of appearance, each from the first frame on.

        Raises
        ------
        UsageError
            No pose with a learned body is known yet, or `keep_track` is False.
        """
        if not self._rows or self._people is None:
            raise UsageError("no pose is known yet; give frames to step() for some seconds, or call finish()")
        no_people = furniture(self._people.finder.evidence)
        return [self._track(person) for person in sorted(self._rows.keys() - no_people)]

    def _begin(self, image: np.ndarray, timestamp: float) -> None:
        """Decide by the first frame how people are found."""
        first = recording_of(
            image[None], timestamps=np.array([timestamp]), background=self._background, **self._options
        )
        people = begin_live(first, self._tracker, self._count)
        self._recording, self._people, self._height = first, people, floor_height(first)
        self._kind = image.dtype.kind

    def _check_kind(self, image: np.ndarray) -> None:
        """Refuse metres after millimetres: without `depth_unit` the type of the first frame decides on the unit."""
        if (image.dtype.kind == "f") != (self._kind == "f") and self._options.get("depth_unit") is None:
            first, now = ("metres", "millimetres") if self._kind == "f" else ("millimetres", "metres")
            raise RecordingError(
                f"this frame is {image.dtype}, which means {now}, and the first frame was in {first}; "
                "give all frames in one type, or give depth_unit"
            )

    def _keep(self, rows: Sequence[Row]) -> None:
        if self._keep_track:
            for row in rows:
                self._rows.setdefault(row.person, []).append(row)

    def _track(self, person: int) -> Track:
        assert self._people is not None
        body = self._people.body_of(person)
        found = track_of(self._rows[person], self._tracker, body, self._height)
        name = "person" if self._count == 1 else f"person_{person:02d}"
        return Track(Person(name, found, body, self._people.level_rotation, camera_height=self._height))


def track_of(rows: Sequence[Row], tracker: protocol.Tracker, body: Body, camera_height: float | None = None) -> Rows:
    """Return the track of one person's rows, one for each frame in order."""
    kind = row_type(len(tracker.stage_names))
    records = np.array([row_of(row.result, row.timestamp, kind) for row in rows], dtype=kind)
    track = Rows.of_rows(records, tracker.stage_names, tracker.source_names)
    return replace(track, contact=foot_contacts(body, track, camera_height))
