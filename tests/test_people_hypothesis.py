"""Person or furniture: how evidence adds up, and what it makes of a room."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, scene
from toolkit.landmarks.regressor import JointRegressor
from toolkit.people.hypothesis import EvidenceSample, alone_log_odds, judged_head, log_odds
from toolkit.people.learning import FEWEST, HeadTrack, below_heads, hanging, learnt
from toolkit.people.multi_person import MultiPersonFinder
from toolkit.people.newcomers import Newcomers
from toolkit.people.stills import people_and_furniture
from toolkit.people.surroundings import is_cut_out, room_of, tolerances
from toolkit.people.view import CoarseCamera
from toolkit.sensing.sensing_settings import SensingSettings

UP = np.array([0.0, -1.0, 0.0])
FIGURE = EvidenceSample(shaped=True, moved=0.0)
ROOM = {"height": 1.2, "wall": 4.0, "floor": True}


class Sure:
    """A judge that says the same of every pixel, and remembers how many it was asked."""

    def __init__(self, odds):
        self.odds, self.asked = odds, 0

    def log_odds(self, depth, camera, rotation, pixels):
        assert depth.shape == camera.shape and (depth.ravel()[pixels] > 0).all()
        self.asked += len(pixels)
        return np.full(len(pixels), self.odds)


def test_what_never_moves_is_furniture_even_in_the_shape_of_a_person():
    assert log_odds([FIGURE] * 40) < 0


@pytest.mark.parametrize(
    "glimpse",
    [
        EvidenceSample(True, moved=1.0),
        EvidenceSample(True, moved=0.0, alive=0.02),
        EvidenceSample(True, moved=0.0, head_alive=0.1),
        EvidenceSample(True, moved=0.0, judged=2.0),
    ],
    ids=["moved", "alive", "the head moves", "judged"],
)
def test_any_evidence_makes_a_person_of_a_shape_that_is_always_seen(glimpse):
    assert log_odds([glimpse] * 40) > 0


def test_a_shape_that_is_seldom_seen_counts_less_and_what_has_none_is_a_person_only_if_it_moves():
    shaped, shapeless = (EvidenceSample(shape, moved=0.0, alive=0.02) for shape in (True, False))
    assert log_odds([shaped] * 10 + [shapeless] * 30) < 0 < log_odds([shaped] * 40)
    assert log_odds([shapeless] * 40) < 0 < log_odds([EvidenceSample(False, 1.0, judged=3.0)] * 40)


def test_whoever_is_seen_in_few_frames_and_in_their_shape_in_all_of_them_is_a_person():
    """Who changes their place is another figure in each of them."""
    person = EvidenceSample(True, moved=0.0, judged=2.9)
    assert log_odds([person] * 10) == log_odds([person] * 40) > 0


def test_less_is_enough_in_a_still_and_a_judge_that_is_sure_does_without_a_shape():
    """What the judge says of a chair's back, of somebody in their shape, and of an arm before a face."""
    assert alone_log_odds(True, 0.5) < 0 < alone_log_odds(True, 1.5)
    assert alone_log_odds(False, 1.5) < 0 < alone_log_odds(False, 2.8)
    assert log_odds([EvidenceSample(True, 0.0, judged=1.1)]) < 0 < alone_log_odds(True, 1.1)
    assert alone_log_odds(False, None) < 0 < alone_log_odds(True, None)


def test_the_judge_contradicts_what_moves_and_is_not_believed_without_limit():
    door = EvidenceSample(True, moved=1.0, judged=-3.0)
    assert log_odds([door] * 40) < 0
    assert log_odds([EvidenceSample(True, 1.0, judged=-50.0)]) == log_odds([EvidenceSample(True, 1.0, judged=-4.0)])


def lens_of(camera=KINECT):
    return CoarseCamera(camera, UP, SensingSettings())


def coarse(frames):
    return [lens_of().coarse(depth) for depth in frames]


