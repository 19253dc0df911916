"""Camera, level frame and cloud."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.sensing_scenes import KINECT, TOF, person_alone, up_of_tilt
from toolkit.io.errors import RecordingError
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.cloud import Cloud


def test_integer_pixels_are_pixel_centres():
    rays = KINECT.rays()
    points = np.dstack([rays, np.ones(KINECT.shape)]) * 2.5
    u, v = np.meshgrid(np.arange(320), np.arange(240))
    np.testing.assert_allclose(KINECT.project(points), np.dstack([u, v]), atol=1e-9)


def test_points_behind_the_camera_project_to_nan():
    assert np.isnan(KINECT.project(np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]))).all()


def test_rays_of_a_distorting_lens_are_its_inverse():
    import cv2

    camera = Camera(285.0, 285.0, 160.0, 120.0, 320, 240, (0.1, -0.05, 0.001, -0.002, 0.0))
    slopes = camera.rays()[::40, ::40].reshape(-1, 2)
    points = np.column_stack([slopes, np.ones(len(slopes))])
    seen = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion))[0][:, 0]
    v, u = (grid.ravel() for grid in np.mgrid[0:240:40, 0:320:40])
    np.testing.assert_allclose(seen, np.column_stack([u, v]), atol=0.02)


def test_a_subsampled_camera_sees_every_second_pixel():
    np.testing.assert_allclose(KINECT.subsampled(2).rays(), KINECT.rays()[::2, ::2])
    assert Camera(100, 100, 5, 5, 11, 11).subsampled(2).shape == (6, 6)


def test_a_scaled_camera_keeps_the_corners_of_the_image():
    half = KINECT.scaled(0.5)
    for camera in (KINECT, half):
        edge = (camera.width - 0.5 - camera.cx) / camera.fx
        assert edge == pytest.approx((KINECT.width - 0.5 - KINECT.cx) / KINECT.fx)
    assert half.shape == (120, 160)


def test_a_mirrored_camera_sees_the_flipped_rays():
    camera = Camera(285.0, 280.0, 150.0, 120.0, 320, 240, (0.1, -0.05, 0.001, -0.002, 0.0))
    flipped = camera.mirrored().rays()
    np.testing.assert_allclose(flipped[..., 0], -camera.rays()[:, ::-1, 0], atol=1e-6)
    np.testing.assert_allclose(flipped[..., 1], camera.rays()[:, ::-1, 1], atol=1e-6)


@pytest.mark.parametrize(
    ("values", "part"),
    [
        ((np.nan, 285, 159, 120), "not finite"),
        ((0.0, 285, 159, 120), "focal length of 0"),
        ((-285, 285, 159, 120), "focal length of -285"),
        ((0.9, 0.9, 0.5, 0.5), "implausible"),
        ((285, 285, 159e3, 120), "principal point"),
    ],
)
def test_absurd_intrinsics_are_named(values, part):
    with pytest.raises(RecordingError, match=part):
        Camera(*values, 320, 240)


@given(st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
@settings(max_examples=50, deadline=None)
def test_the_level_frame_is_a_rotation_with_up_as_y(tilt, roll):
    up = up_of_tilt(tilt)
    up = np.array([up[0] * np.cos(roll) - up[1] * np.sin(roll), up[0] * np.sin(roll) + up[1] * np.cos(roll), up[2]])
    rotation = level_rotation(3.0 * up)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation @ up, (0, 1, 0), atol=1e-12)
    assert (rotation @ (0, 0, -1))[2] >= -1e-12, "z points towards the camera"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_camera_that_looks_straight_down_or_up_is_the_limit_of_tilting_it(sign):
    straight = level_rotation(np.array([0.0, 0.0, -sign]))
    np.testing.assert_allclose(straight, level_rotation(up_of_tilt(sign * (np.pi / 2 - 0.1))), atol=0.11)


def test_a_cloud_is_the_back_projection_of_its_depth():
    depth = person_alone(TOF).astype(np.float32) / 1000
    rotation = level_rotation(up_of_tilt(0.3))
    cloud = Cloud.from_depth(depth, TOF, rotation)
    v, u = np.nonzero(depth)
    points = np.column_stack([TOF.rays()[v, u] * depth[v, u, None], depth[v, u]]) @ rotation.T
    np.testing.assert_allclose(cloud.points, points, atol=1e-5)
    np.testing.assert_array_equal(cloud.pixels, v * TOF.width + u)
    np.testing.assert_array_equal(cloud.index.ravel()[cloud.pixels], np.arange(len(cloud)))
    assert (cloud.index >= 0).sum() == len(cloud)
    np.testing.assert_allclose(TOF.project(cloud.points @ cloud.rotation), np.column_stack([u, v]), atol=1e-3)
    assert cloud.points.dtype == np.float32
    assert cloud.index.dtype == cloud.pixels.dtype == np.int32
