"""Recordings of cameras and robots: RealSense, Azure Kinect, ROS, phones, TUM; and damaged ones."""

import json
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.container_files import RosWriter, frames, mkv_frames, mkv_recording, realsense_recording, ros_recording
from tests.sensing_scenes import TOF, up_of_tilt
from toolkit.io.errors import RecordingError, UsageError
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording


def assert_frames(recording: Recording, wanted: list[np.ndarray]) -> None:
    """Check that the images are equal in order, at random positions, and backwards."""
    assert len(recording) == len(wanted)
    for read, depth in zip(recording.frames(), wanted, strict=True):
        np.testing.assert_array_equal(read, depth)
    for i in (len(wanted) - 1, 0, 1):
        np.testing.assert_array_equal(recording.depth(i), wanted[i])


# RealSense


def test_a_realsense_file_of_the_sdk_opens_with_its_camera_and_unit(tmp_path: Path) -> None:
    pytest.importorskip("pyrealsense2")
    recording = open_recording(realsense_recording(tmp_path / "take.db3"))
    assert recording.camera == TOF
    assert_frames(recording, frames(4))
    assert recording.timestamps[0] == 0 and (np.diff(recording.timestamps) > 0).all()


def test_a_ros_file_with_a_name_that_its_reader_cannot_open_is_one_sentence(tmp_path: Path) -> None:
    path = ros_recording(tmp_path / "take_sqlite")
    file = next(path.glob("*.db3")).rename(tmp_path / "take#1.db3")
    with pytest.raises(RecordingError, match="'#'.*rename it"):
        open_recording(file)


@pytest.mark.data("realsense-bag")
def test_an_old_realsense_bag_opens_with_its_camera_and_unit(data_folder: Path) -> None:
    recording = open_recording(data_folder / "containers" / "single_depth_color_640x480.bag")
    assert len(recording) == 2 and recording.camera.shape == (480, 640)
    np.testing.assert_allclose(recording.camera.intrinsics, (390.431, 390.431, 331.388, 242.187), atol=1e-3)
    depth = recording.depth(1)
    assert 1300 < np.median(depth[depth > 0]) < 1600 and depth.dtype == np.uint16


# ROS


@pytest.mark.parametrize("name", ["take.bag", "take_sqlite", "take_mcap"])
def test_ros_recordings_open_with_camera_times_and_vertical(tmp_path: Path, name: str) -> None:
    path = ros_recording(tmp_path / name)
    recording = open_recording(path)
    assert recording.camera == TOF and recording.name == path.stem
    np.testing.assert_allclose(recording.timestamps, [0, 0.1, 0.2], atol=1e-6)
    np.testing.assert_allclose(recording.up_camera, up_of_tilt(0.2), atol=1e-6)
    assert_frames(recording, frames())


def test_float_depth_is_metres_and_colour_aligned_to_it_is_kept(tmp_path: Path) -> None:
    depth_topic = "/camera/aligned_depth_to_color/image_raw"
    with RosWriter(tmp_path / "take.bag") as writer:
        writer.camera("/camera/aligned_depth_to_color/camera_info", 1.0, (0.1, 0.0, 0.0, 0.0, 0.0))
        for i, depth in enumerate(frames()):
            writer.image(depth_topic, 1.0 + i, (depth / 1000).astype(np.float32), "32FC1")
            writer.image(
                "/camera/color/image_raw", 1.02 + i, np.full((*TOF.shape, 3), (1, 2, 10 + i), np.uint8), "bgr8"
            )
    recording = open_recording(tmp_path / "take.bag")
    assert_frames(recording, frames())
    assert recording.camera.distortion == (0.1, 0.0, 0.0, 0.0, 0.0)
    color = recording.color(2)
    assert color is not None and tuple(color[0, 0]) == (12, 2, 1)


def test_compressed_depth_is_read(tmp_path: Path) -> None:
    import cv2

    with RosWriter(tmp_path / "take_sqlite") as writer:
        writer.camera("/depth/camera_info", 0.0)
        for i, depth in enumerate(frames()):
            png = cv2.imencode(".png", depth)[1].tobytes()
            image = writer.message(
                "sensor_msgs/msg/CompressedImage", header=writer.header(), format="16UC1; compressedDepth png",
                data=np.frombuffer(bytes(12) + png, np.uint8),
            )  # fmt: skip
            writer.write("/depth/image_raw/compressedDepth", 0.1 * i, image)
    assert_frames(open_recording(tmp_path / "take_sqlite"), frames())


