"""Multi-person tracker: frames of a stream in, rows of tracks out.

A person's shape is learnt from the first seconds, which are stored and then tracked again with the learnt body, so that
bone lengths do not change within a track. Rows of these seconds therefore come late and together.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from toolkit.body.body import Body
from toolkit.io.checkpoint import restore
from toolkit.io.errors import RecordingError
from toolkit.people.joint_masks import JointSource, NoJoints
from toolkit.people.sighting import PeopleFinder, PredictedBody, Sighting
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.stream import Frame
from toolkit.tracking.clock import StageClock
from toolkit.tracking.sightings import SightingFile, StoredSighting
from toolkit.tracking.tracker_protocol import BodyLearner, PersonFollower, Tracker
from toolkit.tracks import FrameResult


class Row(NamedTuple):
    """Row of one person's track."""

    person: int
    frame: int
    timestamp: float
    result: FrameResult


@dataclass
class Waiting:
    """Stored sightings of a person whose body is not learnt yet.

    Attributes
    ----------
    frames : sighting or None, timestamp, and milliseconds of the detection
    seen_since : timestamp of the first frame with enough points, None before
    learner : learner of the sightings since then
    """

    frames: deque[tuple[StoredSighting | None, float, float]] = field(default_factory=deque)
    seen_since: float | None = None
    learner: BodyLearner | None = None


class Predictions(Mapping[int, PredictedBody]):
    """Predicted bodies of the tracked people; each is placed when it is first read."""

    def __init__(self, known: Mapping[int, PersonFollower | BodyLearner]) -> None:
        self._known = known

    def __getitem__(self, person: int) -> PredictedBody:
        return self._known[person].predicted()

    def __contains__(self, person: object) -> bool:
        return person in self._known

    def __iter__(self) -> Iterator[int]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)


