"""Open3D types in and out: clouds, RGB-D images, and the geometry of a tracked frame."""

from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import pytest

import depthmocap
from depthmocap import tracks
from tests.fake_tracker import FakeTracker
from tests.run_helpers import track_of
from tests.sensing_scenes import TOF, neutral, person_alone, standing
from toolkit.body.skeleton import BONE_ROWS
from toolkit.output.rendering.open3d_geometry import confidence_colors
from toolkit.recordings.open3d_frames import recording_of_open3d
from toolkit.recordings.opening import recording_of
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.cloud import Cloud
from toolkit.tracks import EMPTY, TRACKED
from toolkit.tracks.runs import Person

UP = (0.0, -1.0, 0.0)
LEVEL = level_rotation(np.array(UP))
PINHOLE = o3d.camera.PinholeCameraIntrinsic(TOF.width, TOF.height, *TOF.intrinsics)
DEPTHS = [person_alone(TOF, x) for x in (0.0, 0.1, 0.2)]


def cloud_of(depth_mm: np.ndarray, *, organised: bool, unit: float = 0.001) -> o3d.geometry.PointCloud:
    """Return Open3D's back-projection, all pixels (NaN if unmeasured) or the measured ones in varying order."""
    image = o3d.geometry.Image((depth_mm * np.float32(0.001)).astype(np.float32))
    cloud = o3d.geometry.PointCloud.create_from_depth_image(
        image, PINHOLE, depth_scale=1.0, project_valid_depth_only=not organised
    )
    return cloud.scale(0.001 / unit, (0.0, 0.0, 0.0))


@pytest.mark.parametrize("tensors", [False, True])
def test_clouds_of_all_pixels_give_depth_and_intrinsics_back(tensors: bool) -> None:
    clouds = [cloud_of(depth, organised=True) for depth in DEPTHS]
    given = [o3d.t.geometry.PointCloud.from_legacy(cloud) for cloud in clouds] if tensors else clouds
    recording = recording_of_open3d(given, frame_rate=20)
    np.testing.assert_allclose(recording.camera.intrinsics, TOF.intrinsics, rtol=1e-3)
    assert len(recording) == 3 and recording.timestamps[1] == 0.05 and not recording.has_color
    for i, depth in enumerate(DEPTHS):
        np.testing.assert_array_equal(recording.depth(i), depth)


def test_clouds_of_measured_points_alone_are_seen_by_the_camera_that_is_given() -> None:
    clouds = [cloud_of(depth, organised=False) for depth in DEPTHS]
    for cloud in clouds:
        cloud.estimate_normals()
    recording = recording_of_open3d(clouds, intrinsics=PINHOLE)
    for i, depth in enumerate(DEPTHS):
        np.testing.assert_array_equal(recording.depth(i), depth)


def test_the_order_of_points_changes_nothing() -> None:
    clouds = [cloud_of(depth, organised=False) for depth in DEPTHS]
    rng = np.random.default_rng(0)
    shuffled = [cloud.select_by_index(rng.permutation(len(cloud.points))) for cloud in clouds]
    one, other = recording_of_open3d(clouds), recording_of_open3d(shuffled)
    assert one.camera == other.camera
    np.testing.assert_array_equal(one.depth(2), other.depth(2))
    assert (one.depth(2) > 0).sum() > 0.9 * (183.3 / 220) ** 2 * (DEPTHS[2] > 0).sum()


@pytest.mark.parametrize("change", ["millimetres", "graphics", "holes"])
def test_units_axes_and_points_that_are_no_measurement(change: str) -> None:
    clouds, options = [cloud_of(depth, organised=False) for depth in DEPTHS], {}
    if change == "millimetres":
        clouds, options = [cloud.scale(1000.0, (0.0, 0.0, 0.0)) for cloud in clouds], {"depth_unit": "mm"}
    if change == "graphics":
        clouds, options = [cloud.rotate(np.diag([1.0, -1.0, -1.0]), (0, 0, 0)) for cloud in clouds], {"axes": change}
    if change == "holes":
        for cloud in clouds:
            cloud.points.extend(np.array([[np.nan, 0, 1], [0, np.inf, 2], [0, 0, -1.0]]))
    recording = recording_of_open3d(clouds, intrinsics=PINHOLE, **options)
    np.testing.assert_array_equal(recording.depth(1), DEPTHS[1])


def test_a_cloud_without_points_is_a_frame_without_a_measurement() -> None:
    clouds = [o3d.geometry.PointCloud(), *(cloud_of(depth, organised=True) for depth in DEPTHS)]
    for cloud in clouds[1:]:
        cloud.paint_uniform_color((1.0, 0.5, 0.0))
    recording = recording_of_open3d(clouds)
    assert not recording.depth(0).any() and not recording.color(0).any()
    np.testing.assert_array_equal(recording.depth(1), DEPTHS[0])
    np.testing.assert_array_equal(recording.color(2)[70, 80], (255, 128, 0))


