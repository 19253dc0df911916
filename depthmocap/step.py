"""Frame-by-frame tracking of one person."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from depthmocap.tracks import Track, tracker_of
from toolkit.app.pipeline.run import Job
from toolkit.body.body import Body
from toolkit.io.errors import UsageError
from toolkit.motion.contact import foot_contacts
from toolkit.people.joint_masks import NoJoints
from toolkit.people.vertical import floor_height
from toolkit.recordings.opening import recording_of
from toolkit.sensing.recording import Recording
from toolkit.sensing.stream import Frame
from toolkit.tracking import tracker_protocol as protocol
from toolkit.tracking.multi_person import MultiPersonTracker, Row
from toolkit.tracks import STATE_NAMES
from toolkit.tracks import Track as Rows
from toolkit.tracks.runs import Person


class Pose(NamedTuple):
    """Result for one frame.

    Attributes
    ----------
    frame : number of the frame, from 0
    timestamp : seconds
    state : "tracked", "lost" or "empty"
    joints : float32 (20, 3), metres, camera frame; the last known ones while the person is out of sight
    confidence : float32 (20,), probability that the joint is within 5 cm
    observed : bool (20,), False for a joint that was guessed
    pose : float64 (P,), the pose of the body
    """

    frame: int
    timestamp: float
    state: str
    joints: np.ndarray
    confidence: np.ndarray
    observed: np.ndarray
    pose: np.ndarray

    @classmethod
    def of(cls, row: Row) -> Pose:
        """Return the result of a track row."""
        found = row.result
        return cls(
            row.frame, row.timestamp, STATE_NAMES[found.state], found.joints, found.confidence, found.observed,
            found.pose,
        )  # fmt: skip


class Tracker:
    """Follows one person through frames that are handed over one by one.

    The poses are, bit for bit, those of `depthmocap.track` over the same frames in one pass (`{"passes": 1}`). A
    person's body is learnt from the first seconds: until then `step` returns nothing, and then the poses of all frames
    so far at once.

    Parameters
    ----------
    intrinsics : fx, fy, cx, cy in pixels, or the path of a JSON file
    database, config, settings : see `depthmocap.track`
    background : (H, W), depth of the empty scene
    options : see `depthmocap.track`: depth_unit, up_camera, mirrored, rotate, ...
    """

    def __init__(
        self,
        *,
        intrinsics: Any,
        database: str | Path | None = None,
        config: str | Path | None = None,
        settings: Mapping[str, Any] | None = None,
        background: np.ndarray | None = None,
        **options: Any,
    ) -> None:
        self._tracker = tracker_of(database, config, settings)
        self._options = {"intrinsics": intrinsics, **options}
        self._background = background
        self._recording: Recording | None = None
        self._crowd: MultiPersonTracker | None = None
        self._height: float | None = None
        self._rows: list[Row] = []

    def step(self, depth: np.ndarray, timestamp: float) -> list[Pose]:
        """Process the next frame and return the results that are available.

        Parameters
        ----------
        depth : (H, W), integers are millimetres, floats metres, 0 or NaN = no measurement
        timestamp : seconds, greater than that of the frame before

        Raises
        ------
        RecordingError
            The frame has another size or type, or is out of order.
        SegmentationError
            The person cannot be segmented.
        """
        image = np.asarray(depth)
        if self._recording is None or self._crowd is None:
            self._recording = recording_of(
                image[None], timestamps=np.array([timestamp]), background=self._background, **self._options
            )
            self._height = floor_height(self._recording)
            self._crowd = Job(self._recording, self._tracker, 1, NoJoints()).crowd()
        frame = Frame(self._recording.convert(image, self._crowd.frames), float(timestamp))
        return self._known(self._crowd.step(frame))

    def finish(self) -> list[Pose]:
        """End the sequence and return the results of a person whose body was still being estimated."""
        return [] if self._crowd is None else self._known(self._crowd.finish())

    @property
    def track(self) -> Track:
        """Return the track so far.

        Raises
        ------
        UsageError
            No pose is available yet.
        """
        if not self._rows or self._crowd is None:
            raise UsageError("no pose is known yet; give frames to step() for some seconds, or call finish()")
        body = self._crowd.bodies[1]
        found = track_of(self._rows, self._tracker, body, self._height)
        return Track(Person("person", found, body, self._crowd.level_rotation, camera_height=self._height))

    def _known(self, rows: list[Row]) -> list[Pose]:
        self._rows += rows
        return [Pose.of(row) for row in rows]


def track_of(rows: Sequence[Row], tracker: protocol.Tracker, body: Body, camera_height: float | None = None) -> Rows:
    """Return the track of one person's rows, one per frame in order."""
    results = [row.result for row in rows]
    track = Rows(
        joints=np.array([r.joints for r in results], dtype=np.float32),
        pose=np.array([r.pose for r in results], dtype=np.float64),
        confidence=np.array([r.confidence for r in results], dtype=np.float32),
        state=np.array([r.state for r in results], dtype=np.uint8),
        source=np.array([r.source for r in results], dtype=np.uint8),
        timestamps=np.array([row.timestamp for row in rows], dtype=np.float64),
        stage_ms=np.array([r.stage_ms for r in results], dtype=np.float32),
        observed=np.array([r.observed for r in results], dtype=np.bool_),
        source_names=tracker.source_names,
        stage_names=tracker.stage_names,
    )
    return replace(track, contact=foot_contacts(body, track, camera_height))