def test_somebody_who_sits_still_is_in_the_room_unless_the_judge_says_otherwise():
    frames = coarse([scene(KINECT, ((0.0, 2.5),), **ROOM)[0]] * 12)
    lens = lens_of()
    furniture, person = (learnt(frames, lens, judge) for judge in (None, Sure(2.0)))
    v, u = lens.camera.height // 2, lens.camera.width // 2
    assert furniture.background[v, u] == pytest.approx(2.4, abs=0.15) and len(furniture.figures) == 1
    assert person.background[v, u] == 0.0 and len(person.figures) == 0
    assert person.still[v, u], "a chair's back that flows together with them is found by it"
    assert person.background[v, 5] == furniture.background[v, 5] > 3.9


class Likes:
    """A judge that is for a person at some coarse pixels, bool (h, w), and against one at all others."""

    def __init__(self, where):
        self.where = where

    def log_odds(self, depth, camera, rotation, pixels):
        return np.where(self.where.ravel()[pixels], 2.0, -3.0)


def seated_on_a_block():
    """Frames of somebody who never moves, and beside them, in one surface, a block; where they and it are."""
    depth, who = scene(KINECT, ((0.0, 2.5),), **ROOM)
    v, u = np.nonzero(who == 1)
    block = np.zeros(who.shape, dtype=bool)
    block[int(np.quantile(v, 0.6)) : int(np.quantile(v, 0.9)), int(np.median(u)) : u.max() + 20] = True
    block &= who == 0
    depth[block] = 2500
    own, block = ((mask[::2, ::2]) for mask in (who == 1, block))
    return coarse([depth] * 12), own, block


def test_what_never_moved_beside_somebody_who_stays_is_the_rooms_where_the_judge_is_against_a_person():
    frames, own, block = seated_on_a_block()
    one, two = (learnt(frames, lens_of(), judge) for judge in (Sure(2.0), Likes(own)))
    assert (one.background[block] == 0).mean() > 0.7, "the block flows together with them"
    assert (two.background[block] > 0).mean() > 0.7 and (two.background[own] == 0).mean() > 0.7
    assert two.owned[own].mean() > 0.7 and two.resting[own].mean() > 0.7 and not two.resting[two.background > 0].any()
    assert not two.unclaimed[two.owned].any(), "theirs have a moving person's reach"


def test_what_hangs_on_a_head_over_likely_pixels_is_theirs_though_another_thing_had_it():
    frames, own, block = seated_on_a_block()
    lens = lens_of()
    view = lens.view(frames[0], frames[0] > 0, np.zeros(own.shape, dtype=bool))
    place = view.points[own][np.argmax(view.points[own][:, 1])] - (0.0, 0.1, 0.0)
    seen = HeadTrack(0, place.astype(np.float64), np.zeros(own.shape, dtype=bool), FIGURE)
    still = np.ones(own.shape, dtype=bool)
    found = hanging([seen], [seen], np.stack(frames), still, own, [], lens)
    assert found[own].mean() > 0.7 and not found[~own].any()
    assert not hanging([seen], [seen], np.stack(frames), still, ~own, [], lens).any()


def test_whoever_is_followed_in_an_unknown_room_stays_so_where_the_judge_doubts_them():
    frames = [scene(KINECT, ((0.1 * k, 2.5),), **ROOM)[0] for k in range(8)]
    judge = Sure(2.0)
    followed = MultiPersonFinder(KINECT, UP, judge=judge)
    assert len(followed.find(frames[0], 0.0, {})) == 1
    judge.odds = 0.5
    for k, depth in enumerate(frames):
        assert [s.id for s in followed.find(depth, 0.1 * (k + 1), {})] == [1]
        assert followed.people[0].head[0] == pytest.approx(0.1 * k, abs=0.05)
    assert not MultiPersonFinder(KINECT, UP, judge=judge).find(frames[-1], 0.0, {})


def test_a_head_in_a_still_is_nobodys_where_the_floor_says_that_it_is_too_high():
    depth = scene(KINECT, ((0.0, 2.5),), **ROOM)[0]
    lens = lens_of()
    frame = lens.coarse(depth)
    room = room_of(frame, lens)
    view = lens.view(frame, room.foreground(frame, lens.rays, tolerances(frame, lens)), room.still)
    for floor, count in ((-1.2, 1), (-3.2, 0)):
        assert len(people_and_furniture(view, lens, judge=Sure(2.0), floor=floor)[0]) == count


