"""Detection of several people and their identities from frame to frame."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, TOF, ConstantOdds, neutral, scene, standing, up_of_tilt
from toolkit.body.shape import load_body
from toolkit.body.skeleton import POSE_NAMES, POSE_SIZE, REPORTED
from toolkit.io.checkpoint import plain, restore
from toolkit.people.description import describe
from toolkit.people.multi_person import MultiPersonFinder
from toolkit.people.person_network import PersonNetwork
from toolkit.people.sighting import PredictedBody
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.people.surroundings import Surroundings
from toolkit.people.survey import find, find_people
from toolkit.people.view import CoarseCamera
from toolkit.people.visibility import hole_sizes, unobserved_pixels
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.simulation.raycast import render_depth

UP = np.array([0.0, -1.0, 0.0])


def overlap(mask, truth):
    return (mask & truth).sum() / max((mask | truth).sum(), 1)


def truth_of(sighting, who):
    """Return the simulated person of a sighting, and the overlap of their masks."""
    numbers = np.bincount(who[sighting.depth > 0])
    number = int(numbers.argmax())
    return number, overlap(sighting.depth > 0, who == number)


@pytest.mark.parametrize("camera", [KINECT, TOF])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_each_segmented_person_gets_a_sighting(camera, count):
    people = ((-0.7, 2.8), (0.6, 2.4), (0.0, 3.6))[:count]
    depth, who = scene(camera, people)
    sightings = MultiPersonFinder(camera, UP).find(depth, 0.0, {})
    assert [s.id for s in sightings] == list(range(1, count + 1))
    found = dict(truth_of(s, who) for s in sightings)
    assert sorted(found) == list(range(1, count + 1))
    assert min(found.values()) > 0.93
    for s in sightings:
        both = (s.depth > 0) & (depth > 0)
        assert np.abs(s.depth[both] - depth[both] / 1000).max() < 0.2


def squatting(shoulder: tuple[float, float], yaw: float) -> np.ndarray:
    """Return the depth of a cut-out man who squats with bent arms and raised fists, uint16 (H, W), millimetres."""
    body, pose = load_body("average_male"), np.zeros(POSE_SIZE)
    twist, forwards = shoulder
    angles = {
        "shoulder_rx": twist, "shoulder_ry": -forwards, "shoulder_rz": -0.3, "elbow_ry": -2.0, "hip_rx": -0.8,
        "hip_rz": 0.2, "knee_rx": 1.4, "ankle_rx": -0.6,
    }  # fmt: skip
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for name, value in angles.items():
            pose[POSE_NAMES.index(f"{side}_{name}")] = value if name.endswith("rx") else sign * value
    pose[POSE_NAMES.index("root_rx")], pose[POSE_NAMES.index("root_ry")] = 0.2, yaw
    pose[1], pose[2] = -0.9 - body.vertex_positions(pose)[:, 1].min(), -2.2
    seen = render_depth(body, pose, KINECT, level_rotation(UP))
    return np.rint(1000 * np.where(np.isfinite(seen), seen, 0.0)).astype(np.uint16)


@pytest.mark.parametrize("yaw", [0.0, 0.4])
@pytest.mark.parametrize("shoulder", [(-1.5, 0.3), (-1.5, 0.9), (-0.8, 0.9)])
def test_raised_fists_on_one_surface_are_no_second_person(shoulder, yaw):
    depth = squatting(shoulder, yaw)
    (sighting,) = MultiPersonFinder(KINECT, UP).find(depth, 0.0, {})
    assert ((sighting.depth > 0) & (depth > 0)).sum() > 0.95 * (depth > 0).sum()
    turned = Camera(KINECT.fy, KINECT.fx, KINECT.cy, 319.0 - KINECT.cx, 240, 320)
    assert len(MultiPersonFinder(turned, UP).find(np.rot90(depth).copy(), 0.0, {})) == 1


def test_two_cut_out_people_shoulder_to_shoulder_are_two():
    depth, _ = scene(KINECT, ((-0.22, 2.5), (0.22, 2.5)))
    assert len(MultiPersonFinder(KINECT, UP).find(depth, 0.0, {})) == 2


@pytest.mark.parametrize("camera", [KINECT, TOF])
@pytest.mark.parametrize("gap", [0.05, 0.15])
def test_holes_between_head_and_trunk_do_not_split_a_person(camera, gap):
    depth, who = scene(camera, ((0.0, 3.0),))
    depth, pixels = depth.copy(), camera.fy / 3.0
    chin = np.flatnonzero((who > 0).any(axis=1))[0] + round(0.24 * pixels)
    depth[chin : chin + round(gap * pixels)] = 0
    alone = SinglePersonSegmenter(camera, None, SensingSettings(), UP)
    for finder in (MultiPersonFinder(camera, UP), alone):
        (sighting,) = finder.find(depth, 0.0, {})
        assert ((sighting.depth > 0) & (depth > 0)).sum() > 0.98 * (depth > 0).sum()


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_people_in_a_room_are_found_in_a_single_frame(tilt):
    depth, who = scene(KINECT, ((-0.6, 2.6), (0.6, 3.1)), tilt=tilt, height=1.5, wall=4.5, floor=True)
    sightings = MultiPersonFinder(KINECT, up_of_tilt(tilt)).find(depth, 0.0, {})
    assert sorted(truth_of(s, who)[0] for s in sightings) == [1, 2]
    assert min(truth_of(s, who)[1] for s in sightings) > 0.85, "all but the soles"


def test_people_who_walk_in_an_unknown_room_keep_their_numbers_and_surfaces():
    finder, room = MultiPersonFinder(KINECT, UP), {"height": 1.5, "wall": 4.5, "floor": True}
    for k in range(12):
        depth, who = scene(KINECT, ((-0.6 + 0.02 * k, 2.6), (0.6, 3.1 - 0.02 * k)), **room)
        sightings = finder.find(depth, k / 30, {})
        assert [s.id for s in sightings] == [1, 2]
        assert min(truth_of(s, who)[1] for s in sightings) > 0.85
    (alone,) = finder.find(depth, 0.4, {}, only=2)
    assert alone.id == 2 and truth_of(alone, who)[1] > 0.85


def test_an_empty_room_has_no_people():
    depth, _ = scene(KINECT, (), height=1.5, wall=4.0, floor=True)
    finder = MultiPersonFinder(KINECT, UP)
    for k in range(5):
        assert finder.find(depth, k / 30, {}) == ()


def test_identities_outlast_two_people_who_cross():
    finder, seen = MultiPersonFinder(KINECT, UP), []
    for k in range(40):
        shift = -0.9 + 1.8 * k / 39
        depth, who = scene(KINECT, ((shift, 2.3), (-shift, 3.2)))
        for s in finder.find(depth, k / 20, {}):
            seen.append((k, s.id, truth_of(s, who)[0]))
    assert {(i, t) for _, i, t in seen} == {(i, t) for k, i, t in seen if k == 0}, "nobody changes the number"
    assert {i for _, i, _ in seen} == {1, 2}
    assert len({k for k, i, _ in seen if i == 1}) + len({k for k, i, _ in seen if i == 2}) >= 68


def test_a_returning_person_keeps_the_identity():
    finder = MultiPersonFinder(KINECT, UP)
    there = scene(KINECT, ((-0.6, 2.6), (0.7, 2.9)))[0]
    alone = scene(KINECT, ((0.7, 2.9),))[0]
    ids = []
    for k in range(60):
        depth = there if k < 10 or k >= 45 else alone
        ids.append(tuple(s.id for s in finder.find(depth, k / 15, {})))
    assert ids[0] == (1, 2) and len(ids[30]) == 1 and ids[-1] == (1, 2)


@pytest.mark.parametrize(("others", "most", "kept"), [(1, 16, False), (0, 16, True), (1, 2, True)])
def test_a_person_who_left_the_image_keeps_the_identity_if_no_other_can_enter(others, most, kept):
    """A person leaves and returns: beside another who stays, alone, and with at most two people."""
    finder, ids = MultiPersonFinder(KINECT, UP, most=most), []
    for k in range(75):
        since = min(k, 74 - k)
        walker = ((-0.9 - 0.1 * since, 2.4),) if since < 20 else ()
        depth, _ = scene(KINECT, (*walker, *((0.9, 2.6),) * others), wall=4.5)
        ids.append(tuple(s.id for s in finder.find(depth, k / 15, {})))
    assert len(ids[0]) == 1 + others and len(ids[37]) == others
    assert ids[-1] == (ids[0] if kept else (*ids[37], 3))


@pytest.mark.parametrize("speed", [0.07, 0.12])
def test_a_person_out_of_view_for_a_moment_keeps_the_identity(speed):
    """A person leaves the room's image, stands outside for 0.3 to 0.8 s, and returns at the same border."""
    finder, ids = MultiPersonFinder(KINECT, UP), []
    for k in range(-18, 19):
        x = 1.1 + speed * (18 - abs(k))
        depth, _ = scene(KINECT, ((x, 2.4),), wall=4.5, floor=True, height=1.5)
        ids.append(tuple(s.id for s in finder.find(depth, k / 15, {})))
    assert ids[0] == ids[-1] == (1,) and set(ids) == {(1,), ()}


