"""Keyframes: the most confident of the frames that show most, in each stretch in view."""

import math
from collections.abc import Generator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.database import canonical
from toolkit.fitting.shape import ShapeSettings
from toolkit.io.parts import whole as whole_of
from toolkit.people.connection import HELD
from toolkit.people.sighting import Sighting
from toolkit.sensing.camera import Camera
from toolkit.tracking.heading import directions_faced, heading
from toolkit.tracking.planning import (
    CHECKED,
    MOMENT_GAP,
    SURVEYED,
    Plan,
    Planner,
    Stretch,
    Survey,
    frames_around,
    times_in_sight,
)
from toolkit.tracks import TRACKED

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


def test_a_long_absence_starts_a_new_stretch() -> None:
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
    """Follower that returns `shown` for each frame, and a person who faces +x."""

    level_rotation = np.diag([1.0, -1.0, -1.0])

    def __init__(self, shown: np.ndarray, whole: bool, top: float) -> None:
        self._shown, self._whole, self._top = shown, whole, top

    def shown(self, sighting: Sighting, timestamp: float) -> tuple[float, np.ndarray, float, bool]:
        return float(self._shown[round(timestamp * 20)]), np.array([1.0, 0.0]), self._top, self._whole


class FakeSightings:
    def __init__(self, frames: np.ndarray, pixels: np.ndarray) -> None:
        self.frames, self.pixels, self.asked = frames, pixels, []

    def __getitem__(self, frame: int) -> Sighting:
        self.asked.append(frame)
        assert frame in self.frames
        return Sighting(1, np.zeros(CAMERA.shape, np.float32), None, CAMERA)


def rows(yaw: float = 0.0) -> np.ndarray:
    """Return rows of the first pass: a person who stands still with one heading, from +z."""
    pose = canonical.place(np.zeros(skeleton.POSE_SIZE), np.zeros(4), np.array([0.0, 0.9, -3.0]), yaw)
    first = np.zeros(len(TIMES), dtype=[("joints", "<f4", (20, 3)), ("pose", "<f8", len(pose)), ("state", "u1")])
    first["pose"], first["state"] = pose, TRACKED
    return first


def planned(
    frames: np.ndarray,
    shown: np.ndarray,
    pixels: np.ndarray | None = None,
    *,
    whole: bool = True,
    top: float = math.nan,
    first_pass: np.ndarray | None = None,
    **others: Any,
) -> tuple[Plan | None, FakeSightings]:
    follower: Any = FakeFollower(shown, whole, top)
    seen: Any = FakeSightings(frames, np.full(len(frames), SMALLEST) if pixels is None else pixels)
    learner: Any = SimpleNamespace(follower=SimpleNamespace(floor=-1.0))
    first = rows(0.5 * np.pi) if first_pass is None else first_pass
    planner = Planner(learner, follower, seen, TIMES, ("all",), SMALLEST, BODY, first, **others)
    return whole_of(planner.run()), seen


def test_each_time_in_sight_has_the_frame_of_every_few_seconds_that_shows_most() -> None:
    frames, shown = np.concatenate([np.arange(0, 120), np.arange(200, 300)]), np.ones(400)
    step = round(SURVEYED * 20)
    shown[[10 * step, 22 * step, 42 * step]] = 9.0
    plan = planned(frames, shown)[0]
    assert plan is not None and plan.body is BODY and not plan.relearned and CHECKED == 5.0
    assert plan.stretches == (Stretch(0, 119, (10 * step, 22 * step)), Stretch(200, 299, (42 * step,)))


def test_a_stretch_that_heads_wrongly_in_the_first_pass_has_a_keyframe() -> None:
    first = rows(0.5 * np.pi)
    first["pose"][20:30] = rows(-0.5 * np.pi)["pose"][0]
    shown = np.ones(400)
    shown[5] = 9.0
    plan = planned(np.arange(0, 60), shown, first_pass=first)[0]
    assert plan is not None
    assert [frame for frame in plan.stretches[0].keyframes if frame != 5 and not 20 <= frame < 30] == []
    assert len(plan.stretches[0].keyframes) == 2


def test_frames_that_show_too_few_pixels_are_left_out_and_without_any_there_is_no_plan() -> None:
    frames = np.arange(0, 100)
    pixels = np.where(frames < 50, SMALLEST - 1, SMALLEST)
    plan, seen = planned(frames, np.ones(400), pixels)
    assert plan is not None and min(seen.asked) == plan.stretches[0].first == 50
    plan, seen = planned(frames, np.ones(400), np.zeros(100))
    assert plan is None and not seen.asked


def test_the_heading_is_that_of_the_votes_of_all_frames() -> None:
    plan, _ = planned(np.arange(0, 60), np.ones(400))
    assert plan is not None
    faced = directions_faced(np.arange(0, 60, 5) / 20, np.tile([1.0, 0.0], (12, 1)), TIMES)
    np.testing.assert_allclose(plan.heading, heading(0.0 * faced, faced))


@pytest.mark.parametrize(
    ("whole", "above", "relearn", "learnt"),
    [
        (True, math.nan, True, 0), (False, math.nan, False, 0), (False, math.nan, True, 1),
        (True, 0.1, True, 0), (True, -0.6, True, 0), (True, 0.2, True, 1), (True, 0.2, False, 0),
    ],
)  # fmt: skip
def test_sizes_are_searched_for_a_person_who_is_cut_off_in_every_keyframe_or_whose_head_is_too_high(
    whole: bool, above: float, relearn: bool, learnt: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    searched = []

    def own_body(self: Planner, *args: object) -> Generator[None, None, Body]:
        searched.append(args)
        yield
        return BODY

    monkeypatch.setattr(Planner, "_own_body", own_body)
    top = BODY.height - 1.0 + above  # the floor is at -1
    plan = planned(np.arange(0, 60), np.ones(400), whole=whole, top=top, relearn=relearn)[0]
    assert len(searched) == learnt and plan is not None and plan.relearned == bool(learnt)
