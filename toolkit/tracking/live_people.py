"""People in front of a live camera: a pose of each person in each frame at once, and the rows of their tracks later.

`MultiPersonTracker` gives no pose until a person's body is learnt, and then tracks the frames since they came in one
step. Here the poses of these frames are those of the learner, which follows the person with the body so far, and the
frames are tracked again with the learnt body a few at a time beside the following ones.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from toolkit.body.body import Body
from toolkit.people.evidence import furniture
from toolkit.people.sighting import Sighting
from toolkit.sensing.stream import Frame
from toolkit.tracking.multi_person import MultiPersonTracker, Row
from toolkit.tracking.sightings import StoredSighting
from toolkit.tracking.tracker_protocol import PersonFollower
from toolkit.tracks import FrameResult

PAST_FRAMES = 3
"""Earlier frames that are tracked again with each new one, for all people together. A frame takes 3 to 5 ms, so these
take less than 15 ms; at 30 frames a second, the 90 frames of 3 s of learning are processed within 1.5 s.
"""
ABSENT_FRAMES = 50
"""Frames without a sighting that take the time of one with it: 20 to 60 microseconds each."""


class LivePose(NamedTuple):
    """Pose of one person in the newest frame.

    Attributes
    ----------
    row : person, frame, timestamp and result
    provisional : the body is still being learnt, or the frames since then are not caught up with
    """

    row: Row
    provisional: bool


class LiveFrame(NamedTuple):
    """Poses of a frame and the new rows of tracks.

    Attributes
    ----------
    poses : of each person in that frame, by rising number
    rows : of their tracks, with the learnt bodies: of this frame and of earlier ones, each once and in order
    """

    poses: list[LivePose]
    rows: list[Row]


@dataclass
class _Past:
    """Frames of a person that are tracked again with the learnt body; `number` is that of the first one.

    No frame is tracked in the step that learns the body, and the first sighting, for which the pose is searched in the
    whole database, has a step for itself.
    """

    follower: PersonFollower
    frames: deque[tuple[StoredSighting | None, float, float]]
    number: int = 0
    begun: bool = False
    found: bool = False

    def cost(self) -> int:
        """Return the cost of the next frame in frames without a sighting."""
        if self.frames[0][0] is None:
            return 1
        return ABSENT_FRAMES if self.found else PAST_FRAMES * ABSENT_FRAMES


class LivePeople(MultiPersonTracker):
    """`MultiPersonTracker` that returns poses from the first frame on and never tracks many frames in one step.

    The rows are those of a `MultiPersonTracker` where people are cut out; in a room the people finder is given the
    provisional bodies a little longer.
    """

    def __init__(self, *arguments: object, **named: object) -> None:
        super().__init__(*arguments, **named)  # type: ignore[arg-type]
        self._past: dict[int, _Past] = {}

    def advance(self, frame: Frame) -> LiveFrame:
        """Take in the next frame.

        Raises
        ------
        RecordingError
            The frame has another size or type, or its time is not after that of the frame before.
        """
        sightings, prepare_ms = self._taken(frame)
        poses: list[LivePose] = []
        rows: list[Row] = []
        for person in sorted(self._followers):
            row = self._row(person, sightings.get(person), self.frames - 1, frame.timestamp, prepare_ms)
            poses.append(LivePose(row, False))
            rows.append(row)
        for person in sorted(self._waiting):
            result = self._provisional(person, sightings.get(person), frame.timestamp, prepare_ms)
            if result is not None:
                poses.append(LivePose(Row(person, self.frames - 1, frame.timestamp, result), True))
        caught_up = list(self._caught_up(PAST_FRAMES * ABSENT_FRAMES))
        rows += caught_up
        newest = {row.person: row for row in caught_up if row.frame == self.frames - 1}
        shown = {pose.row.person: pose for pose in poses} | {k: LivePose(row, False) for k, row in newest.items()}
        dropped = furniture(self.finder.evidence)
        return LiveFrame([shown[person] for person in sorted(shown.keys() - dropped)], rows)

    def body_of(self, person: int) -> Body:
        """Return the learned body of a person who has rows."""
        return self._past[person].follower.body if person in self._past else self._followers[person].body

    def finish(self) -> list[Row]:
        """Return the rows of all frames that are not caught up with, after the last frame."""
        rows = list(self._caught_up(None))
        return rows + super().finish()

    def _provisional(
        self, person: int, sighting: Sighting | None, timestamp: float, prepare_ms: float
    ) -> FrameResult | None:
        """Let the learner process a frame; return its pose, which is of an earlier frame if it takes fewer."""
        waiting = self._waiting[person]
        if person in self._past:
            stored = None if sighting is None else StoredSighting.of(sighting)
            self._past[person].frames.append((stored, timestamp, prepare_ms))
            if waiting.learner is not None and sighting is not None:
                waiting.learner.observe(sighting, timestamp)
        elif self._wait(waiting, sighting, timestamp, prepare_ms):
            body = None if waiting.learner is None else waiting.learner.body
            follower = self.tracker.follower(self.finder.camera, self.level_rotation, body)
            at_once = waiting.learner is None
            self._past[person] = _Past(follower, deque(waiting.frames), begun=at_once, found=at_once)
        return None if waiting.learner is None else waiting.learner.result

    def _caught_up(self, budget: int | None) -> Iterator[Row]:
        """Track earlier frames again with the learnt bodies, within a budget in frames without a sighting."""
        for person in sorted(self._past):
            past = self._past[person]
            if budget is not None and not past.begun:
                past.begun = True
                continue
            while past.frames:
                if budget is not None and (budget := budget - past.cost()) < 0:
                    return
                stored, timestamp, prepare_ms = past.frames.popleft()
                past.found = past.found or stored is not None
                sighting = None if stored is None else stored.sighting()
                yield self._row_of(past.follower, person, sighting, past.number, timestamp, prepare_ms)
                past.number += 1
            del self._past[person], self._waiting[person]
            self._followers[person] = past.follower