def test_a_second_person_who_enters_is_number_two_within_half_a_second():
    finder = MultiPersonFinder(KINECT, UP)
    before, after = scene(KINECT, ((-0.6, 2.6),))[0], scene(KINECT, ((-0.6, 2.6), (0.7, 2.9)))[0]
    ids = [tuple(s.id for s in finder.find(before if k < 5 else after, k / 30, {})) for k in range(20)]
    assert ids[:5] == [(1,)] * 5 and ids[12:] == [(1, 2)] * 8


def test_a_restored_finder_goes_on_bit_for_bit():
    frames = [scene(KINECT, ((-0.6 + 0.05 * k, 2.3), (0.6 - 0.05 * k, 3.0)))[0] for k in range(12)]
    finder, other = MultiPersonFinder(KINECT, UP), MultiPersonFinder(KINECT, UP)
    for k in range(6):
        finder.find(frames[k], k / 20, {})
    restore(other, plain(finder), "people")
    for k in range(6, 12):
        one, two = finder.find(frames[k], k / 20, {}), other.find(frames[k], k / 20, {})
        assert [s.id for s in one] == [s.id for s in two]
        for a, b in zip(one, two, strict=True):
            np.testing.assert_array_equal(a.depth, b.depth)
            np.testing.assert_array_equal(a.unobserved, b.unobserved)


