"""Readers of other formats: UTD-MHAD, PNG folders, raw frames, point clouds."""

import json

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, TOF, person_alone, scene
from toolkit.io.errors import RecordingError
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.recordings.opening import open_recording
from toolkit.sensing.cloud import Cloud


def mat_pair(folder, name="a1_s1_t1", frames=3):
    """Write a small UTD-MHAD recording as its camera does: mirrored, with the left joints at negative x."""
    from scipy.io import savemat

    depth = np.stack([person_alone(KINECT, 0.3)[:, ::-1]] * frames, axis=-1)
    skeleton = np.random.default_rng(0).normal(size=(20, 3, frames)) * 0.1 + [[0], [0], [3]]
    skeleton[7, 0], skeleton[11, 0] = -0.6, 0.4
    savemat(folder / f"{name}_depth.mat", {"d_depth": depth})
    savemat(folder / f"{name}_skeleton.mat", {"d_skel": skeleton})
    return folder / f"{name}_depth.mat", skeleton


def png_folder(folder, images, intrinsics=True):
    """Write a folder `depth/` of PNG with a camera file beside it."""
    import cv2

    (folder / "depth").mkdir(parents=True)
    for i, image in enumerate(images):
        cv2.imwrite(str(folder / "depth" / f"{i}.png"), image)
    if intrinsics:
        (folder / "camera.json").write_text(
            json.dumps(dict(zip(("fx", "fy", "cx", "cy"), TOF.intrinsics, strict=True)))
        )
    return folder


def write_cloud(path, points):
    import open3d as o3d

    cloud = o3d.t.geometry.PointCloud(o3d.core.Tensor(np.ascontiguousarray(points, dtype=np.float32)))
    o3d.t.io.write_point_cloud(str(path), cloud)
    return path