def test_the_unit_behind_an_image_of_an_old_realsense_file_is_read(tmp_path: Path) -> None:
    with RosWriter(tmp_path / "take.bag") as writer:
        serialize = writer.store.serialize_ros1
        writer.store.serialize_ros1 = lambda *image: bytes(serialize(*image)) + np.float32(0.0005).tobytes()
        for i, depth in enumerate(frames()):
            writer.image("/depth/image", 0.1 * i, depth * 2, "16UC1")
    assert_frames(open_recording(tmp_path / "take.bag", intrinsics=TOF.intrinsics), frames())


def test_of_several_depth_topics_one_has_to_be_named(tmp_path: Path) -> None:
    with RosWriter(tmp_path / "take.bag") as writer:
        for topic in ("/left/depth/image", "/right/depth/image"):
            writer.camera(topic.replace("image", "camera_info"), 0.0)
            for i, depth in enumerate(frames(2)):
                writer.image(
                    topic, 0.1 * i, np.where(depth > 0, depth + 7 * ("right" in topic), 0).astype(np.uint16), "16UC1"
                )
    with pytest.raises(RecordingError, match="2 depth topics; give --track TOPIC: /left/depth/image, /right"):
        open_recording(tmp_path / "take.bag")
    right = open_recording(tmp_path / "take.bag", track="/right/depth/image").depth(0)
    assert right.max() == frames()[0].max() + 7
    with pytest.raises(RecordingError, match="no image topic '/up'"):
        open_recording(tmp_path / "take.bag", track="/up")


def test_a_file_without_usable_depth_lists_its_content(tmp_path: Path) -> None:
    with RosWriter(tmp_path / "color.bag") as writer:
        writer.image("/camera/color/image_raw", 0.0, np.zeros((4, 4, 3), np.uint8), "rgb8")
    with pytest.raises(RecordingError, match="no depth topic; its image topics are: /camera/color/image_raw"):
        open_recording(tmp_path / "color.bag")
    with RosWriter(tmp_path / "eight.bag") as writer:
        writer.image("/depth/image", 0.0, np.zeros((4, 4), np.uint8), "8UC1")
    with pytest.raises(RecordingError, match="its images are 8UC1"):
        open_recording(tmp_path / "eight.bag")
    with RosWriter(tmp_path / "bare.bag") as writer:
        writer.image("/depth/image", 0.0, frames()[0], "16UC1")
    with pytest.raises(RecordingError, match="give --intrinsics"):
        open_recording(tmp_path / "bare.bag")
    assert open_recording(tmp_path / "bare.bag", intrinsics=TOF.intrinsics).camera == TOF


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "lzfse", None)
    with pytest.raises(UsageError, match=r"pip install .depthmocap.record3d"):
        open_recording(phone_recording(tmp_path / "a.r3d", b""))


# Azure Kinect and Femto


@pytest.mark.parametrize("start_us", [0, 1_700_000_000_000_000])
def test_a_kinect_recording_opens_with_camera_times_and_vertical(tmp_path: Path, start_us: int) -> None:
    recording = open_recording(mkv_recording(tmp_path / "take.mkv", start_us=start_us))
    # 512 binned pixels across, of which the window begins at 96, 90.
    wanted = Camera(256.0, 256.0, 256 - 96 - 0.5, 256 - 90 - 0.5, 320, 288, (0.0,) * 8)
    assert recording.camera == wanted
    np.testing.assert_allclose(recording.timestamps, [0, 0.033333, 0.066666], atol=1e-9)
    np.testing.assert_allclose(recording.up_camera, up_of_tilt(0.2), atol=1e-6)
    assert_frames(recording, [np.where(depth < 65000, depth, 0) for depth in mkv_frames()])


@pytest.mark.data("azure-kinect")
def test_a_real_kinect_recording_opens_with_colour_registered_to_depth(data_folder: Path) -> None:
    recording = open_recording(data_folder / "containers" / "recording.mkv")
    assert recording.camera.shape == (576, 640) and len(recording) == 1
    np.testing.assert_allclose(recording.camera.intrinsics, (504.6076, 504.7325, 332.7811, 348.8297), atol=1e-3)
    assert np.degrees(np.arccos(-recording.up_camera[1])) < 15
    depth, color = recording.depth(0), recording.color(0)
    assert color is not None and color.shape == (576, 640, 3)
    # edges of the depth image, such as those of a cup on a table, are edges of the colour there
    jumps = np.abs(np.diff(depth.astype(np.float64), axis=1)) > 300
    known = (depth[:, 1:] > 0) & (depth[:, :-1] > 0) & color[:, 1:].any(axis=2) & color[:, :-1].any(axis=2)
    steps = np.abs(np.diff(color.astype(np.float64).mean(axis=2), axis=1))
    assert steps[jumps & known].mean() > 3 * steps[~jumps & known].mean()


# Phones