def test_a_neighbour_hides_what_is_behind_and_the_room_does_not():
    whole = np.array([[0, 1000, 2000, 3000, 1500]], dtype=np.uint16)
    own = np.array([[0, 0, 2.0, 0, 0]], dtype=np.float32)
    holes = hole_sizes(whole)
    assert unobserved_pixels(whole, own, holes).tolist() == [[True, True, False, False, True]]
    assert unobserved_pixels(whole, own, None).tolist() == [[False, True, False, False, True]]
    assert unobserved_pixels(whole[:, 2:4], own[:, 2:4], None) is None


def recorded(folder, frames, background=None):
    path = folder / "recording.npz"
    times = np.arange(len(frames)) / 30
    save_recording(path, depth=frames, camera=KINECT, timestamps=times, background=background, up_camera=UP)
    return open_recording(path)


@pytest.mark.parametrize("known", [True, False])
def test_a_room_is_known_from_its_empty_scene_or_learnt_from_people_who_walk(tmp_path, known):
    room = {"height": 1.2, "wall": 4.0, "floor": True}
    truth = [scene(KINECT, ((-0.9 + 0.06 * k, 2.4), (0.8 - 0.05 * k, 3.1)), **room) for k in range(30)]
    background = scene(KINECT, (), **room)[0] if known else None
    recording = recorded(tmp_path, [depth for depth, _ in truth], background)
    finder, overlaps = find_people(recording), []
    for k, (depth, who) in enumerate(truth):
        found = [truth_of(s, who) for s in finder.find(depth, k / 30, {})]
        overlaps += [o for _, o in found]
        assert len(found) == 2
    assert np.median(overlaps) > 0.9


@pytest.mark.data("realsense")
def test_two_men_in_a_real_room_are_two_from_the_first_frame_to_the_last(data_folder):
    recording = open_recording(data_folder / "depth/realsense/images_n40")
    finder = find(recording, None, SensingSettings())
    ids = [tuple(s.id for s in finder.find(recording.depth(i), i / 30, {})) for i in range(0, len(recording), 3)]
    assert set(ids) == {(1, 2)}