class MultiPersonTracker:
    """Tracker of the people of one stream.

    Parameters
    ----------
    tracker : makes a follower for each person
    finder : finder of the people in a frame
    up_camera : (3,), the vertical in the camera frame
    joints : source of image joints; None for none
    floor : y of the floor, metres, level frame, None if unknown

    Attributes
    ----------
    timestamps : timestamps of the processed frames, seconds
    sightings : store of all sightings for a second pass; None without one
    """

    CHECKPOINT = ("timestamps", "finder", "joints", "_followers")
    timestamps: list[float]

    def __init__(
        self,
        tracker: Tracker,
        finder: PeopleFinder,
        up_camera: np.ndarray,
        joints: JointSource | None = None,
        floor: float | None = None,
    ) -> None:
        self._floor = floor
        self.sightings: SightingFile | None = None
        self.tracker, self.finder, self.joints = tracker, finder, joints or NoJoints()
        self.level_rotation = level_rotation(up_camera)
        self.timestamps = []
        self._followers: dict[int, PersonFollower] = {}
        self._waiting: dict[int, Waiting] = {}

    @property
    def frames(self) -> int:
        """Number of processed frames."""
        return len(self.timestamps)

    @property
    def settled(self) -> bool:
        """True if no body is being learnt, so that the state is small and all rows are out."""
        return not self._waiting

    @property
    def bodies(self) -> dict[int, Body]:
        """Bodies of the tracked people, by number."""
        return {person: follower.body for person, follower in self._followers.items()}

    def step(self, frame: Frame) -> list[Row]:
        """Process the next frame and return the new rows, of none or of several frames."""
        sightings, prepare_ms = self._taken(frame)
        rows: list[Row] = []
        for person in sorted(self._followers.keys() | self._waiting.keys()):
            sighting = sightings.get(person)
            if person in self._followers:
                rows.append(self._row(person, sighting, self.frames - 1, frame.timestamp, prepare_ms))
            elif self._wait(self._waiting[person], sighting, frame.timestamp, prepare_ms):
                rows += self._learnt(person)
        return rows

    def _taken(self, frame: Frame) -> tuple[dict[int, Sighting], float]:
        """Return the sightings of the next frame by person, and the milliseconds per person of the detection."""
        self._check(frame)
        start = perf_counter()
        found = self.finder.find(frame.depth_mm, frame.timestamp, self._predictions())
        sightings = {s.id: s for s in self.joints.add(frame, found)}
        if self.sightings is not None:
            self.sightings.append(self.frames, sightings.values())
        known = self._followers.keys() | self._waiting.keys()
        prepare_ms = 1000.0 * (perf_counter() - start) / max(len(known | sightings.keys()), 1)
        for person in sorted(sightings.keys() - known):
            self._waiting[person] = Waiting(deque((None, moment, 0.0) for moment in self.timestamps))
        self.timestamps.append(frame.timestamp)
        return sightings, prepare_ms

    def finish(self) -> list[Row]:
        """Return the rows of people who were in view for too short a time; called after the last frame."""
        return [row for person in sorted(self._waiting) for row in self._learnt(person)]

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Restore a checkpoint that was written while `settled`; raises as `toolkit.io.checkpoint.restore`."""
        self._waiting = {}
        self._followers = {
            person: self.tracker.follower(self.finder.camera, self.level_rotation) for person in state["followers"]
        }
        restore(self, state, "tracker")

    def _predictions(self) -> Predictions:
        learners = {person: waiting.learner for person, waiting in self._waiting.items()}
        found = {person: learner for person, learner in learners.items() if learner is not None and learner.found}
        return Predictions({**self._followers, **found})

    def _check(self, frame: Frame) -> None:
        if self.timestamps and not frame.timestamp > self.timestamps[-1]:
            raise RecordingError(
                f"frame {self.frames} is of {frame.timestamp:.3f} s, and the one before it of "
                f"{self.timestamps[-1]:.3f} s; frames have to come in order"
            )

    def _wait(self, waiting: Waiting, sighting: Sighting | None, timestamp: float, prepare_ms: float) -> bool:
        """Store a sighting, learn from it, and return True if there are enough."""
        self._store(waiting, sighting, timestamp, prepare_ms)
        if waiting.learner is not None and sighting is not None:
            waiting.learner.observe(sighting, timestamp)
        return self._enough(waiting, timestamp)

    def _store(self, waiting: Waiting, sighting: Sighting | None, timestamp: float, prepare_ms: float) -> None:
        """Store a sighting; learning begins with the first one that has enough points."""
        waiting.frames.append((None if sighting is None else StoredSighting.of(sighting), timestamp, prepare_ms))
        if waiting.seen_since is None and sighting is not None:
            if np.count_nonzero(sighting.depth) >= self.tracker.settings.smallest_person:
                waiting.seen_since = timestamp
                if self.tracker.learning_seconds:
                    waiting.learner = self.tracker.learner(self.finder.camera, self.level_rotation, self._floor)

    def _enough(self, waiting: Waiting, timestamp: float) -> bool:
        """Return True if the sightings up to `timestamp` suffice for the body."""
        return waiting.seen_since is not None and timestamp - waiting.seen_since >= self.tracker.learning_seconds

    def _learnt(self, person: int) -> list[Row]:
        """Track the stored frames of a person with the learnt body."""
        waiting, camera = self._waiting.pop(person), self.finder.camera
        body = None if waiting.learner is None else waiting.learner.body
        self._followers[person] = self.tracker.follower(camera, self.level_rotation, body)
        return [
            self._row(person, None if kept is None else kept.sighting(), frame, moment, prepare_ms)
            for frame, (kept, moment, prepare_ms) in enumerate(waiting.frames)
        ]

    def _row(self, person: int, sighting: Sighting | None, frame: int, timestamp: float, prepare_ms: float) -> Row:
        clock = StageClock(self.tracker.stage_names)
        clock.charge(self.tracker.stage_names[0], prepare_ms)
        return Row(person, frame, timestamp, self._followers[person].step(sighting, timestamp, clock))
