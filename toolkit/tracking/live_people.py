"""People in front of a live camera: a pose of each person in each frame at once, and the rows of their tracks later.

`MultiPersonTracker` gives no pose until a person's body is learnt, and then tracks the frames since they came in one
step. Here a person has a preview at once (`BodyLearner.preview`). Learning the body, and tracking the frames again with
it, is work that is spread over the frames that follow. It is measured in points of the sightings, not in time, so that
the same frames give the same poses on every machine.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from toolkit.body.body import Body
from toolkit.people.evidence import furniture
from toolkit.people.sighting import Sighting
from toolkit.sensing.stream import Frame
from toolkit.tracking.clock import StageClock
from toolkit.tracking.multi_person import MultiPersonTracker, Row, Waiting
from toolkit.tracking.sightings import StoredSighting
from toolkit.tracking.tracker_protocol import PersonFollower

FRAME_POINTS = 18_000
"""Work beside each new frame, for all people together: three frames of 6,000 points are tracked again. A frame takes 3
to 5 ms, so these take less than 15 ms; at 30 frames a second, the 90 frames of 3 s of learning are processed within
1.5 s. A sighting from which the body is learnt costs as much.
"""
PART_POINTS = 27_000
"""Cost of a part of a detection, 15 to 25 ms: two of three frames have one."""
MOST_POINTS = 14_400
"""Maximum cost of a person's frame: with 18,000 points beside each new frame, five frames are tracked again while four
arrive.
"""


class LivePose(NamedTuple):
    """Pose of one person in the newest frame.

    Attributes
    ----------
    row : person, frame, timestamp and result
    provisional : the body is still being learnt, or the frames before are still being tracked again with it
    """

    row: Row
    provisional: bool


class LiveFrame(NamedTuple):
    """Poses of a frame and the new rows of tracks.

    Attributes
    ----------
    poses : poses of each person in that frame, by rising number
    rows : rows of their tracks, with the learnt bodies: of this frame and of earlier ones, each once and in order
    """

    poses: list[LivePose]
    rows: list[Row]


Work = Iterator[int | None]
"""Work for one person: the cost of the next part in points, None while there is nothing to do."""


@dataclass
class _Job:
    """Work for one person, and the cost of its next part; None while there is nothing to do."""

    work: Work
    due: int | None = None
    done: bool = False

    def proceed(self) -> None:
        """Compute the part that is due."""
        try:
            self.due = next(self.work)
        except StopIteration:
            self.due, self.done = None, True


class LivePeople(MultiPersonTracker):
    """`MultiPersonTracker` that returns poses from the first frame on and bounds the work of each step.

    The rows are those of a `MultiPersonTracker` where people are cut out; in a room the people finder is given the
    provisional bodies.
    """

    def __init__(self, *arguments: object, **named: object) -> None:
        super().__init__(*arguments, **named)  # type: ignore[arg-type]
        self._jobs: dict[int, _Job] = {}
        self._learnt_followers: dict[int, PersonFollower] = {}
        self._rows: list[Row] = []
        self._points, self._ended = 0, False
        self._attempts: Counter[int] = Counter()

    def advance(self, frame: Frame) -> LiveFrame:
        """Take in the next frame.

        Raises
        ------
        RecordingError
            The frame has another size or type, or its time is not after that of the frame before.
        """
        sightings, prepare_ms = self._taken(frame)
        self._rows = [
            self._row(person, sightings.get(person), self.frames - 1, frame.timestamp, prepare_ms)
            for person in sorted(self._followers)
        ]
        for person in sorted(self._waiting):
            self._store(self._waiting[person], sightings.get(person), frame.timestamp, prepare_ms)
        self._work()
        shown = self._previews(sightings, frame.timestamp)
        shown |= {row.person: LivePose(row, False) for row in self._rows if row.frame == self.frames - 1}
        dropped = furniture(self.finder.evidence)
        return LiveFrame([shown[person] for person in sorted(shown.keys() - dropped)], self._rows)

    def body_of(self, person: int) -> Body:
        """Return the learned body of a person who has rows."""
        return {**self._learnt_followers, **self._followers}[person].body

    def finish(self) -> list[Row]:
        """Return the rows of all frames that are not tracked again yet, after the last frame."""
        self._ended, self._rows = True, []
        for person in sorted(self._waiting):
            job = self._jobs.get(person, _Job(self._work_for(person)))
            while not job.done:
                job.proceed()
        return self._rows

    def _work(self) -> None:
        """Advance the work for all people, person by person, as far as each frame allows."""
        self._points += FRAME_POINTS
        for person in sorted(self._waiting):
            if self._waiting[person].learner is not None and not self._attempts[person]:
                continue  # the first preview takes as long as a part
            job = self._jobs.setdefault(person, _Job(self._work_for(person)))
            if job.due is None:
                job.proceed()
            while job.due is not None and job.due <= self._points:
                self._points -= job.due
                job.proceed()
            if job.done:
                del self._jobs[person]
            elif job.due is not None:
                return  # the rest of the points counts for the part that is due
        self._points = 0

    def _work_for(self, person: int) -> Work:
        """Learn a person's body, track the frames so far again with it, and add their rows."""
        waiting = self._waiting[person]
        yield from self._learning(waiting)
        body = None if waiting.learner is None else waiting.learner.body
        follower = self.tracker.follower(self.finder.camera, self.level_rotation, body)
        self._learnt_followers[person] = follower
        number, found = 0, False
        while waiting.frames:
            stored, timestamp, prepare_ms = waiting.frames.popleft()
            if waiting.learner is not None:
                yield _cost_of(stored, found)
            clock = StageClock(self.tracker.stage_names)
            clock.charge(self.tracker.stage_names[0], prepare_ms)
            sighting, found = None if stored is None else stored.sighting(), found or stored is not None
            parts = follower.step_parts(sighting, timestamp, clock)
            while True:
                try:
                    next(parts)
                except StopIteration as ended:
                    self._rows.append(Row(person, number, timestamp, ended.value))
                    break
                if waiting.learner is not None:
                    yield PART_POINTS
            number += 1
        self._followers[person] = self._learnt_followers.pop(person)
        del self._waiting[person]

    def _learning(self, waiting: Waiting) -> Work:
        """Learn a body from the frames of a person as they come, as `MultiPersonTracker` does."""
        taken = 0
        while True:
            while taken == len(waiting.frames):
                if self._ended:
                    return
                yield None
            stored, timestamp, _ = waiting.frames[taken]
            taken += 1
            began = waiting.seen_since is not None and timestamp >= waiting.seen_since
            if began and waiting.learner is not None and stored is not None:
                for _part in waiting.learner.observe_parts(stored.sighting(), timestamp):
                    yield FRAME_POINTS if waiting.learner.body is not None else PART_POINTS
            if began and self._enough(waiting, timestamp):
                return

    def _previews(self, sightings: dict[int, Sighting], timestamp: float) -> dict[int, LivePose]:
        """Return the previews of the people whose rows are not there yet; one person is detected in each frame."""
        learners = {k: waiting.learner for k, waiting in sorted(self._waiting.items()) if waiting.learner is not None}
        new = [person for person, learner in learners.items() if not learner.found and person in sightings]
        for person in sorted(new, key=lambda person: self._attempts[person])[1:]:
            del learners[person]
        shown = {}
        for person, learner in learners.items():
            result = learner.preview(sightings.get(person), timestamp)
            self._attempts[person] += 1
            if result is not None:
                shown[person] = LivePose(Row(person, self.frames - 1, timestamp, result), True)
        return shown


def _cost_of(stored: StoredSighting | None, found: bool) -> int:
    """Return the cost of a person's frame in points; in a first one the pose is searched in the whole database."""
    if stored is None:
        return 120  # 20 to 60 microseconds
    return min(int(np.count_nonzero(stored.depth)), MOST_POINTS) if found else PART_POINTS
