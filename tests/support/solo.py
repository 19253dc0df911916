"""One person of one recording, frame by frame, for scripts that examine each step."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from toolkit.body.body import Body
from toolkit.people.joint_masks import GivenJoints
from toolkit.people.sighting import PeopleFinder, Sighting
from toolkit.people.survey import find_person
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.joints2d import Joints2D
from toolkit.sensing.recording import Recording
from toolkit.sensing.stream import Frame
from toolkit.tracking.clock import StageClock
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import FrameResult


class Solo:
    """Follower of the one person of a recording; frames may be given in any order, or again.

    Parameters
    ----------
    tracker : how
    recording : its camera, vertical and background are used, and its first frames to learn the person's body; joints in
        the image are those that the frames bring

    Attributes
    ----------
    follower : of that person; its `state` may be looked at and replaced
    level_rotation : R_level_camera, float64 (3, 3)
    """

    def __init__(self, tracker: Tracker, recording: Recording) -> None:
        self._tracker, self._joints = tracker, GivenJoints(recording.camera)
        self.level_rotation = level_rotation(recording.up_camera)
        self._finder = self._new_finder(recording)
        camera, body = self._finder.camera, None
        if tracker.learning_seconds:
            learner = tracker.learner(camera, self.level_rotation)
            for sighting, timestamp in self._first_sightings(recording):
                learner.observe(sighting, timestamp)
            body = learner.body
        self.follower: Any = tracker.follower(camera, self.level_rotation, body)

    @property
    def body(self) -> Body:
        """The person's body."""
        return self.follower.body

    def step(self, depth_mm: np.ndarray, timestamp: float, joints: tuple[Joints2D, ...] = ()) -> FrameResult:
        """Return the result for the next frame: depth uint16 (H, W) in millimetres, timestamp in seconds, see
        `Frame`.
        """
        clock = StageClock(self._tracker.stage_names)
        sighting = self._sighting(self._finder, Frame(depth_mm, timestamp, joints))
        return self.follower.step(sighting, timestamp, clock)

    def _new_finder(self, recording: Recording) -> PeopleFinder:
        return find_person(recording, self._tracker.settings.sensing)

    def _first_sightings(self, recording: Recording) -> Iterator[tuple[Sighting, float]]:
        finder = self._new_finder(recording)
        since: float | None = None
        for frame in recording.stream():
            since = frame.timestamp if since is None else since
            yield self._sighting(finder, frame), frame.timestamp
            if frame.timestamp - since >= self._tracker.learning_seconds:
                return

    def _sighting(self, finder: PeopleFinder, frame: Frame) -> Sighting:
        (sighting,) = self._joints.add(frame, finder.find(frame.depth_mm, frame.timestamp, {}))
        return sighting