@pytest.mark.data("pairs")
@pytest.mark.parametrize(
    ("name", "count"),
    [("cleaning whiteboard", 1), ("person standing", 1), ("two people moving", 2), ("two people walking", 2)],
)
def test_single_frames_of_real_rooms_hold_the_right_number(data_folder, name, count):
    import cv2

    camera = Camera(527.0, 533.0, 319.5, 239.5, 640, 480)
    for k in (0, 1):
        depth = cv2.imread(str(data_folder / "depth/pairs" / name / f"depth{k}.png"), cv2.IMREAD_UNCHANGED)
        finder = MultiPersonFinder(camera, UP)
        assert len(finder.find((depth // 5).astype(np.uint16), 0.0, {})) == count


VIEWS = [(0.0, 1.2), (0.3, 1.8)]
"""Tilt in radians and height in metres of a camera that sees a standing person whole."""


def placed(x, distance, height=1.2, up=UP):
    """Return the simulated person's body as a follower predicts it."""
    body, pose = neutral()[0], standing(x, distance, height)
    head = body.joint_positions(pose)[REPORTED.index("head")]
    return PredictedBody(
        body.vertex_positions(pose) @ level_rotation(up), body.faces, body.height, head @ level_rotation(up)
    )


@pytest.mark.parametrize(("tilt", "height"), VIEWS)
def test_while_people_touch_their_bodies_share_out_the_pixels(tilt, height):
    places, up = ((-0.18, 2.5), (0.2, 2.62)), up_of_tilt(tilt)
    _, who = scene(KINECT, places, tilt=tilt, height=height)

    def overlaps(predicted):
        finder, numbers = MultiPersonFinder(KINECT, up), {}
        for k in range(12):  # they approach each other
            share = min(k / 10, 1.0)
            now = tuple((x * (1 - share) * 3 + x * share, d) for x, d in places)
            depth, who_now = scene(KINECT, now, tilt=tilt, height=height)
            bodies = {i: placed(*now[n - 1], height, up) for i, n in numbers.items()} if predicted else {}
            sightings = finder.find(depth, k / 15, bodies)
            numbers = numbers or {s.id: truth_of(s, who_now)[0] for s in sightings}
        return [truth_of(s, who)[1] for s in sightings]

    assert min(overlaps(predicted=True)) > 0.96
    assert min(overlaps(predicted=True)) > min(overlaps(predicted=False))


@pytest.mark.parametrize(("tilt", "height"), VIEWS)
def test_a_confirmed_body_predicts_the_head(tilt, height):
    up, rotation = up_of_tilt(tilt), level_rotation(up_of_tilt(tilt))
    finder, body = MultiPersonFinder(KINECT, up), placed(0.0, 2.6, height, up)
    depth, who = scene(KINECT, ((0.0, 2.6),), tilt=tilt, height=height)
    whole = depth.copy()
    finder.find(whole, 0.0, {})
    leaning = PredictedBody(body.vertices, body.faces, body.stature, body.head + 0.1 * rotation[0])
    v = np.nonzero(who == 1)[0]
    depth[: int(np.percentile(v, 25))] = 0  # head and shoulders are no longer measured
    finder.find(depth, 0.1, {1: leaning})
    (unknown,) = finder.people
    assert np.abs(unknown.expected(0.2) - rotation @ leaning.head).max() > 0.05, "nobody has seen that body's head"
    finder = MultiPersonFinder(KINECT, up)
    for k in range(2):
        finder.find(whole, k / 30, {1: body} if k else {})
    finder.find(depth, 0.1, {1: leaning})
    (known,) = finder.people
    assert np.abs(known.expected(0.1) - rotation @ leaning.head).max() < 0.01


def test_furniture_that_touches_a_person_is_separated_once_the_body_is_known():
    depth, who = scene(KINECT, ((0.0, 2.6),), height=1.2, wall=4.5)
    v, u = np.nonzero(who == 1)
    chair = np.zeros(depth.shape, dtype=bool)
    chair[int(np.median(v)) : v.max(), u.max() - 8 : u.max() + 25] = True
    chair &= who == 0
    depth[chair] = 2600
    sees = CoarseCamera(KINECT, UP, SensingSettings())
    background = sees.downsampled(np.where(who | chair, 0, depth).astype(np.uint16))
    room = Surroundings(False, True, background, np.full(background.shape, 0.05, np.float32), background == 0)
    finder = MultiPersonFinder(KINECT, UP, room)
    without = finder.find(depth, 0.0, {})[0].depth > 0
    known = finder.find(depth, 0.03, {1: placed(0.0, 2.6)})[0].depth > 0
    assert (without & chair).sum() > 0.8 * chair.sum()
    assert (known & chair).sum() < 0.35 * chair.sum(), "what is within 12 cm of the body stays"
    assert overlap(known & ~chair, who == 1) > 0.93


def test_a_motionless_figure_is_furniture_if_the_network_rejects_it(tmp_path, monkeypatch):
    monkeypatch.setattr(PersonNetwork, "odds", ConstantOdds(-0.5).odds)
    frames = [scene(KINECT, ((-0.8 + 0.05 * k, 2.4), (0.7, 3.2)), height=1.2, wall=4.0, floor=True) for k in range(20)]
    recording = recorded(tmp_path, [depth for depth, _ in frames])
    finder = find_people(recording)
    for k, (depth, who) in enumerate(frames):
        assert [truth_of(s, who)[0] for s in finder.find(depth, k / 30, {})] == [1]
    look = describe(recording)
    assert look.lines[3].startswith("people: 1 in") and len(look.sightings) == 1


def test_a_moved_camera_is_reported(tmp_path, caplog):
    def filmed(away: float, where: str) -> str:
        walls = [scene(KINECT, ((-0.6 + 0.06 * k, 2.4),), height=1.2, wall=4.0 - (k >= 10) * away) for k in range(20)]
        caplog.clear()
        find_people(recorded(tmp_path / where, [depth for depth, _ in walls]))
        return caplog.text

    assert "camera was moved" in filmed(0.8, "moved")
    assert not filmed(0.0, "fixed")
