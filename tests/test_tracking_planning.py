"""Where a person of a recording is begun: the surest of the frames that show most, in each time in sight."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.fitting.shape import ShapeSettings
from toolkit.people.sighting import Sighting
from toolkit.sensing.camera import Camera
from toolkit.tracking.follower import HELD
from toolkit.tracking.heading import directions_faced, heading
from toolkit.tracking.planning import (
    CHECKED,
    MOMENT_GAP,
    MOMENTS,
    SURVEYED,
    Planner,
    Survey,
    frames_around,
    times_in_sight,
)
from toolkit.tracking.state import PersonState
from toolkit.tracks import TRACKED, FrameResult

CAMERA = Camera(50.0, 50.0, 4.5, 3.5, 10, 8)
BODY = load_body("neutral")
TIMES = np.arange(400) / 20  # 20 s
SMALLEST = 100


def test_the_best_frames_show_most_and_are_a_second_apart() -> None:
    shown = np.array([1.0, 9.0, 8.0, 2.0, 7.0, 3.0])
    survey = Survey(np.array([0, 20, 25, 40, 60, 80]), shown, np.zeros((6, 2)), np.zeros(6), np.ones(6, bool))
    assert survey.best(2, 0, 100, TIMES) == [20, 60], "25 is a quarter of a second beside the best"
    assert survey.best(9, 0, 100, TIMES) == [20, 60, 80, 40, 0]
    assert survey.best(9, 25, 60, TIMES) == [25, 60]
    assert survey.best(9, 20, 40, TIMES) == [20, 40] and survey.best(1, 20, 40, TIMES) == [20]
    assert survey.best(9, 20, 25, TIMES) == [20, 25], "of a quarter of a second both ends"
    assert survey.best(3, 61, 79, TIMES) == []
    assert MOMENT_GAP == 1.0


def test_who_is_out_of_sight_for_longer_than_a_moment_begins_anew() -> None:
    gap = round(HELD * 20)
    usable = np.array([5, 6, 7, 7 + gap, 8 + gap, 9 + 2 * gap])
    assert times_in_sight(usable, TIMES) == [(5, 8 + gap), (9 + 2 * gap, 9 + 2 * gap)]
    assert times_in_sight(np.array([3]), TIMES) == [(3, 3)]


def test_a_body_is_learnt_of_the_nearest_frames_on_both_sides_evenly_spread() -> None:
    settings = replace(ShapeSettings(), rate=2.0, seconds=3.0)
    frames = frames_around(200, np.arange(400), TIMES, settings)
    assert len(frames) == 6 and 200 in frames
    for side in (frames[frames >= 200], frames[frames < 200]):  # 10 frames are half a second
        assert len(side) == 3 and ((np.diff(side) >= 7) & (np.diff(side) <= 10)).all()
    late = frames_around(390, np.arange(400), TIMES, settings)
    assert (late < 390).sum() == 4, "there is little after it"


class FakeFollower:
    """Sees what `shown` says in each frame, somebody who surely faces +x, and its pose costs `costs` there."""

    def __init__(self, shown: np.ndarray, costs: np.ndarray) -> None:
        self._shown, self._costs = shown, costs
        self.state, self.heading, self.stepped = PersonState.begin(BODY, sized=False, seed=0), np.zeros(2), []
        self.winner: Any = None

    def shown(self, sighting: Sighting, timestamp: float) -> tuple[float, np.ndarray, float, bool]:
        return float(self._shown[round(timestamp * 20)]), np.array([1.0, 0.0]), math.nan, True

    def step(self, sighting: Sighting, timestamp: float, clock: object) -> FrameResult:
        assert self.state.sized and self.state.body is BODY
        assert self.state.timestamp is None, "a look afresh knows of no other frame"
        self.stepped.append(round(timestamp * 20))
        self.state = replace(self.state, timestamp=timestamp)
        hypothesis = SimpleNamespace(pose=np.zeros(skeleton.POSE_SIZE), continues=False)
        self.winner = SimpleNamespace(hypothesis=hypothesis, cost=float(self._costs[self.stepped[-1]]))
        joints = np.zeros((len(skeleton.REPORTED), 3), np.float32)
        return FrameResult(hypothesis.pose, joints, joints[:, 0], TRACKED, 0, np.zeros(3, np.float32))

    @property
    def distance(self) -> float:
        return self.winner.cost

    def weighed(self, cost: float, pose: np.ndarray) -> float:
        return cost

    def cost(self, scored: Any) -> float:
        return scored.cost


class FakeSightings:
    def __init__(self, frames: np.ndarray, pixels: np.ndarray) -> None:
        self.frames, self.pixels, self.asked = frames, pixels, []

    def __getitem__(self, frame: int) -> Sighting:
        self.asked.append(frame)
        assert frame in self.frames
        return Sighting(1, np.zeros(CAMERA.shape, np.float32), None, CAMERA)


def planned(
    frames: np.ndarray,
    shown: np.ndarray,
    costs: np.ndarray,
    pixels: np.ndarray | None = None,
    **others: Any,
) -> tuple[Planner, FakeFollower, FakeSightings]:
    follower = FakeFollower(shown, costs)
    seen = FakeSightings(frames, np.full(len(frames), SMALLEST) if pixels is None else pixels)
    learner = SimpleNamespace(follower=SimpleNamespace(heading=np.zeros(2), floor=None))
    planner = Planner(learner, follower, seen, TIMES, ("prepare", "landmarks", "select"), SMALLEST, BODY, **others)  # type: ignore[arg-type]
    for _ in planner.run():
        pass
    return planner, follower, seen


def test_each_time_in_sight_begins_at_its_surest_frame_and_others_are_checked() -> None:
    frames = np.concatenate([np.arange(0, 100), np.arange(200, 300)])
    shown, costs = np.ones(400), np.full(400, 0.2)
    step = round(SURVEYED * 20)
    best = {10 * step: 9.0, 16 * step: 8.0, 42 * step: 9.0, 48 * step: 8.0}
    for frame, value in best.items():
        shown[frame] = value
    costs[16 * step], costs[42 * step] = 0.1, 0.1
    planner, follower, _ = planned(frames, shown, costs)
    plan = planner.plan
    assert plan is not None and plan.body is BODY
    assert plan.stretches.tolist() == [[0, 99, 16 * step], [200, 299, 42 * step]]
    checked = plan.checks[:, 0].tolist()
    assert {10 * step, 48 * step} <= set(checked) and not {16 * step, 42 * step} & set(checked)
    assert [number for frame, number, _ in plan.checks] == [int(frame >= 200) for frame in checked]
    assert len(checked) >= 2 * (5 // CHECKED)
    assert len(follower.stepped) == 2 * MOMENTS
    assert sorted(plan.looks) == sorted(follower.stepped) and set(plan.stretches[:, 2]) <= plan.looks.keys()
    for frame, look in plan.looks.items():
        assert look.cost == look.step.cost == costs[frame] and look.state.timestamp == TIMES[frame]


def test_frames_that_show_too_few_pixels_are_left_out_and_without_any_there_is_no_plan() -> None:
    frames = np.arange(0, 100)
    pixels = np.where(frames < 50, SMALLEST - 1, SMALLEST)
    planner, _, seen = planned(frames, np.ones(400), np.ones(400), pixels)
    assert planner.plan is not None and min(seen.asked) == planner.plan.stretches[0, 0] == 50
    planner, _, seen = planned(frames, np.ones(400), np.ones(400), np.zeros(100))
    assert planner.plan is None and not seen.asked


def test_followers_are_told_where_the_person_walks_and_faces_in_the_frame_that_they_look_at() -> None:
    walked = np.linspace(-1.0, 1.0, 800).reshape(400, 2)
    planner, follower, seen = planned(np.arange(0, 60), np.ones(400), np.ones(400), walked=walked)
    assert planner.plan is not None
    faced = directions_faced(np.arange(0, 60, 5) / 20, np.tile([1.0, 0.0], (12, 1)), TIMES)
    np.testing.assert_allclose(planner.plan.heading, heading(walked, faced))
    assert follower.heading == pytest.approx(planner.plan.heading[seen.asked[-1]])


def test_a_frame_is_looked_at_afresh_though_it_has_become_known_since_where_the_person_heads() -> None:
    planner, follower, _ = planned(np.arange(0, 60), np.ones(400), np.ones(400))
    looked = len(follower.stepped)
    assert follower.state.timestamp is not None
    for _ in planner.run():
        pass
    assert len(follower.stepped) == 2 * looked


@pytest.mark.parametrize(("whole", "relearn", "learnt"), [(True, True, 0), (False, False, 0), (False, True, 1)])
def test_sizes_are_searched_only_for_a_person_who_is_cut_off_in_every_keyframe(
    whole: bool, relearn: bool, learnt: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    searched = []

    def own_body(self: Planner, *args: object) -> Iterator[None]:
        searched.append(args)
        yield
        return BODY

    monkeypatch.setattr(Planner, "_own_body", own_body)
    monkeypatch.setattr(FakeFollower, "shown", lambda self, *_: (1.0, np.zeros(2), math.nan, whole))
    planner, _, _ = planned(np.arange(0, 60), np.ones(400), np.ones(400), relearn=relearn)
    assert len(searched) == learnt and planner.plan is not None and planner.plan.body is BODY
