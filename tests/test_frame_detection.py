"""One person in any frame: the inputs of the follower, and the use of its result."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.sensing.camera import Camera
from toolkit.tracking.follower import FollowedFrame, StepContext
from toolkit.tracking.frame_detection import NOTHING_FOUND, FrameDetector
from toolkit.tracking.heading import MAX_HEADING_PENALTY
from toolkit.tracking.person import last_pose
from toolkit.tracking.state import PersonState
from toolkit.tracking.trajectory_choice import Direction

BODY = load_body("neutral")
TIMES = np.array([0.0, 0.5, 1.0])
HEADING = np.array([[0.0, 1.0], [1.0, 0.0], [0.0, -1.0]])
CAMERA = Camera(50.0, 50.0, 4.5, 3.5, 10, 8)


class FakeFollower:
    """A follower that finds the person, who faces +z, in the frames `found`, and keeps the inputs of each step."""

    sizes = (BODY,)

    def __init__(self, found: tuple[int, ...]) -> None:
        self.state = PersonState.begin(BODY, sized=False, seed=0)
        self.found, self.inputs = found, list[Any]()

    def follow(
        self, state: PersonState, sighting: int, timestamp: float, context: StepContext, clock: object
    ) -> FollowedFrame:
        self.inputs.append((state, context.heading.tolist(), sighting, timestamp))
        after, row = replace(state, timestamp=timestamp, turn=state.turn + 1), f"row {sighting}"
        if sighting not in self.found:
            return FollowedFrame(row, after)  # type: ignore[arg-type]
        hypothesis = SimpleNamespace(pose=np.zeros(skeleton.POSE_SIZE), continues=True)
        winner = SimpleNamespace(hypothesis=hypothesis, comparison=SimpleNamespace(distance=0.05))
        return FollowedFrame(row, after, winner=winner, cost=0.7)  # type: ignore[arg-type]


def detector_of(follower: FakeFollower) -> FrameDetector:
    return FrameDetector(follower, BODY, range(3), TIMES, ("all",), HEADING)  # type: ignore[arg-type]


def test_a_frame_is_followed_with_its_sighting_its_time_and_its_heading() -> None:
    follower = FakeFollower((0, 1))
    detector = detector_of(follower)
    state = detector.unknown
    steps = []
    for frame in (2, 1):
        found = detector.follow(frame, state, Direction.BACKWARD)
        state = found.followed.state
        steps.append(found.step)
    inputs = [(heading, sighting, time) for _, heading, sighting, time in follower.inputs]
    assert inputs == [([0.0, -1.0], 2, 1.0), ([1.0, 0.0], 1, 0.5)]
    assert follower.inputs[1][0].turn == 1, "the second step continues from the first"
    assert [step.result for step in steps] == ["row 2", "row 1"]
    assert {step.direction for step in steps} == {Direction.BACKWARD}
    assert steps[0].cost == NOTHING_FOUND and not steps[0].continues
    assert steps[1].cost == pytest.approx(0.05) and steps[1].continues, "it faces across the heading"


def test_a_pose_that_disagrees_with_the_heading_costs_more() -> None:
    detector = detector_of(FakeFollower((0, 2)))
    costs = [detector.redetect(frame, Direction.FORWARD).step.cost for frame in (0, 2)]
    assert costs == pytest.approx([0.05 * (1 - MAX_HEADING_PENALTY), 0.05 * (1 + MAX_HEADING_PENALTY)])


def test_a_detection_has_the_body_and_nothing_of_other_frames() -> None:
    follower = FakeFollower((0, 2))
    detector = detector_of(follower)
    detector.follow(0, detector.unknown, Direction.FORWARD)
    seen, unseen = detector.redetect(2, Direction.FORWARD), detector.redetect(1, Direction.FORWARD)
    for state, *_ in follower.inputs:
        assert state.body is BODY and state.sized and state.timestamp is None and state.turn == 0
    assert (seen.followed.cost, seen.followed.state.timestamp, seen.step.result) == (0.7, 1.0, "row 2")
    assert unseen.followed.cost == np.inf and unseen.step.cost == NOTHING_FOUND
    assert detector.cost(1, np.zeros(skeleton.POSE_SIZE), unseen.followed) == np.inf


def test_the_state_of_a_given_pose_is_continued_from_that_frame() -> None:
    detector, pose = detector_of(FakeFollower(())), np.full(skeleton.POSE_SIZE, 0.1)
    state = detector.state_at(2, pose)
    assert state.timestamp == 1.0 and state.body is BODY and state.sized and last_pose(state) is pose
    assert state.previous is not None
    np.testing.assert_array_equal(state.previous.joints, BODY.key_points(pose)[0])