def organised_pcd(path, depth, camera):
    """Write an organised ASCII PCD with NaN for unmeasured points."""
    z = np.where(depth > 0, depth / 1000, np.nan)
    points = np.dstack([camera.rays() * z[..., None], z]).reshape(-1, 3)
    header = (
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {camera.width}\nHEIGHT {camera.height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA ascii\n"
    )
    with path.open("w") as stream:
        stream.write(header)
        np.savetxt(stream, points, fmt="%.6f")
    return path


def test_a_mirrored_source_is_flipped(tmp_path):
    path, skeleton = mat_pair(tmp_path)
    recording = open_recording(path)
    np.testing.assert_array_equal(recording.depth(1), person_alone(KINECT, 0.3))
    np.testing.assert_allclose(recording.camera.intrinsics, (285.63, 285.63, 159, 120))
    joints = recording.reference_joints
    assert (joints[:, 7, 0] > 0).all(), "the left hand of a person who faces the camera is at positive x"
    np.testing.assert_allclose(joints[:, 3], np.transpose(skeleton[0] * [[-1], [-1], [1]]), rtol=1e-6)
    np.testing.assert_allclose(joints[:, 0], (joints[:, 12] + joints[:, 16]) / 2, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(joints[:, 2], (joints[:, 4] + joints[:, 8]) / 2, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(joints[:, 1], 0.6 * joints[:, 0] + 0.4 * joints[:, 2], rtol=1e-5, atol=1e-6)


def test_a_skeleton_is_optional_and_may_lie_elsewhere(tmp_path):
    path, _ = mat_pair(tmp_path)
    elsewhere = tmp_path / "skeletons"
    elsewhere.mkdir()
    (tmp_path / "a1_s1_t1_skeleton.mat").rename(elsewhere / "a1_s1_t1_skeleton.mat")
    assert open_recording(path).reference_joints is None
    assert open_recording(path, skeleton=elsewhere).reference_joints.shape == (3, 20, 3)
    assert open_recording(path, skeleton=elsewhere / "a1_s1_t1_skeleton.mat").options["skeleton"].endswith(".mat")
    with pytest.raises(RecordingError, match="no skeleton at"):
        open_recording(path, skeleton=tmp_path / "nowhere.mat")


@pytest.mark.data("utd-mhad")
def test_real_subjects_face_the_camera_with_the_left_hand_at_positive_x(data_folder):
    for action in (1, 27):
        recording = open_recording(data_folder / "depth" / "utd_mhad" / f"a{action}_s1_t1_depth.mat")
        joints = recording.reference_joints
        assert np.median(joints[:, [15, 19], 2] - joints[:, [14, 18], 2]) < 0, "toes are nearer than ankles"
        assert np.median(joints[:, 12, 0] - joints[:, 16, 0]) > 0, "the left hip is at greater x"
        pixels = np.rint(recording.camera.project(joints[0, [3, 12, 16]])).astype(int)
        depth = recording.depth(0)
        for (u, v), joint in zip(pixels, joints[0, [3, 12, 16]], strict=True):
            assert abs(depth[v, u] / 1000 - joint[2]) < 0.15, "the skeleton lies on the flipped image"
        np.testing.assert_allclose(recording.up_camera, (0, -1, 0))


def test_png_frames_are_sorted_by_their_numbers(tmp_path):
    images = [np.full(TOF.shape, 1000 + i, dtype=np.uint16) for i in range(11)]
    recording = open_recording(png_folder(tmp_path / "take", images), frame_rate=25)
    assert [int(f[0, 0]) for f in recording.frames()] == list(range(1000, 1011))
    assert recording.timestamps[10] == pytest.approx(0.4)
    assert recording.camera == TOF
    assert recording.color(0) is None


def test_colour_beside_depth_is_read_as_rgb(tmp_path):
    import cv2

    folder = png_folder(tmp_path / "take", [person_alone(TOF)] * 2)
    (folder / "color").mkdir()
    for i in range(2):
        cv2.imwrite(str(folder / "color" / f"{i}.png"), np.full((*TOF.shape, 3), (10, 20, 30), dtype=np.uint8))
    np.testing.assert_array_equal(open_recording(folder).color(1)[0, 0], (30, 20, 10))


def test_colour_may_lie_among_the_depth_images_where_names_say_which_is_which(tmp_path):
    import cv2

    for i in (0, 2, 10):
        cv2.imwrite(str(tmp_path / f"depth{i}.png"), np.full(TOF.shape, 1000 + i, dtype=np.uint16))
        cv2.imwrite(str(tmp_path / f"color{i}.png"), np.full((*TOF.shape, 3), (10, 20, i), dtype=np.uint8))
    recording = open_recording(tmp_path, intrinsics=TOF.intrinsics)
    assert [int(f[0, 0]) for f in recording.frames()] == [1000, 1002, 1010]
    assert [int(recording.color(k)[0, 0, 0]) for k in range(3)] == [0, 2, 10]


@pytest.mark.parametrize(
    "table",
    [
        {"width": 176, "height": 144, "intrinsic_matrix": [220, 0, 0, 0, 220, 0, 87.5, 71.5, 1]},
        {"K": [[220, 0, 87.5], [0, 220, 71.5], [0, 0, 1]]},
        {"depth": {"fx": 220, "fy": 220, "ppx": 87.5, "ppy": 71.5, "coeffs": [0, 0, 0, 0, 0]}},
    ],
)
def test_intrinsics_are_read_from_the_usual_json_forms(tmp_path, table):
    folder = png_folder(tmp_path / "take", [person_alone(TOF)], intrinsics=False)
    (tmp_path / "camera.json").write_text(json.dumps(table))
    np.testing.assert_allclose(
        open_recording(folder, intrinsics=tmp_path / "camera.json").camera.intrinsics, TOF.intrinsics
    )


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("{", "is no JSON"),
        ("{}", "holds no intrinsics"),
        ('{"fx": "wide", "fy": 1, "cx": 0.5, "cy": 0.5}', "no numbers"),
        ('{"K": {"fx": 1}}', "no numbers"),
        ('{"fx": null, "fy": 1, "cx": 0.5, "cy": 0.5}', "no numbers"),
        ('{"fx": 1e999, "fy": 220, "cx": 87.5, "cy": 71.5}', "more than a float holds"),
        ('{"fx": 220, "fy": 220, "cx": 87.5, "cy": 71.5, "dist": [9, 9, 0, 0, 9]}', "corners"),
        ('{"fx": 1, "fy": 1, "cx": 0.5, "cy": 0.5}', "implausible"),
        ('{"width": 640, "height": 480, "fx": 600, "fy": 600, "cx": 320, "cy": 240}', "640x480"),
    ],
)
def test_a_useless_camera_file_is_named(tmp_path, text, part):
    folder = png_folder(tmp_path / "take", [person_alone(TOF)], intrinsics=False)
    (folder / "camera.json").write_text(text)
    with pytest.raises(RecordingError, match=part):
        open_recording(folder)


def test_raw_frames_need_intrinsics_and_a_size_that_fits(tmp_path):
    (tmp_path / "raw").mkdir()
    for i in (2, 10):
        np.full(TOF.shape, 1000 + i).astype("<u2").tofile(tmp_path / "raw" / f"depth-{i}")
    recording = open_recording(tmp_path / "raw", intrinsics=TOF.intrinsics)
    assert [int(f.min()) for f in recording.frames()] == [1002, 1010]
    with pytest.raises(RecordingError, match="give --intrinsics"):
        open_recording(tmp_path / "raw")
    with pytest.raises(RecordingError, match="--size WIDTH,HEIGHT"):
        open_recording(tmp_path / "raw", intrinsics=TOF.intrinsics, size=(100, 100)).depth(0)
    (tmp_path / "odd").write_bytes(bytes(1000))
    with pytest.raises(RecordingError, match="no supported format"):
        open_recording(tmp_path / "odd")
    with pytest.raises(RecordingError, match="no known size"):
        open_recording(tmp_path / "odd", format="raw", intrinsics=TOF.intrinsics)


def test_an_organised_cloud_gives_its_pixel_grid_and_intrinsics_back(tmp_path):
    depth = person_alone(TOF)
    recording = open_recording(organised_pcd(tmp_path / "a.pcd", depth, TOF))
    np.testing.assert_allclose(recording.camera.intrinsics, TOF.intrinsics, rtol=1e-4)
    np.testing.assert_array_equal(recording.depth(0), depth)


def test_an_organised_cloud_that_is_no_camera_image_is_read_as_unorganised(tmp_path):
    points = np.random.default_rng(0).uniform(0.5, 1.5, (400, 3))
    path = tmp_path / "a.pcd"
    write_cloud(path, points)
    text = path.read_bytes().replace(b"WIDTH 400", b"WIDTH 20").replace(b"HEIGHT 1", b"HEIGHT 20")
    path.write_bytes(text)
    assert (open_recording(path).depth(0) > 0).sum() > 40


@pytest.mark.parametrize("shuffled", [True, False])
def test_an_unorganised_cloud_is_seen_by_a_virtual_camera(tmp_path, shuffled):
    rng = np.random.default_rng(0)
    (tmp_path / "take").mkdir()
    for i in range(2):
        points = Cloud.from_depth(person_alone(KINECT, 0.1 * i) / np.float32(1000), KINECT, np.eye(3)).points
        write_cloud(tmp_path / "take" / f"{i}.ply", rng.permutation(points) if shuffled else points)
    recording = open_recording(tmp_path / "take")
    assert len(recording) == 2
    cleaned = SinglePersonSegmenter.of(recording).clean(recording.depth(1))
    camera = recording.camera
    area = (cleaned**2).sum() / (camera.fx * camera.fy)
    true = (person_alone(KINECT, 0.1) / 1000) ** 2
    assert area == pytest.approx(true.sum() / (KINECT.fx * KINECT.fy), rel=0.08), "no holes and nothing lost"
    points = Cloud.from_depth(cleaned, camera, np.eye(3)).points
    assert abs(np.median(points[:, 0]) - 0.1) < 0.02


def test_an_unorganised_cloud_can_be_seen_by_a_given_camera(tmp_path):
    depth = person_alone(TOF)
    points = Cloud.from_depth(depth / np.float32(1000), TOF, np.eye(3)).points
    path = write_cloud(tmp_path / "a.ply", points)
    recording = open_recording(path, intrinsics=TOF.intrinsics, size=(176, 144))
    np.testing.assert_array_equal(recording.depth(0), depth)
    with pytest.raises(RecordingError, match="--size WIDTH,HEIGHT"):
        open_recording(path, intrinsics=TOF.intrinsics)


def test_a_cloud_behind_the_camera_names_the_axes(tmp_path):
    points = Cloud.from_depth(person_alone(TOF) / np.float32(1000), TOF, np.diag([1.0, -1.0, -1.0])).points
    path = write_cloud(tmp_path / "a.ply", points)
    with pytest.raises(RecordingError, match="give --axes graphics"):
        open_recording(path)
    assert open_recording(path, axes="graphics").depth(0).any()


@pytest.mark.parametrize("name", ["a.pcd", "a.ply"])
def test_a_cloud_that_states_more_points_than_any_camera_has_is_refused(tmp_path, name):
    path = tmp_path / name
    header = {
        "a.pcd": "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 479965968\nHEIGHT 1\n"
        "POINTS 479965968\nDATA ascii\n0 0 1\n",
        "a.ply": "ply\nformat ascii 1.0\nelement vertex 479965968\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 1\n",
    }
    path.write_text(header[name])
    with pytest.raises(RecordingError, match="states 479965968 points"):
        open_recording(path)


@pytest.mark.data("realsense", "five-people", "skeltrack")
def test_the_real_room_scans_open_with_their_cameras(data_folder):
    real = open_recording(data_folder / "depth" / "realsense" / "images_n40")
    assert len(real) == 40
    np.testing.assert_allclose(real.camera.intrinsics, (617.25, 617.5486, 317.3921, 245.9802), rtol=1e-5)
    assert real.color(3).shape == (480, 640, 3)
    people = open_recording(data_folder / "depth" / "pcl" / "five_people.pcd")
    np.testing.assert_allclose(people.camera.intrinsics, (525, 525, 319.5, 239.5), atol=1e-3)
    assert np.degrees(np.arccos(-people.up_camera[1])) < 6, "the floor tells the vertical"
    assert len(open_recording(data_folder / "depth" / "skeltrack", intrinsics=(575, 575, 320, 240))) == 8


def test_the_vertical_comes_from_a_visible_floor(tmp_path):
    from tests.sensing_scenes import up_of_tilt

    for tilt in (0.0, 0.3, 0.6):
        room, _ = scene(TOF, tilt=tilt, height=1.6, wall=4.5, floor=True)
        recording = open_recording(png_folder(tmp_path / f"{tilt}", [room]))
        assert np.degrees(np.arccos(np.clip(recording.up_camera @ up_of_tilt(tilt), -1, 1))) < 1.0
    alone = open_recording(png_folder(tmp_path / "alone", [person_alone(TOF)]))
    np.testing.assert_allclose(alone.up_camera, (0, -1, 0))


def write_camera(path, fx):
    path.write_text(json.dumps({"fx": fx, "fy": fx, "cx": 87.5, "cy": 71.5}))


def test_a_folder_s_own_intrinsics_win_over_those_around_it(tmp_path):
    folder = png_folder(tmp_path / "take", [person_alone(TOF)], intrinsics=False)
    write_camera(tmp_path / "a.json", 300.0)
    assert open_recording(folder).camera.fx == 300.0, "better than none"
    write_camera(folder / "z.json", 220.0)
    assert open_recording(folder).camera.fx == 220.0
    (tmp_path / "a.json").write_text("{")
    assert open_recording(folder).camera.fx == 220.0, "a bad file elsewhere is none of its business"


@pytest.mark.parametrize("name", ["x" * 300, "pipe"])
def test_what_is_neither_file_nor_folder_is_no_recording(tmp_path, name):
    import os

    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RecordingError, match="a file or a folder"):
        open_recording(tmp_path / name)


def test_the_frames_of_utd_mhad_lie_as_far_apart_as_its_wearable_sensors_say(tmp_path):
    path, _ = mat_pair(tmp_path)
    np.testing.assert_allclose(np.diff(open_recording(path).timestamps), 1 / 18.8)
    np.testing.assert_allclose(np.diff(open_recording(path, frame_rate=30).timestamps), 1 / 30)
