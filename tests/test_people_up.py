"""Vertical: given, from a floor, from walls and people; rotated cameras."""

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, person_alone, scene, up_of_tilt
from toolkit.people.vertical import floor_height
from toolkit.recordings.opening import open_recording, open_upright
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera, rotated_points


def recorded(folder, frames, camera=KINECT, **more):
    path = folder / "recording.npz"
    save_recording(path, depth=frames, camera=camera, timestamps=np.arange(len(frames)) / 10, **more)
    return path


def degrees(a, b):
    return np.rad2deg(np.arccos(np.clip(np.dot(a, b), -1, 1)))


def test_the_vertical_of_the_file_is_used_unless_an_option_is_given(tmp_path):
    path = recorded(tmp_path, [person_alone(KINECT)], up_camera=up_of_tilt(0.2))
    vertical = open_recording(path).vertical
    assert vertical.source == "file" and degrees(vertical.up_camera, up_of_tilt(0.2)) < 1e-3
    vertical = open_recording(path, up_camera=(0, -1, 0)).vertical
    assert vertical.source == "option" and vertical.up_camera.tolist() == [0, -1, 0]


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_where_up_is_known_the_floor_is_still_found_and_without_one_it_is_not(tmp_path, tilt):
    frames = [scene(KINECT, ((x, 3.0),), tilt=tilt, height=1.6, wall=4.5, floor=True)[0] for x in (-0.3, 0.0, 0.3)]
    recording = open_recording(recorded(tmp_path, frames, up_camera=up_of_tilt(tilt)))
    assert recording.vertical.height is None
    assert floor_height(recording) == pytest.approx(1.6, abs=0.03)
    alone = open_recording(recorded(tmp_path, [person_alone(KINECT)], up_camera=up_of_tilt(0.0)))
    assert floor_height(alone) is None


@pytest.mark.parametrize("tilt", [0.0, 0.3, 0.6])
def test_a_floor_gives_the_vertical_and_the_camera_height(tmp_path, tilt):
    frames = [scene(KINECT, ((x, 3.0),), tilt=tilt, height=1.6, wall=4.5, floor=True)[0] for x in (-0.3, 0.0, 0.3)]
    vertical = open_recording(recorded(tmp_path, frames)).vertical
    assert vertical.source == "floor"
    assert degrees(vertical.up_camera, up_of_tilt(tilt)) < 1.5
    assert vertical.height == pytest.approx(1.6, abs=0.05)


@pytest.mark.parametrize("tilt", [0.3, 0.5])
def test_without_a_floor_people_who_stand_tell_up(tmp_path, tilt):
    frames = [scene(KINECT, ((x, 2.6),), tilt=tilt, height=2.0)[0] for x in (-0.3, 0.0, 0.3)]
    vertical = open_recording(recorded(tmp_path, frames)).vertical
    assert vertical.source == "assumed"
    assert degrees(vertical.up_camera, up_of_tilt(tilt)) < 7
    assert degrees(vertical.up_camera, (0, -1, 0)) > 10


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_camera_sees_the_turned_points_in_the_turned_image(turns):
    camera = Camera(210.0, 230.0, 80.0, 70.0, 176, 144, (0.1, -0.05, 0.004, -0.003, 0.01))
    turned = camera.rotated(turns)
    assert turned.rotated(4 - turns) == camera
    assert turned.shape == (camera.shape[::-1] if turns % 2 else camera.shape)
    slopes = np.dstack([camera.rays(), np.ones(camera.shape)])
    expected = rotated_points(np.rot90(slopes, -turns), turns)
    np.testing.assert_allclose(np.dstack([turned.rays(), np.ones(turned.shape)]), expected, atol=2e-5)


@pytest.mark.parametrize("degrees_turned", [90, 180, 270])
def test_a_recording_of_a_camera_on_its_side_is_turned_upright_with_all_that_belongs_to_it(tmp_path, degrees_turned):
    turns = degrees_turned // 90
    upright, _ = scene(KINECT, ((0.2, 2.6),), tilt=0.2, height=1.5, wall=4.0, floor=True)
    joints = np.random.default_rng(0).normal(size=(1, 20, 3)).astype(np.float32)
    more = {
        "background": np.rot90(scene(KINECT, (), tilt=0.2, height=1.5, wall=4.0, floor=True)[0], turns),
        "joints": rotated_points(joints, 4 - turns),
        "up_camera": rotated_points(up_of_tilt(0.2), 4 - turns),
        "color": [np.rot90(np.dstack([upright % 251] * 3).astype(np.uint8), turns)],
    }
    path = recorded(tmp_path, [np.rot90(upright, turns)], KINECT.rotated(4 - turns), **more)
    recording = open_recording(path, rotate=degrees_turned)
    np.testing.assert_array_equal(recording.depth(0), upright)
    np.testing.assert_array_equal(recording.color(0)[..., 0], upright % 251)
    np.testing.assert_allclose(recording.joints, joints, atol=1e-6)
    np.testing.assert_allclose(recording.up_camera, up_of_tilt(0.2), atol=1e-6)
    assert recording.camera == KINECT
    assert recording.background.shape == KINECT.shape
    assert recording.options == {"rotate": degrees_turned}


@pytest.mark.parametrize("turns", [1, 2, 3])
@pytest.mark.parametrize("stored", [True, False])
def test_a_camera_on_its_side_is_found_by_its_vertical_or_by_the_floor(tmp_path, turns, stored):
    frames = [scene(KINECT, ((x, 3.0),), tilt=0.2, height=1.5, wall=4.0, floor=True)[0] for x in (0.2, 0.0)]
    more = {"up_camera": rotated_points(up_of_tilt(0.2), 4 - turns)} if stored else {}
    path = recorded(tmp_path, [np.rot90(frame, turns) for frame in frames], KINECT.rotated(4 - turns), **more)
    recording = open_upright(path)
    assert recording.options == {"rotate": 90 * turns}
    np.testing.assert_array_equal(recording.depth(0), frames[0])
    assert open_upright(path, rotate=0, up_camera=(0, -1, 0)).options.get("rotate", 0) == 0