@pytest.mark.parametrize("grey", [False, True])
def test_images_with_depth_and_colour(grey: bool) -> None:
    color = np.zeros((*TOF.shape, 3), np.uint8)
    color[..., 0] = 200
    images = [
        o3d.geometry.RGBDImage.create_from_color_and_depth(
            o3d.geometry.Image(color), o3d.geometry.Image(depth), depth_trunc=10.0, convert_rgb_to_intensity=grey
        )
        for depth in DEPTHS
    ]
    recording = recording_of_open3d(images, intrinsics=PINHOLE, timestamps=[1.0, 1.1, 1.3])
    np.testing.assert_array_equal(recording.depth(2), DEPTHS[2])
    assert recording.timestamps[2] == 1.3 and recording.has_color is not grey
    with pytest.raises(depthmocap.DepthMocapError, match="--intrinsics"):
        recording_of_open3d(images)


@pytest.mark.parametrize(
    ("frames", "says"),
    [
        ([o3d.geometry.PointCloud()] * 2, "none of the 2 clouds holds a point"),
        ([o3d.geometry.PointCloud(), o3d.geometry.RGBDImage()], "all of one"),
        (o3d.geometry.TriangleMesh(), "give PointCloud or RGBDImage"),
        ([cloud_of(DEPTHS[0], organised=False).scale(-1.0, (0.0, 0.0, 0.0))], "lie behind the camera"),
        ([cloud_of(DEPTHS[0], organised=False).scale(1000.0, (0.0, 0.0, 0.0))], "--unit|--depth-unit"),
    ],
)
def test_what_is_no_recording_is_one_sentence(frames: Any, says: str) -> None:
    with pytest.raises(depthmocap.DepthMocapError, match=says):
        depthmocap.track(frames)


def test_a_cloud_goes_to_open3d_and_back() -> None:
    depth = (DEPTHS[0] * np.float32(0.001)).astype(np.float32)
    tilted = level_rotation(np.array([0.0, -np.cos(0.3), -np.sin(0.3)]))
    cloud = Cloud.from_depth(depth, TOF, tilted)
    there = cloud.to_open3d()
    np.testing.assert_allclose(np.asarray(there.points) @ tilted.T, cloud.points, atol=1e-6)
    for kind in (there, o3d.t.geometry.PointCloud.from_legacy(there)):
        back = Cloud.from_open3d(kind, TOF, tilted)
        np.testing.assert_array_equal(back.index, cloud.index)
        np.testing.assert_allclose(back.points, cloud.points, atol=1e-6)
    there.points.extend(np.array([[np.nan, 0.0, 1.0], [0.0, 0.0, -1.0], [50.0, 0.0, 1.0]]))
    np.testing.assert_array_equal(Cloud.from_open3d(there, TOF, tilted).index, cloud.index)
    assert len(Cloud.from_open3d(o3d.geometry.PointCloud(), TOF, tilted)) == 0


def test_clouds_are_tracked_as_their_depth_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tracks, "tracker_of", lambda *_: FakeTracker())
    of_clouds = depthmocap.track([cloud_of(d, organised=False) for d in DEPTHS], intrinsics=PINHOLE, up_camera=UP)
    of_depth = depthmocap.track(np.stack(DEPTHS), intrinsics=TOF.intrinsics, up_camera=UP)
    np.testing.assert_array_equal(of_clouds.pose, of_depth.pose)
    np.testing.assert_array_equal(of_clouds.recording.depth(1), DEPTHS[1])


def test_a_frame_of_a_track_is_cloud_mesh_and_skeleton(tmp_path: Path) -> None:
    body = neutral()[0]
    poses = np.stack([standing(x, 2.8, 1.2) for x in (0.0, 0.1, 0.2)])
    joints = (body.joint_positions(poses) @ LEVEL).astype(np.float32)
    rows = track_of(joints, poses, np.arange(3) / 20, np.array([TRACKED, TRACKED, EMPTY]))
    recording = recording_of(np.stack(DEPTHS), intrinsics=TOF.intrinsics)
    track = depthmocap.Track(Person("take", rows, body, LEVEL), lambda: recording)
    cloud, mesh, skeleton = track.to_open3d(1)
    assert len(cloud.points) == (DEPTHS[1] > 0).sum() and mesh.is_watertight()
    np.testing.assert_allclose(np.asarray(skeleton.points), joints[1])
    np.testing.assert_array_equal(np.asarray(skeleton.lines), BONE_ROWS)
    np.testing.assert_allclose(np.asarray(skeleton.colors)[0], confidence_colors(np.array(1.0)))
    assert mesh.get_volume() > 0, "faces are counter-clockwise seen from outside: the body is not turned inside out"
    assert len(track.to_open3d(2).mesh.vertices) == len(track.to_open3d(2).skeleton.points) == 0
    with pytest.raises(depthmocap.DepthMocapError, match="not one of the 3 frames"):
        track.to_open3d(3)
    with pytest.raises(depthmocap.DepthMocapError, match="has no recording"):
        depthmocap.Track(track.person).to_open3d(0)
