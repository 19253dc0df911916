"""Messages of a first use, and files that a newcomer tries first."""

import time
from pathlib import Path

import cv2
import numpy as np
import open3d as o3d
import pytest
from scipy.io import savemat

from tests.fake_tracker import write_recording
from tests.run_helpers import run
from tests.sensing_scenes import KINECT, scene
from toolkit.app import pipeline
from toolkit.app.cli import terminal
from toolkit.app.pipeline import TrackerRecipe
from toolkit.io.errors import RecordingError
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.trackers.hybrid.tracker import HybridTracker


@pytest.fixture
def costly(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Record the costly calls in their order."""
    asked: list[str] = []

    def build(*arguments: object, **named: object) -> None:
        asked.append("tracker")
        raise SystemExit(7)

    monkeypatch.setattr(TrackerRecipe, "build", build)
    monkeypatch.setattr(pipeline, "track_recordings", build)
    return asked


@pytest.mark.parametrize("more", [[], ["--workers", "2"]])
@pytest.mark.parametrize(("content", "says"), [(None, "there is no recording"), (b"nothing", "bad.npz")])
def test_a_recording_is_opened_before_anything_costs_time(
    tmp_path: Path,
    costly: list[str],
    capsys: pytest.CaptureFixture[str],
    content: bytes | None,
    says: str,
    more: list[str],
) -> None:
    bad = tmp_path / "bad.npz"
    if content is not None:
        bad.write_bytes(content)
    assert run("track", bad, "--output", tmp_path / "run", *more) == 1
    assert not costly and says in capsys.readouterr().err
    assert run("track", bad, tmp_path / "worse.npz", "--output", tmp_path / "runs", *more) == 1
    assert not costly and "none of the 2 recordings can be read" in capsys.readouterr().err


def test_one_of_several_that_cannot_be_read_is_named_before_the_others_are_tracked(
    tmp_path: Path, costly: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    good = write_recording(tmp_path / "good.npz")
    assert run("track", good, tmp_path / "bad.npz", "--output", tmp_path / "runs") == 7
    assert "bad.npz" in capsys.readouterr().err and costly == ["tracker"]


def test_a_log_gets_a_line_a_minute_and_nothing_of_what_takes_less(capsys: pytest.CaptureFixture[str]) -> None:
    with terminal.progress_bars() as bars:
        bars("building", 1, 3)
    assert capsys.readouterr().err == ""
    lines = terminal.log_lines(every=0.05)
    lines("building", 1, 3)
    time.sleep(0.1)
    lines("building", 2, 3)
    assert capsys.readouterr().err.startswith("building: 2 of 3 after ")


def test_two_people_are_refused_before_anyone_is_tracked_with_the_commands_to_type(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    frame, _ = scene(KINECT, ((-0.5, 2.4), (0.5, 3.4)))
    recording = tmp_path / "two.npz"
    save_recording(recording, depth=[frame] * 3, camera=KINECT, timestamps=[0.0, 0.1, 0.2], up_camera=(0, -1, 0))

    def tracked(*arguments: object, **named: object) -> None:
        raise AssertionError("the people are counted first")

    for name in ("follower", "learner"):
        monkeypatch.setattr(HybridTracker, name, tracked)
    assert run("track", recording, "--output", tmp_path / "run", "--online") == 1
    said = capsys.readouterr().err
    typed = f"depthmocap track {recording} --output {tmp_path / 'run'} --online"
    assert "2 people are in view" in said
    assert f"{typed} --people all" in said and f"{typed} --subject largest" in said


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
