"""`import depthmocap`: arrays in, tracks out, equal to run folders, also frame by frame."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import depthmocap
from depthmocap import step, tracks
from tests.fake_tracker import CAMERA, FakeFollower, FakeTracker
from tests.run_helpers import track_of
from tests.sensing_scenes import neutral, standing
from toolkit.app.pipeline import track_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import level_rotation
from toolkit.tracks import EMPTY, TRACKED, FrameResult
from toolkit.tracks.runs import Person

INTRINSICS = (CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
UP = (0.0, -1.0, 0.0)
FRAMES = 12


@pytest.fixture
def frames() -> np.ndarray:
    """Return frames of an object that appears and disappears: uint16 (12, H, W), millimetres."""
    depth = np.zeros((FRAMES, *CAMERA.shape), dtype=np.uint16)
    for i in range(FRAMES):
        depth[i, 20:40, 30:50] = 2000 + 7 * i * i % 1000
    return depth


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """Replace trackers by fakes whose results depend on all earlier frames; return their arguments."""
    arguments: dict[str, float] = {"learning_seconds": 0.1}
    for module in (tracks, step):
        monkeypatch.setattr(module, "tracker_of", lambda *_: FakeTracker(**arguments))  # type: ignore[arg-type]
    return arguments


@pytest.fixture
def sways() -> depthmocap.Track:
    """Return a person who sways and is absent in the last two of twelve frames."""
    body = neutral()[0]
    poses = np.stack([standing(0.01 * i, 2.8, 1.2) for i in range(FRAMES)])
    level = level_rotation(np.array(UP))
    state = np.array([TRACKED] * 10 + [EMPTY] * 2)
    rows = track_of(body.joint_positions(poses) @ level, poses, np.arange(FRAMES) / 20, state, 0.5)
    return depthmocap.Track(Person("take", rows, body, level))


def test_importing_the_library_loads_nothing_that_takes_long() -> None:
    code = "import sys, depthmocap; print([m for m in ('numpy', 'numba', 'scipy', 'toolkit') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert set(depthmocap.__all__) <= set(dir(depthmocap))
    with pytest.raises(AttributeError, match="it has: build_database"):
        depthmocap.no_such_name  # noqa: B018
    assert all(getattr(depthmocap, name) is not None for name in depthmocap.__all__)


@pytest.mark.parametrize("unit", ["millimetres", "metres"])
def test_a_track_of_arrays_is_bit_for_bit_that_of_a_run_folder(
    frames: np.ndarray, fake: dict[str, float], tmp_path: Path, unit: str
) -> None:
    save_recording(tmp_path / "take.npz", depth=frames, camera=CAMERA, timestamps=np.arange(FRAMES) / 20, up_camera=UP)
    recording = depthmocap.open_recording(tmp_path / "take.npz")
    track_recording(recording, FakeTracker(**fake), tmp_path / "run")  # type: ignore[arg-type]
    (stored,) = depthmocap.Track.load(tmp_path / "run")
    depth = frames if unit == "millimetres" else frames / 1000.0
    of_array = depthmocap.track(depth, intrinsics=INTRINSICS, frame_rate=20, up_camera=UP)
    for found in (of_array, depthmocap.track(tmp_path / "take.npz"), depthmocap.track(recording)):
        for name in ("joints", "confidence", "state", "observed", "pose", "timestamps"):
            np.testing.assert_array_equal(getattr(found, name), getattr(stored, name), err_msg=name)
        np.testing.assert_array_equal(found.person.track.contact, stored.person.track.contact)
        assert len(found) == FRAMES and str(FRAMES) in repr(found)


@pytest.mark.parametrize("seconds", [0.0, 0.1, 9.0])
def test_each_frame_has_its_pose_and_the_track_is_that_of_the_whole_recording(
    frames: np.ndarray, fake: dict[str, float], seconds: float
) -> None:
    fake["learning_seconds"] = seconds
    whole = depthmocap.track(frames, intrinsics=INTRINSICS, frame_rate=20, up_camera=UP)
    tracker = depthmocap.Tracker(intrinsics=INTRINSICS, up_camera=UP)
    with pytest.raises(depthmocap.DepthMocapError, match="no pose is known yet"):
        tracker.track  # noqa: B018
    poses = [tracker.step(depth / 1000.0, i / 20) for i, depth in enumerate(frames)]
    assert [[pose.frame for pose in found] for found in poses] == [[i] for i in range(FRAMES)]
    # Learning ends with frame 2, at 0.1 s, which frame 3 processes; frame 5 tracks all again.
    final = {0.0: 0, 0.1: 5, 9.0: FRAMES}[seconds]
    assert [found[0].provisional for found in poses] == [i < final for i in range(FRAMES)]
    for found, pose in zip(poses[final:], whole.pose[final:], strict=True):
        np.testing.assert_array_equal(found[0].pose, pose)
    tracker.finish()
    assert tracker.track.state.tolist() == whole.state.tolist()
    np.testing.assert_array_equal(tracker.track.pose, whole.pose)
    np.testing.assert_array_equal(tracker.track.joints, whole.joints)


def test_a_frame_that_cannot_be_used_changes_nothing(frames: np.ndarray, fake: dict[str, float]) -> None:
    poses = []
    for faulty in (False, True):
        tracker = depthmocap.Tracker(intrinsics=INTRINSICS, up_camera=UP)
        for i, depth in enumerate(frames):
            if faulty and i == 4:
                for wrong, time, reason in (
                    (frames[0], 0.0, "come in order"),
                    (frames[0, 1:], 9.0, "all frames must have one size"),
                    (frames[0] / 1000.0, 9.0, "float64, which means metres, and the first frame was in millimetres"),
                ):
                    with pytest.raises(depthmocap.DepthMocapError, match=reason):
                        tracker.step(wrong, time)
            (pose,) = tracker.step(depth, i / 20)
            poses.append((faulty, pose.pose))
    np.testing.assert_array_equal(*([pose for which, pose in poses if which == faulty] for faulty in (False, True)))


def test_poses_are_copies_that_cannot_be_written(frames: np.ndarray, fake: dict[str, float]) -> None:
    fake["learning_seconds"] = 0.0
    tracker = depthmocap.Tracker(intrinsics=INTRINSICS, up_camera=UP)
    (pose,) = tracker.step(frames[0], 0.0)
    for array in (pose.joints, pose.pose, pose.confidence, pose.observed):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 1
        assert array.base is None


def test_ctrl_c_inside_a_step_takes_effect_after_it(
    frames: np.ndarray, fake: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    fake["learning_seconds"] = 0.0
    whole = depthmocap.track(frames, intrinsics=INTRINSICS, frame_rate=20, up_camera=UP)
    tracker, usual = depthmocap.Tracker(intrinsics=INTRINSICS, up_camera=UP), FakeFollower.step

    def interrupted(self: FakeFollower, *arguments: object) -> FrameResult:
        signal.raise_signal(signal.SIGINT)
        return usual(self, *arguments)  # type: ignore[arg-type]

    for i, depth in enumerate(frames):
        if i == 5:
            with monkeypatch.context() as patch:
                patch.setattr(FakeFollower, "step", interrupted)
                with pytest.raises(KeyboardInterrupt):
                    tracker.step(depth, i / 20)
        else:
            tracker.step(depth, i / 20)
    np.testing.assert_array_equal(tracker.track.pose, whole.pose)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_number_of_people_is_checked() -> None:
    for wrong in (0, True, "both"):
        with pytest.raises(depthmocap.DepthMocapError, match="give a number of people, or 'all'"):
            depthmocap.Tracker(intrinsics=INTRINSICS, people=wrong)  # type: ignore[arg-type]


def test_a_track_becomes_a_table_with_the_columns_of_the_csv(sways: depthmocap.Track, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    table = sways.to_dataframe()
    assert isinstance(table, pandas.DataFrame) and len(table) == FRAMES and table.index.name == "time_s"
    np.testing.assert_array_equal(table["head_z_m"], sways.joints[:, depthmocap.JOINT_NAMES.index("head"), 2])
    assert table["state"].tolist() == sways.state.tolist() and table["head_confidence"].isna().sum() == 2
    csv = pandas.read_csv(sways.export(tmp_path / "a.csv", origin="camera"))
    assert list(csv.columns[1:]) == list(table.columns)


def test_without_pandas_the_error_names_the_command(sways: depthmocap.Track, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(depthmocap.DepthMocapError, match="pip install pandas"):
        sways.to_dataframe()


def test_a_track_is_scored_against_the_truth(sways: depthmocap.Track) -> None:
    truth = sways.person.track.joints.astype(np.float64)
    truth[:, 0, 0] += 0.02
    assert depthmocap.evaluate(sways, truth).mean().error_mm == pytest.approx(1.0, abs=1e-3)
    both = depthmocap.evaluate([sways], np.stack([truth, truth + 0.5]))
    assert [row.recording for row in both] == ["take", "not found"]
    with pytest.raises(depthmocap.DepthMocapError, match="has 11 frames"):
        depthmocap.evaluate(sways, truth[:-1])
    with pytest.raises(depthmocap.DepthMocapError, match="give truth=, joints"):
        depthmocap.evaluate(sways)


@pytest.mark.parametrize(
    ("depth", "options", "says"),
    [
        (np.zeros((4, 5)), {}, r"give numbers \(frames, height, width\)"),
        (np.zeros((2, 4, 5)), {}, "--intrinsics"),
        (np.zeros((2, 4, 5)), {"people": "everybody"}, "give a number of people"),
        (np.zeros((2, 4, 5)), {"no_such": 1}, "unknown reader option"),
        ("absent.npz", {}, "there is no recording at absent.npz"),
        ("absent.npz", {"timestamps": np.zeros(3)}, "belong to an array"),
    ],
)
def test_what_cannot_be_tracked_is_one_sentence(depth: object, options: dict[str, object], says: str) -> None:
    with pytest.raises(depthmocap.DepthMocapError, match=says):
        depthmocap.track(depth, **options)  # type: ignore[call-overload]