def phone_recording(path: Path, compressed: bytes | None = None, **changes: object) -> Path:
    """Write a Record3D file: colour of twice the depth's size."""
    metadata = {"w": 352, "h": 288, "dw": 176, "dh": 144, "K": [440, 0, 0, 0, 440, 0, 175.5, 143.5, 1], "fps": 30}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("metadata", json.dumps({**metadata, "frameTimestamps": [7.0, 7.1, 7.3], **changes}))
        for i, depth in enumerate(frames()):
            if compressed is None:
                import lzfse

                archive.writestr(f"rgbd/{i}.depth", lzfse.compress((depth / 1000).astype("<f4").tobytes()))
            else:
                archive.writestr(f"rgbd/{i}.depth", compressed)
    return path


def test_a_record3d_file_opens_with_the_camera_of_its_depth(tmp_path: Path) -> None:
    pytest.importorskip("lzfse")
    recording = open_recording(phone_recording(tmp_path / "take.r3d"))
    np.testing.assert_allclose(recording.camera.intrinsics, TOF.intrinsics, atol=1e-9)
    np.testing.assert_allclose(recording.timestamps, [0, 0.1, 0.3], atol=1e-9)
    assert_frames(recording, frames())


def images(folder: Path, names: list[str]) -> None:
    import cv2

    folder.mkdir(parents=True)
    for name, depth in zip(names, frames(len(names)), strict=True):
        cv2.imwrite(str(folder / name), depth)


def test_a_stray_scanner_folder_opens_with_camera_times_and_vertical(tmp_path: Path) -> None:
    from scipy.spatial.transform import Rotation

    images(tmp_path / "take" / "depth", [f"{i:06d}.png" for i in range(3)])
    scale = 1920 / 176
    (tmp_path / "take" / "camera_matrix.csv").write_text(
        f"{220 * scale},0,{88 * scale - 0.5}\n0,{220 * scale},{72 * scale - 0.5}\n0,0,1\n"
    )
    up = up_of_tilt(0.2)
    turn, _ = Rotation.align_vectors([[0.0, 1.0, 0.0]], [up])
    quaternion = ",".join(f"{q:.9f}" for q in turn.as_quat())
    rows = [f"{3.0 + 0.1 * i}, {i:06d}, 0, 0, 0, {quaternion}" for i in range(3)]
    (tmp_path / "take" / "odometry.csv").write_text("\n".join(["timestamp, frame, x, y, z, qx, qy, qz, qw", *rows]))
    recording = open_recording(tmp_path / "take")
    np.testing.assert_allclose(recording.camera.intrinsics, TOF.intrinsics, atol=1e-9)
    np.testing.assert_allclose(recording.timestamps, [0, 0.1, 0.2], atol=1e-9)
    np.testing.assert_allclose(recording.up_camera, up, atol=1e-6)
    assert_frames(recording, frames())
    for name, text in (("camera_matrix.csv", "wide"), ("odometry.csv", "timestamp,qx\n1,2\n")):
        (tmp_path / "take" / name).write_text(text)
        with pytest.raises(RecordingError, match=name):
            open_recording(tmp_path / "take")


# TUM


def test_a_tum_folder_opens_with_its_unit_and_times(tmp_path: Path) -> None:
    import cv2

    folder = tmp_path / "take"
    images(folder / "depth", ["1.5.png", "1.6.png"])
    for name, depth in zip(("1.5.png", "1.6.png"), frames(2), strict=True):
        cv2.imwrite(str(folder / "depth" / name), depth * 5)
    (folder / "rgb").mkdir()
    for k in range(3):
        cv2.imwrite(str(folder / "rgb" / f"{k}.png"), np.full((*TOF.shape, 3), (0, 0, k), np.uint8))
    (folder / "depth.txt").write_text("# depth maps\n1.5 depth/1.5.png\n1.6 depth/1.6.png\n")
    (folder / "rgb.txt").write_text("1.1 rgb/0.png\n1.51 rgb/1.png\n1.59 rgb/2.png\n")
    recording = open_recording(folder, intrinsics=TOF.intrinsics)
    np.testing.assert_allclose(recording.timestamps, [0, 0.1], atol=1e-9)
    assert_frames(recording, frames(2))
    assert [int(recording.color(i)[0, 0, 0]) for i in (0, 1)] == [1, 2]
    with pytest.raises(RecordingError, match="give --intrinsics"):
        open_recording(folder)
    for text in ("1.5\n", "soon depth/1.5.png\n", "1.5 ../../secret.png\n", "# nothing\n"):
        (folder / "depth.txt").write_text(text)
        with pytest.raises(RecordingError, match=r"depth\.txt"):
            open_recording(folder, intrinsics=TOF.intrinsics)


# Damage