def test_a_desk_that_people_pass_is_no_part_of_them():
    """Their surfaces flow together with it in some frames; in most it stands alone."""
    frames = []
    for k in range(40):
        depth, _ = scene(KINECT, ((-1.2 + 0.06 * k, 2.4),), **ROOM)
        desk = np.s_[150:220, 150:200]
        depth[desk] = np.where(depth[desk] < 2500, depth[desk], 2500)
        frames.append(depth)
    room = learnt(coarse(frames), lens_of(), None)
    assert np.median(room.background[80:105, 80:95]) == pytest.approx(2.5, abs=0.02)
    assert (room.background[80:105, 80:95] > 0).mean() > 0.95


def walking_up_with_a_box():
    """Frames of somebody who comes nearer and carries a box before the waist, and where the legs are in the first."""
    frames, legs = [], np.zeros(0)
    for k in range(24):
        away = 2.9 - 0.05 * k
        depth, who = scene(KINECT, ((0.0, away),), **ROOM)
        v, u = np.nonzero(who == 1)
        top, bottom = v.min() + (0.35 * np.ptp(v)).astype(int), v.min() + (0.6 * np.ptp(v)).astype(int)
        depth[top:bottom, u.min() - 5 : u.max() + 5] = 1000 * (away - 0.6)
        if k == 0:
            legs = (who == 1) & (np.arange(len(who))[:, None] > bottom + 5)
        frames.append(depth)
    return coarse(frames), legs[::2, ::2]


def test_legs_below_a_carried_box_are_theirs_who_carries_it():
    """Nothing farther is ever seen where they were first, and the box parts them from the head."""
    frames, legs = walking_up_with_a_box()
    background = learnt(frames, lens_of(), Sure(2.0)).background[legs]
    assert (background == 0).mean() > 0.6 and ((background > 0) & (background < 3.1)).mean() < 0.2


def test_legs_of_somebody_who_stays_are_theirs_though_a_box_parts_them_from_the_head() -> None:
    """Nothing ever covers them, and nothing else is ever seen there."""
    frames, legs = walking_up_with_a_box()
    above = np.broadcast_to(np.arange(len(legs))[:, None] < np.nonzero(legs)[0].min(), legs.shape)
    theirs, rooms = (learnt(frames[:1] * 12, lens_of(), Likes(own)).background[legs] for own in (above | legs, above))
    assert (theirs == 0).mean() > 0.5 and (rooms > 0).mean() > 0.9


def test_what_lies_below_a_head_that_stays_is_near_it_and_lower() -> None:
    lens = lens_of()
    background = np.full(lens.camera.shape, 2.5, dtype=np.float32)
    points = lens.view(background, background > 0, background > 0).points
    place = np.array([0.1, 0.3, -2.5])
    wanted = (np.hypot(points[..., 0] - 0.1, points[..., 2] + 2.5) < 0.4) & (points[..., 1] < 0.3)
    near = np.ones((2 * FEWEST + 1, *background.shape), dtype=bool)
    near[2 * FEWEST] = False

    def found(frames: int) -> np.ndarray:
        nothing = np.zeros(background.shape, dtype=bool)
        seen = [HeadTrack(frame, place, nothing, EvidenceSample(True, 0.0)) for frame in range(frames)]
        return below_heads(seen, near, background, lens)

    assert (found(FEWEST + 1) == wanted).all() and wanted.any()
    assert not found(FEWEST).any(), "in as many samples nobody is above it"
    near[FEWEST - 1 :] = False
    assert not found(FEWEST + 1).any(), "too few show it"


def test_fewer_frames_than_tell_what_stays_give_no_background():
    frames = coarse([scene(KINECT, ((0.0, 2.5),), **ROOM)[0]] * (FEWEST - 1))
    room = learnt(frames, lens_of(), None)
    assert not room.known and not room.cut_out and not room.background.any() and room.planes


