"""Person or furniture: sum of evidence, and its effect in a room."""

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, ConstantOdds, scene
from toolkit.people.evidence import Evidence, person_score
from toolkit.people.learning import learnt, person_pixels
from toolkit.people.multi_person import MultiPersonFinder
from toolkit.people.newcomers import Newcomers
from toolkit.people.view import CoarseCamera
from toolkit.sensing.sensing_settings import SensingSettings

UP = np.array([0.0, -1.0, 0.0])
ROOM = {"height": 1.2, "wall": 4.0, "floor": True}


def test_motion_makes_a_person_of_a_head_that_the_network_rejects():
    still, moving = (Evidence(40, -40.0, moved) for moved in (0, 40))
    assert still.log_odds < 0 < moving.log_odds


def test_the_person_score_grows_with_the_log_odds_of_the_head_and_of_its_pixels():
    assert person_score(-2.0, 1.0) < person_score(0.0, 1.0) < person_score(3.0, 1.0)
    assert person_score(0.0, -3.0) < person_score(0.0, 1.0) < person_score(0.0, 5.0)
    assert person_score(-3.0, -3.0) < 0 < person_score(3.0, 3.0)


def coarse_camera_of(network=None):
    return CoarseCamera(KINECT, UP, SensingSettings(), network=network)


def downsampled(frames):
    return [coarse_camera_of().downsampled(depth) for depth in frames]


def test_a_motionless_sitter_is_background_unless_the_network_disagrees():
    frames = downsampled([scene(KINECT, ((0.0, 2.5),), **ROOM)[0]] * 12)
    furniture, person = (learnt(frames, coarse_camera_of(ConstantOdds(odds))) for odds in (-1.0, 2.0))
    v, u = furniture.background.shape[0] // 2, furniture.background.shape[1] // 2
    assert furniture.background[v, u] == pytest.approx(2.4, abs=0.15)
    assert person.background[v, u] == 0.0
    assert person.still[v, u], "a chair's back that flows together with them is found by it"
    assert person.background[v, 5] == furniture.background[v, 5] > 3.9


def test_a_person_who_moves_in_place_with_a_head_measured_at_times_is_no_background():
    frames = []
    for k in range(24):
        depth, who = scene(KINECT, (((-1) ** k * 0.08, 2.5),), **ROOM)
        v = np.nonzero(who == 1)[0]
        if k >= 10:
            depth[: int(v.min() + 0.3 * np.ptp(v))] = 0
        frames.append(depth)
    room = learnt(downsampled(frames), coarse_camera_of(ConstantOdds(2.0)))
    camera = coarse_camera_of().camera
    assert room.background[camera.height // 2, camera.width // 2] == 0.0


class Likes(ConstantOdds):
    """Network with a positive score at some coarse pixels, bool (h, w), and a negative one at all others."""

    def __init__(self, where):
        super().__init__(2.0)
        self.where = where

    def odds(self, depth, camera):
        people = np.where(depth > 0, np.where(self.where, np.float32(2), np.float32(-3)), np.float32(0))
        return people, super().odds(depth, camera)[1]


def seated_on_a_block():
    """Return frames of a motionless person beside a block in the same surface, and their places."""
    depth, who = scene(KINECT, ((0.0, 2.5),), **ROOM)
    v, u = np.nonzero(who == 1)
    block = np.zeros(who.shape, dtype=bool)
    block[int(np.quantile(v, 0.6)) : int(np.quantile(v, 0.9)), int(np.median(u)) : u.max() + 20] = True
    block &= who == 0
    depth[block] = 2500
    own, block = ((mask[::2, ::2]) for mask in (who == 1, block))
    return downsampled([depth] * 12), own, block


def test_a_motionless_surface_beside_a_person_is_background_if_the_network_rejects_it():
    frames, own, block = seated_on_a_block()
    one, two = (learnt(frames, coarse_camera_of(network)) for network in (ConstantOdds(2.0), Likes(own)))
    assert (one.background[block] == 0).mean() > 0.7, "the block flows together with them"
    assert (two.background[block] > 0).mean() > 0.7 and (two.background[own] == 0).mean() > 0.7
    assert two.owned[own].mean() > 0.7 and two.resting[own].mean() > 0.7 and not two.resting[two.background > 0].any()
    assert not two.unclaimed[two.owned].any(), "theirs have a moving person's reach"


def test_a_person_has_likely_pixels_that_are_connected_or_below_the_head():
    frames, own, block = seated_on_a_block()
    view = coarse_camera_of().view(frames[0], frames[0] > 0, np.zeros(own.shape, dtype=bool))
    place = (view.points[own][np.argmax(view.points[own][:, 1])] - (0.0, 0.1, 0.0)).astype(np.float64)
    aside = np.hypot(view.points[..., 0] - place[0], view.points[..., 2] - place[2])
    near, block, nothing = own & (aside < 0.35), block & (aside > 0.45), np.zeros(own.shape, dtype=bool)
    assert near.any() and block.any()
    likely, distant = (np.where(mask, 2.0, -3.0) for mask in (own, block))
    assert not person_pixels(view, nothing, place, distant).any(), "likely, but not below the head"
    assert person_pixels(view, nothing, place, likely)[near].all()
    found = person_pixels(view, own | block, place, likely)
    assert found[own].all() and not found[block].any()


def test_a_tracked_person_in_an_unknown_room_is_kept_despite_the_network():
    frames = [scene(KINECT, ((0.1 * k, 2.5),), **ROOM)[0] for k in range(8)]
    network = ConstantOdds(2.0)
    followed = MultiPersonFinder(KINECT, UP, network=network)
    assert len(followed.find(frames[0], 0.0, {})) == 1
    network.pixels, network.peak = 0.125, -1.0
    for k, depth in enumerate(frames):
        assert [s.id for s in followed.find(depth, 0.1 * (k + 1), {})] == [1]
        assert followed.people[0].head[0] == pytest.approx(0.1 * k, abs=0.05)
    assert not MultiPersonFinder(KINECT, UP, network=network).find(frames[-1], 0.0, {})


def test_a_desk_that_people_pass_is_no_part_of_them():
    """Their surfaces merge with it in some frames; in most it is separate."""
    frames = []
    for k in range(40):
        depth, _ = scene(KINECT, ((-1.2 + 0.06 * k, 2.4),), **ROOM)
        desk = np.s_[150:220, 150:200]
        depth[desk] = np.where(depth[desk] < 2500, depth[desk], 2500)
        frames.append(depth)
    room = learnt(downsampled(frames), coarse_camera_of(ConstantOdds(0.5)))
    assert np.median(room.background[80:105, 80:95]) == pytest.approx(2.5, abs=0.02)
    assert (room.background[80:105, 80:95] > 0).mean() > 0.95


def test_the_network_rejects_furniture_in_a_still():
    depth = scene(KINECT, ((0.0, 2.5),), **ROOM)[0]
    for odds, count in ((2.0, 1), (-2.0, 0)):
        network = ConstantOdds(odds)
        assert len(MultiPersonFinder(KINECT, UP, network=network).find(depth, 0.0, {})) == count
        assert network.calls > 0


HEAD = np.array([0.2, 0.1, -2.5])


def test_a_surface_that_touches_a_person_has_to_last_half_a_second():
    waiting = Newcomers()
    counted = [waiting.promoted([HEAD], [True], [True], k / 30) for k in range(20)]
    assert counted.index([0]) == 15
