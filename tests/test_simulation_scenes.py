"""Simulated scenes: several people, seats and furniture, clothes, small children, rooms without people."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.run_helpers import run as run_command
from tests.support.clothes import GARMENTS, dressed
from tests.support.proportions import grown_to
from toolkit.body import skeleton
from toolkit.body.shape import subject_body
from toolkit.io.errors import UsageError
from toolkit.mocap.clip import PoseClip
from toolkit.output.export.bvh import export_bvh
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.simulation.furniture import SEATS, Box
from toolkit.simulation.person import CHEST, SimulatedPerson, floor_of
from toolkit.simulation.seating import seat_height, seated
from toolkit.simulation.sensors import Surface, make_sensor
from toolkit.simulation.simulate import CaptureSettings, SimulatedFrame, prepare, simulate_scene
from training.interiors.room import around_people


def standing(frames: int = 2, travel: float = 0.0) -> PoseClip:
    """Return a standing person, arms down, who glides sideways by `travel` metres in all."""
    poses = np.zeros((frames, skeleton.POSE_SIZE))
    poses[:, 0] = np.linspace(0.0, travel, frames)
    poses[:, 1] = 0.9
    for side, angle in (("left", -1.2), ("right", 1.2)):
        poses[:, skeleton.POSE_NAMES.index(f"{side}_shoulder_rz")] = angle
    return PoseClip("standing", poses, 30.0, "test")


def first_frame(*people: SimulatedPerson, **shot: object) -> SimulatedFrame:
    return next(prepare(people, CaptureSettings(**shot)).frames())  # type: ignore[arg-type]


def joint(name: str) -> int:
    return skeleton.REPORTED.index(name)


def test_people_stand_at_their_places_of_the_floor_plan() -> None:
    simulation = prepare(
        [SimulatedPerson(standing(), at=(-0.7, 0.3)), SimulatedPerson(standing(), "child", at=(0.6, -0.5))]
    )
    pelvis = simulation.joints()[:, 0, joint("pelvis")]
    np.testing.assert_allclose(pelvis[:, 0], [-0.7, 0.6], atol=1e-6)
    level = pelvis @ simulation.view.R_level_camera.T
    np.testing.assert_allclose(level[:, 2] + 3.0, [0.3, -0.5], atol=1e-5)


def test_the_nearer_of_two_people_hides_the_other() -> None:
    near, far = SimulatedPerson(standing(), at=(0.0, 0.5)), SimulatedPerson(standing(), at=(0.0, -0.5))
    alone, both = first_frame(far, furnished=False), first_frame(near, far, furnished=False)
    shown = [(both.person == i).sum() for i in range(2)]
    assert shown[1] < 0.2 * (alone.person == 0).sum() < shown[0]
    assert np.median(both.depth[both.person == 0]) < 2700 < np.median(alone.depth[alone.person == 0])


def test_who_has_not_entered_or_has_left_is_not_a_number_and_not_in_the_image() -> None:
    people = [SimulatedPerson(standing(4), at=(-0.6, 0)), SimulatedPerson(standing(2), at=(0.6, 0), enters=1 / 30)]
    simulation = prepare(people, CaptureSettings(furnished=False))
    frames = list(simulation.frames())
    present = [np.isfinite(frame.joints).all(axis=(1, 2)).tolist() for frame in frames]
    assert present == [[True, False], [True, True], [True, True], [True, False]]
    assert [bool((frame.person == 1).any()) for frame in frames] == [False, True, True, False]


@pytest.mark.parametrize("number", [0, 2])
def test_the_truth_of_several_and_of_no_people_is_read_back(tmp_path: Path, number: int) -> None:
    people = [SimulatedPerson(standing(3), at=(0.8 * i, 0), enters=i / 30) for i in range(number)]
    recording = simulate_scene(people, tmp_path / "scene.npz", CaptureSettings(seconds=0.1))
    truth = prepare(people, CaptureSettings(seconds=0.1)).joints()
    assert recording.joints is not None and recording.joints.shape == (number, len(recording), 20, 3)
    np.testing.assert_array_equal(recording.joints, truth)
    save_recording(
        tmp_path / "again.npz", depth=recording.frames(), camera=recording.camera, timestamps=recording.timestamps,
        joints=recording.joints,
    )  # fmt: skip
    np.testing.assert_array_equal(open_recording(tmp_path / "again.npz").joints, truth)


def test_a_recording_without_its_empty_scene_shows_the_same_room() -> None:
    with_room, cut = first_frame(SimulatedPerson(standing())), first_frame(SimulatedPerson(standing()), furnished=False)
    assert (with_room.depth > 0).mean() > 0.9
    np.testing.assert_array_equal(with_room.depth[with_room.person == 0], cut.depth[cut.person == 0])
    assert not cut.depth[cut.person < 0].any()


def test_intersecting_people_are_rejected_and_touching_ones_are_not() -> None:
    with pytest.raises(UsageError, match="person 2 is inside person 1 in frame 0"):
        prepare([SimulatedPerson(standing()), SimulatedPerson(standing(), at=(0.1, 0.0))])
    gap = 2.0 * CHEST * subject_body("neutral").height + 0.01
    prepare([SimulatedPerson(standing()), SimulatedPerson(standing(), at=(gap, 0.0))])


def test_a_person_inside_furniture_is_rejected() -> None:
    post = Box((0.9, 0.0, -0.2), (1.1, 1.5, 0.2))
    with pytest.raises(UsageError, match="person 1 is inside box 1 of the room in frame 5"):
        prepare([SimulatedPerson(standing(11, travel=2.0), at=(1.0, 0.0))], CaptureSettings(boxes=(post,)))
    prepare([SimulatedPerson(standing())], CaptureSettings(boxes=(post,)))


def test_a_person_who_walks_through_another_is_rejected() -> None:
    with pytest.raises(UsageError, match="in frame 5"):
        prepare([SimulatedPerson(standing(11, travel=2.0)), SimulatedPerson(standing(11))])
    prepare([SimulatedPerson(standing(11, travel=2.0)), SimulatedPerson(standing(11), enters=1.0)])


@pytest.mark.parametrize("stature", [0.75, 1.0, 1.4, 2.1])
def test_a_body_grows_to_its_stature_and_the_small_have_larger_heads_and_shorter_legs(stature: float) -> None:
    body, whole = subject_body("child"), grown_to(subject_body("child"), stature)
    assert whole.height == pytest.approx(stature)

    def legs(of: object) -> float:
        ankle = skeleton.JOINT_NAMES.index("left_ankle")
        return -of.joints[ankle, 1] / of.height  # type: ignore[attr-defined]

    assert (legs(whole) < legs(body) - 0.01) == (stature < 1.25)


@pytest.mark.parametrize("name", ["tall_male", "child"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_who_sits_rests_on_the_seat_with_feet_on_the_floor(name: str, seed: int) -> None:
    body = subject_body(name)
    poses = seated(standing(3).poses, body, np.random.default_rng(seed))
    joints = dict(zip(skeleton.REPORTED, body.joint_positions(poses[0]), strict=True))
    assert seat_height(body) < joints["pelvis"][1] < seat_height(body) + 0.1 * body.height
    for side in ("left", "right"):
        knee, hip, foot = (joints[f"{side}_{part}"] for part in ("knee", "hip", "foot"))
        assert knee[2] - hip[2] > 0.18 * body.height, "thighs point forwards"
        assert abs(knee[1] - hip[1]) < 0.06 * body.height, "and are level"
        assert 0.0 < foot[1] < 0.05 * body.height
    assert abs(floor_of(body, poses)) < 0.03


def test_a_sitter_without_a_seat_gets_a_chair() -> None:
    sitter = SimulatedPerson(standing(), seated=True)
    chair, stool = (
        len(prepare([SimulatedPerson(standing(), seated=True, furniture=f)]).furniture.faces) for f in ((), ("stool",))
    )
    assert chair == 12 * len(SEATS["chair"](0.45)) and stool == 12 * len(SEATS["stool"](0.45))
    assert len(prepare([sitter]).performers) == 1


@pytest.mark.parametrize("garment", GARMENTS)
def test_clothes_cover_more_than_the_skin_and_leave_the_joints_where_they_are(garment: str) -> None:
    body = subject_body("average_female")
    worn = dressed(body, [garment])
    np.testing.assert_array_equal(worn.joint_positions(standing(1).poses), body.joint_positions(standing(1).poses))
    shown = [
        (first_frame(SimulatedPerson(standing(), body, dress=dress)).person == 0).sum()
        for dress in (None, partial(dressed, garments=[garment]))
    ]
    assert 1.03 * shown[0] < shown[1] < 2.0 * shown[0]


def test_the_command_records_an_empty_room(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "room.npz"
    assert run_command("simulate", "--output", output, "--seconds", "0.1", "--no-background") == 0
    assert "3 frames of 176x144" in capsys.readouterr().out
    assert open_recording(output).background is None


def test_a_room_has_the_boxes_of_its_settings() -> None:
    boxes = (Box((-0.4, 0.0, 0.0), (0.4, 1.6, 0.3)),)
    (frame,) = prepare([], CaptureSettings(boxes=boxes, seconds=0.03)).frames()
    assert np.median(frame.depth[65:80, 80:95]) == pytest.approx(2700, abs=40)


def test_the_command_records_two_people_as_they_are_described(tmp_path: Path) -> None:
    clip, output = tmp_path / "still.bvh", tmp_path / "pair.npz"
    export_bvh(clip, subject_body("neutral"), standing(3).poses, 30.0)
    arguments = ["--body", "neutral", "--body", "child", "--empty"]
    assert run_command("simulate", clip, clip, "--output", output, "--at", "-0.5,0", "--at", "0.6,0.2", *arguments) == 0
    recording = open_recording(output)
    assert recording.background is None
    pelvis, head = (recording.joints[:, 0, joint(name)] for name in ("pelvis", "head"))
    np.testing.assert_allclose(pelvis[:, 0], [-0.5, 0.6], atol=0.03)
    heights = np.linalg.norm(head - pelvis, axis=1)
    assert heights[1] / heights[0] < 0.9


def test_a_random_room_is_furnished_around_people_without_occluding_them() -> None:
    person = SimulatedPerson(standing())
    shown = (first_frame(person, sensor="kinect", height=1.5).person >= 0).sum()
    depths = []
    for room in ("office:1", "office:2", "office:1"):
        frame = first_frame(person, sensor="kinect", height=1.5, room=around_people(room))
        depths.append(frame.depth)
        assert (frame.person >= 0).sum() > 0.8 * shown
    assert np.array_equal(depths[0], depths[2]) and not np.array_equal(depths[0], depths[1])


@pytest.mark.parametrize("name", ["tof", "kinect"])
def test_glass_and_black_are_lost_and_what_is_plain_is_measured_as_without_materials(name: str) -> None:
    sensor = make_sensor(name)
    shape = sensor.camera.scaled(sensor.rays_per_side).shape
    depth, cosine = (np.full(shape, value, np.float32) for value in (3.0, 1.0))

    def measured(reflectance: float | None) -> float:
        light = None if reflectance is None else np.full(shape, reflectance, np.float32)
        surface = Surface(depth, cosine, np.full(shape, -1, np.int16), light)
        return float((sensor.measure(surface, np.random.default_rng(0))[0] > 0).mean())

    assert measured(0.0) == 0.0 and measured(0.05) < 0.5
    assert measured(1.0) == measured(None) > 0.95