def test_people_who_are_not_cut_out_stay_so_in_a_short_recording():
    depth = coarse([scene(KINECT, ((0.0, 2.5),))[0]])
    assert is_cut_out(depth[0], lens_of())
    assert not learnt(depth, lens_of(), None).cut_out


def test_a_large_surface_without_a_head_says_that_nobody_is_cut_out():
    depth = scene(KINECT, ((0.9, 2.5),))[0]
    v, u = np.mgrid[: KINECT.height, : KINECT.width]
    sofa = (v > 100) & (u < 170) & (depth == 0)
    depth[sofa] = 2600 + 0.06 * (u[sofa] - 85) ** 2  # round, so that it is no plane
    assert not is_cut_out(coarse([depth])[0], lens_of())


def test_the_judge_of_a_still_sends_away_what_only_looks_like_a_person():
    depth = scene(KINECT, ((0.0, 2.5),), **ROOM)[0]
    for odds, count in ((2.0, 1), (-2.0, 0)):
        judge = Sure(odds)
        assert len(MultiPersonFinder(KINECT, UP, judge=judge).find(depth, 0.0, {})) == count
        assert judge.asked > 0


def test_a_head_without_measured_pixels_is_not_judged():
    lens = lens_of()
    empty = np.zeros(lens.camera.shape, dtype=np.float32)
    view = lens.view(empty, empty > 0, empty > 0)
    assert judged_head(view, lens, np.array([0.0, 0.0, -2.0]), Sure(3.0)) is None


def test_a_regressor_judges_by_log_odds_that_stay_finite(monkeypatch):
    monkeypatch.setattr(JointRegressor, "person_probability", lambda *_: np.array([0.0, 0.5, 1.0, 0.8]))
    ask = (np.ones((2, 2), np.float32), KINECT, np.eye(3), np.arange(4))
    odds = JointRegressor.log_odds(object.__new__(JointRegressor), *ask)
    assert np.isfinite(odds).all() and odds[0] == pytest.approx(-odds[2])
    assert odds[1] == 0.0 and odds[3] == pytest.approx(np.log(4.0))


HEAD = np.array([0.2, 0.1, -2.5])


def test_a_shape_apart_counts_at_once_and_what_has_none_in_its_third_frame():
    assert Newcomers().promoted([HEAD], [False], [True], 0.0) == [0]
    waiting = Newcomers()
    assert [waiting.promoted([HEAD], [False], [False], k / 30) for k in range(3)] == [[], [], [0]]


def test_what_touches_somebody_has_to_last_half_a_second():
    waiting = Newcomers()
    counted = [waiting.promoted([HEAD], [True], [True], k / 30) for k in range(20)]
    assert counted.index([0]) == 15


@pytest.mark.parametrize(("rate", "speed", "counts"), [(30.0, 2.0, True), (1.7, 1.0, True), (30.0, 12.0, False)])
def test_a_candidate_is_the_same_as_far_as_a_head_moves_between_two_frames(rate, speed, counts):
    waiting, found = Newcomers(), []
    for k in range(3):
        found += waiting.promoted([HEAD + (speed * k / rate, 0.0, 0.0)], [False], [False], k / rate)
    assert found == ([0] if counts else [])


def test_a_candidate_is_forgotten_after_a_third_of_a_second_without_it():
    for gap, counts in ((0.25, [0]), (0.4, [])):
        waiting = Newcomers()
        for time in (0.0, 1 / 30):
            waiting.promoted([HEAD], [False], [False], time)
        time = 1 / 30
        while time + 1 / 30 < 1 / 30 + gap:
            time += 1 / 30
            waiting.promoted([], [], [], time)
        assert waiting.promoted([HEAD], [False], [False], time + 1 / 30) == counts


def test_newcomers_go_on_from_their_state():
    waiting = Newcomers()
    for k in range(2):
        waiting.promoted([HEAD], [False], [False], k / 30)
    again = Newcomers()
    again.restore_state(waiting.export_state())
    assert again.promoted([HEAD], [False], [False], 2 / 30) == [0]
