"""One person looked at in any frame: what the follower is told, and what a look says of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from toolkit.body.shape import load_body
from toolkit.tracking.frame_detection import NOTHING_FOUND, FrameDetector
from toolkit.tracking.state import PersonState

BODY = load_body("neutral")
TIMES = np.array([0.0, 0.5, 1.0])
HEADING = np.array([[0.0, 1.0], [1.0, 0.0], [0.0, -1.0]])


class FakeFollower:
    """A follower that finds the person in the frames `found`, and remembers what it was told in each step."""

    def __init__(self, found: tuple[int, ...]) -> None:
        self.state = PersonState.begin(BODY, sized=False, seed=0)
        self.found, self.told, self.heading, self.distance = found, list[Any](), np.zeros(2), 0.05
        self.winner: Any = None

    def step(self, sighting: int, timestamp: float, clock: object) -> str:
        self.told.append((self.state, self.heading.tolist(), sighting, timestamp))
        self.state = replace(self.state, timestamp=timestamp, turn=self.state.turn + 1)
        pose = SimpleNamespace(hypothesis=SimpleNamespace(pose=np.ones(3), continues=True))
        self.winner = pose if sighting in self.found else None
        return f"row {sighting}"

    def weighed(self, distance: float, pose: np.ndarray) -> float:
        return distance + float(pose.sum())

    def cost(self, winner: object) -> float:
        return 0.7


def looker_of(follower: FakeFollower) -> FrameDetector:
    return FrameDetector(follower, range(3), TIMES, ("all",), HEADING)  # type: ignore[arg-type]


def test_each_frame_is_followed_with_its_sighting_its_time_and_where_the_person_heads() -> None:
    follower = FakeFollower((0, 2))
    looker = looker_of(follower)
    steps = [looker.follow(frame) for frame in (2, 1)]
    assert [(heading, sighting, time) for _, heading, sighting, time in follower.told] == [
        ([0.0, -1.0], 2, 1.0),
        ([1.0, 0.0], 1, 0.5),
    ]
    assert follower.told[1][0].turn == 1, "the second step goes on from the first"
    assert [step.result for step in steps] == ["row 2", "row 1"]
    assert steps[0].cost == pytest.approx(3.05) and steps[0].continues
    assert steps[1].cost == NOTHING_FOUND > 0.2 and not steps[1].continues


def test_a_look_afresh_knows_the_body_and_nothing_of_other_frames() -> None:
    follower, own = FakeFollower((0, 2)), load_body("slim_male")
    looker = looker_of(follower)
    looker.follow(0)
    seen, unseen = looker.redetect(2, own), looker.redetect(1, own)
    for state, *_ in follower.told[1:]:
        assert state.body is own and state.sized and state.timestamp is None and state.turn == 0
    assert (seen.cost, seen.state.timestamp, seen.step.result) == (0.7, 1.0, "row 2")
    assert unseen.cost == np.inf and unseen.step.cost == NOTHING_FOUND
