"""Files that a newcomer tries first: read if possible, else one sentence with the command to type."""

from pathlib import Path

import cv2
import numpy as np
import open3d as o3d
import pytest
from scipy.io import savemat

from toolkit.io.errors import RecordingError
from toolkit.recordings.opening import open_recording

DEPTH = (1500 + np.arange(2 * 48 * 64).reshape(2, 48, 64) % 700).astype(np.uint16)
INTRINSICS = (60.0, 60.0, 31.5, 23.5)


@pytest.mark.parametrize(("depth", "unit"), [(DEPTH, 1), (DEPTH[0], 1), (DEPTH / 1000.0, 1)])
def test_an_array_in_a_numpy_file_is_a_recording(tmp_path: Path, depth: np.ndarray, unit: int) -> None:
    np.save(tmp_path / "depth.npy", depth)
    recording = open_recording(tmp_path / "depth.npy", intrinsics=INTRINSICS)
    assert len(recording) == (1 if depth.ndim == 2 else 2) and recording.camera.fx == 60.0
    np.testing.assert_array_equal(recording.depth(0), DEPTH[0])


@pytest.mark.parametrize(
    ("array", "says"),
    [
        (np.zeros((2, 4, 5, 3), np.uint16), r"has shape \(2, 4, 5, 3\)"),
        (np.array([{}]), "cannot be read as a NumPy array"),
        (np.zeros((2, 4, 5), bool), "save depth as numbers"),
        (DEPTH, "has no intrinsics; give --intrinsics fx,fy,cx,cy"),
    ],
)
def test_another_numpy_file_is_refused(tmp_path: Path, array: np.ndarray, says: str) -> None:
    np.save(tmp_path / "depth.npy", array)
    with pytest.raises(RecordingError, match=says):
        open_recording(tmp_path / "depth.npy")


@pytest.mark.parametrize(
    ("size", "camera", "focal"),
    [((512, 424), "Kinect v2", 365.5), ((640, 576), "Azure Kinect", 504.0), ((640, 480), "RealSense D435", 385.0)],
)
def test_images_without_intrinsics_are_offered_the_usual_ones(
    tmp_path: Path, size: tuple[int, int], camera: str, focal: float
) -> None:
    cv2.imwrite(str(tmp_path / "0.png"), np.full(size[::-1], 2000, np.uint16))
    with pytest.raises(RecordingError, match="usual for") as found:
        open_recording(tmp_path)
    pasted = str(found.value).split(f" ({camera}")[0].split("--intrinsics ")[-1]
    values = tuple(float(number) for number in pasted.split(","))
    recording = open_recording(tmp_path, intrinsics=values)
    assert recording.camera.fx == focal and abs(recording.camera.cx - (size[0] - 1) / 2) < 1


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    y, z = np.mgrid[0:20, 0:30].reshape(2, -1)
    vertices = np.column_stack([np.linspace(2.5, 3.2, 600), y, z])
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(vertices))
    o3d.io.write_point_cloud(str(tmp_path / "tof.ply"), cloud)
    with pytest.raises(RecordingError, match="whole numbers as y and z: pixel numbers"):
        open_recording(tmp_path / "tof.ply")
    (tmp_path / "take.oni").write_bytes(b"NI10")
    with pytest.raises(RecordingError, match="recording of OpenNI.*16-bit PNG"):
        open_recording(tmp_path / "take.oni")
    savemat(tmp_path / "other.mat", {"range": np.ones((3, 3))})
    with pytest.raises(RecordingError, match="no file of UTD-MHAD; it has range: save its depth as .npy"):
        open_recording(tmp_path / "other.mat")
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((20, 30), np.uint8))
    with pytest.raises(RecordingError, match="a picture and no depth"):
        open_recording(tmp_path / "0.png", intrinsics=(30, 30, 15, 10))
