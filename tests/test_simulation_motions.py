"""Simulated motions: joined clips, held objects, images that end at a height below the neck."""

from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support import acts
from tests.support.holding import HOLDINGS, held_mesh
from toolkit.body import skeleton
from toolkit.body.shape import load_body, subject_body
from toolkit.io.errors import UsageError
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import procedural_clips
from toolkit.simulation.joining import JOIN, joined
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.scene import cut_tilt, place_camera
from toolkit.simulation.seating import neck_height
from toolkit.simulation.sensors import make_sensor
from toolkit.simulation.simulate import CaptureSettings, prepare

LEFT, RIGHT = (skeleton.REPORTED.index(f"{side}_hand") for side in ("left", "right"))


def part(seed: int, frames: int) -> np.ndarray:
    """Return a clip (frames, P) that moves ahead and turns."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, frames)[:, None]
    poses = 0.2 * rng.normal(size=(1, skeleton.POSE_SIZE)) + share * 0.2 * rng.normal(size=(1, skeleton.POSE_SIZE))
    poses[:, :3] = [2.0, 0.9, -1.0] + share * rng.normal(size=3)
    poses[:, skeleton.ROOT_ROTATION] = share * [0.0, 1.0, 0.0] + [0.0, rng.uniform(-2.0, 2.0), 0.0]
    return poses


PARTS = [part(0, 20), part(1, 15), part(2, 30)]


def test_parts_keep_their_movement_and_go_on_where_the_one_before_ended() -> None:
    poses, starts = joined(PARTS)
    assert len(poses) == 20 + 15 + 30 + 2 * JOIN
    assert starts == [0, 20 + JOIN, 35 + 2 * JOIN]
    for start, own in zip(starts, PARTS, strict=True):
        here = poses[start : start + len(own)]
        np.testing.assert_allclose(here[:, 6:], own[:, 6:], err_msg="joints bend as they did")
        np.testing.assert_allclose(here[:, 1], own[:, 1], err_msg="heights are kept")
        turn = Rotation.from_rotvec(here[0, 3:6]) * Rotation.from_rotvec(own[0, 3:6]).inv()
        np.testing.assert_allclose(here[:, :3] - here[0, :3], turn.apply(own[:, :3] - own[0, :3]), atol=1e-9)
        if start:
            np.testing.assert_allclose(here[0, [0, 2]], poses[start - JOIN - 1, [0, 2]], err_msg="without a step")
            np.testing.assert_allclose(here[0, 3:6], poses[start - JOIN - 1, 3:6], atol=1e-9, err_msg="nor a turn")


def test_a_join_eases_from_pose_to_pose() -> None:
    poses, _ = joined(PARTS[:2])
    steps = np.abs(np.diff(poses[19 : 21 + JOIN, 6:], axis=0)).max(axis=1)
    assert steps.argmax() in (JOIN // 2 - 1, JOIN // 2, JOIN // 2 + 1) and steps[[0, -1]].max() < 0.3 * steps.max()
    before, after = poses[19, 6:], poses[20 + JOIN, 6:]
    share = (poses[20 : 20 + JOIN, 6:] - before) / (after - before)
    np.testing.assert_allclose(share + share[::-1], 1.0, atol=1e-6)


def standing(frames: int) -> np.ndarray:
    """Return poses (T, P) of a person who stands at the origin with the arms out."""
    poses = np.zeros((frames, skeleton.POSE_SIZE))
    poses[:, 1] = 0.9
    return poses


@pytest.mark.parametrize("kind", HOLDINGS)
def test_a_held_object_is_in_the_hands_and_belongs_to_no_person(kind: str) -> None:
    body = load_body("neutral")
    poses = acts.with_arms(standing(3), kind)
    joints = body.joint_positions(poses[0])
    thing = held_mesh(kind, joints)
    middle = 0.5 * (joints[LEFT] + joints[RIGHT]) if kind != "bag" else joints[LEFT] - [0.0, 0.3, 0.0]
    assert np.linalg.norm(thing.vertices.mean(axis=0) - middle) < 0.12
    clip = PoseClip("holds", poses, 30.0, "")
    frames = [
        next(iter(prepare([SimulatedPerson(clip, body, holds=holds)], CaptureSettings(sensor="kinect")).frames()))
        for holds in (None, partial(held_mesh, kind))
    ]
    changed = np.abs(frames[1].depth.astype(int) - frames[0].depth) > 150
    assert changed.sum() > 40 and (frames[1].person[changed] == -1).mean() > 0.8
    late = SimulatedPerson(clip, body, holds=partial(held_mesh, kind), held=(1.0, 2.0))
    assert prepare([late], CaptureSettings()).performers[0].held_thing(0) is None


@pytest.mark.parametrize(("height", "distance", "cut"), [(1.5, 1.4, 1.0), (1.2, 1.1, 0.7)])
def test_the_lowest_row_of_the_image_meets_the_subject_at_the_cut(height: float, distance: float, cut: float) -> None:
    camera = make_sensor("kinect").camera
    view = place_camera(distance=distance, height=height, tilt=cut_tilt(camera, height, distance, cut))
    (pixel,) = camera.project(view.to_camera(np.array([[0.0, cut, 0.0]])))
    assert pixel[1] == pytest.approx(camera.height - 1)


def test_a_camera_at_neck_height_sees_the_neck_level_with_it() -> None:
    clip, body = procedural_clips(["conduct"])[0], subject_body("slim_female")
    simulation = prepare([SimulatedPerson(clip, body)], CaptureSettings(height=None, cut=0.45))
    assert simulation.view.position[1] == pytest.approx(neck_height(body))


@pytest.mark.parametrize("seated", [False, True])
def test_a_cut_ends_the_image_as_far_below_the_neck(seated: bool) -> None:
    clip = procedural_clips(["conduct"])[0]
    body = subject_body("slim_female")
    shot = CaptureSettings(sensor="kinect", distance=1.4, height=1.3, cut=0.45)
    simulation = prepare([SimulatedPerson(clip, body, seated=seated)], shot)
    lowest = np.array([0.0, neck_height(body, seated=seated) - 0.45, 0.0])
    camera = simulation.sensor.camera
    assert camera.project(simulation.view.to_camera(lowest)[None])[0, 1] == pytest.approx(camera.height - 1)


@pytest.mark.parametrize(("values", "said"), [({"tilt": 5.0}, "give one"), ({"cut": float("nan")}, "below the neck")])
def test_a_cut_that_cannot_be_is_named(values: dict[str, float], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        CaptureSettings(**{"cut": 0.45, **values})
