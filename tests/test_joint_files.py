"""Joints from folders of JSON, and the source of a run's joints."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.fake_tracker import FakeTracker
from toolkit.app.pipeline import track_recording
from toolkit.app.pipeline.image_joints import JointChoice, give_joints, joint_source
from toolkit.body import skeleton
from toolkit.io.errors import ModelError, UsageError
from toolkit.people.image_joints.joint_formats import BODY_25, COCO_17, COCO_18, POSE_MODEL, Points
from toolkit.people.image_joints.pose_model import MODEL_FILE, PoseModel
from toolkit.people.joint_masks import GivenJoints
from toolkit.people.survey import find_people
from toolkit.recordings.joint_files import read_joints
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import lift
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracks import RunInfo

CAMERA = Camera(60.0, 60.0, 31.0, 23.5, 64, 48)
WRIST, HEAD = skeleton.REPORTED.index("left_wrist"), skeleton.REPORTED.index("head")
FORMATS = {75: BODY_25, 54: COCO_18, 51: COCO_17, 99: POSE_MODEL}


def truth(seed: int = 0) -> np.ndarray:
    """Return pixels and confidences of the 20 joints, (20, 3)."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(3, 60, 20), rng.uniform(3, 44, 20), rng.uniform(0.4, 1.0, 20)])


def written(rows: np.ndarray, points: Points, numbers: int) -> list[float]:
    """Return joints (20, 3) in a detector's format: each point of a joint is at the joint."""
    flat = np.zeros((numbers // 3, 3))
    for name, sources in points.items():
        flat[list(sources)] = rows[skeleton.REPORTED.index(name)]
    return [float(x) for x in flat.ravel()]


def person(rows: np.ndarray) -> dict[str, Any]:
    """Return a person in OpenPose's format."""
    return {"pose_keypoints_2d": written(rows, BODY_25, 75)}


def folder_of(path: Path, *frames: Any) -> Path:
    """Write a folder of JSON, one file for each frame; text is written unchanged."""
    path.mkdir(exist_ok=True)
    for i, frame in enumerate(frames):
        text = frame if isinstance(frame, str) else json.dumps(frame)
        (path / f"take_{i}_keypoints.json").write_text(text)
    return path


def one(rows: np.ndarray) -> dict[str, Any]:
    """Return a file with one person."""
    return {"people": [person(rows)]}


@pytest.mark.parametrize("numbers", list(FORMATS))
def test_formats_written_from_one_truth_give_the_same_joints(tmp_path: Path, numbers: int) -> None:
    rows, points = truth(), FORMATS[numbers]
    frame = {"people": [{"pose_keypoints_2d": written(rows, points, numbers)}]}
    found = read_joints(folder_of(tmp_path / "json", frame), 1, CAMERA)
    known = [skeleton.REPORTED.index(name) for name in points]
    np.testing.assert_allclose(found[0, 0, known], rows[known], atol=1e-5)
    assert np.isnan(np.delete(found[0, 0], known, axis=0)).all()


def test_left_and_right_are_those_of_the_format() -> None:
    """By the published lists of points: number 4 of BODY_25 is the right wrist, of COCO-17 number 9 the left one, of
    MediaPipe number 15.
    """
    assert BODY_25["right_wrist"] == COCO_18["right_wrist"] == (4,) and COCO_17["left_wrist"] == (9,)
    assert POSE_MODEL["left_wrist"] == (15,) and POSE_MODEL["right_wrist"] == (16,)
    assert BODY_25["left_foot"] == (19,) and BODY_25["head"] == (18, 17)
    assert COCO_18["left_hip"] == (11,) and COCO_17["right_ankle"] == (16,)


def test_of_two_ears_the_one_that_is_seen_is_the_head(tmp_path: Path) -> None:
    numbers = written(truth(), BODY_25, 75)
    numbers[3 * 18 : 3 * 18 + 3] = 10.0, 12.0, 0.8
    numbers[3 * 17 : 3 * 17 + 3] = 0.0, 0.0, 0.0
    found = read_joints(folder_of(tmp_path / "json", {"people": [{"pose_keypoints_2d": numbers}]}), 1, CAMERA)
    np.testing.assert_allclose(found[0, 0, HEAD], (10, 12, 0.8), atol=1e-6)


def test_fewer_files_are_matched_by_the_number_of_their_frame(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "json")
    for i in (2, 5):
        (folder / f"clip7_{i:012d}_keypoints.json").write_text(json.dumps(one(truth(i))))
    found = read_joints(folder, 9, CAMERA)
    assert [i for i in range(9) if np.isfinite(found[0, i]).any()] == [2, 5]
    np.testing.assert_allclose(found[0, 5, WRIST], truth(5)[WRIST], atol=1e-5)


def test_several_people_a_frame_without_people_and_one_without_any_confidence(tmp_path: Path) -> None:
    unsure = truth() * [1, 1, 0]
    folder = folder_of(tmp_path / "json", {"people": [person(truth(1)), person(truth(2))]}, {"people": []}, one(unsure))
    found = read_joints(folder, 3, CAMERA)
    assert found.shape == (2, 3, 20, 3)
    assert np.isfinite(found).any(axis=(2, 3)).tolist() == [[True, False, False], [True, False, False]]


def test_joints_found_at_another_size_are_scaled_to_the_depth(tmp_path: Path) -> None:
    rows = truth()
    larger = rows * [2, 2, 1] + [0.5, 0.5, 0]
    found = read_joints(folder_of(tmp_path / "json", one(larger)), 1, CAMERA, (128, 96))
    np.testing.assert_allclose(found[0, 0, WRIST], rows[WRIST], atol=1e-4)


def take(path: Path, *, color: bool = False, joints: bool = False) -> Recording:
    """Write a recording of a person who stands still, three frames."""
    depth = np.zeros((3, *CAMERA.shape), dtype=np.uint16)
    depth[:, 5:45, 20:40] = 2000
    save_recording(
        path,
        depth=depth,
        camera=CAMERA,
        timestamps=np.arange(3) / 30,
        color=np.zeros((3, *CAMERA.shape, 3), dtype=np.uint8) if color else None,
        joints_2d=np.stack([truth(i) for i in range(3)]) if joints else None,
    )
    return open_recording(path)


@pytest.fixture
def no_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Simulate a user without the pose model."""
    monkeypatch.setenv("DEPTHMOCAP_DATA", str(tmp_path / "data"))
    return tmp_path / "data"


def test_joints_of_the_recording_come_before_any_detector(tmp_path: Path, no_model: Path) -> None:
    recording = take(tmp_path / "take.npz", color=True, joints=True)
    assert isinstance(joint_source(recording, JointChoice(), "required"), GivenJoints)


def test_a_folder_replaces_the_joints_of_the_recording(tmp_path: Path) -> None:
    recording = take(tmp_path / "take.npz", joints=True)
    choice = JointChoice(folder_of(tmp_path / "json", *(one(truth(9)) for _ in range(3))))
    give_joints(recording, choice)
    np.testing.assert_allclose(recording.joints_2d(2)[0].pixels[WRIST], truth(9)[WRIST, :2], atol=1e-4)
    assert isinstance(joint_source(recording, choice, "required"), GivenJoints)


@pytest.mark.parametrize("source", ["auto", "colour", "depth"])
def test_without_the_model_the_error_names_the_script_and_the_option(
    tmp_path: Path, no_model: Path, source: str
) -> None:
    with pytest.raises(ModelError, match=r"joints --fetch.*--joints"):
        joint_source(take(tmp_path / "take.npz", color=True), JointChoice(source), "required")


def test_a_model_of_another_checksum_is_refused(no_model: Path) -> None:
    no_model.mkdir()
    (no_model / MODEL_FILE).write_bytes(b"something else")
    with pytest.raises(ModelError, match=r"SHA-256.*joints --fetch.*--joints"):
        PoseModel.load()


def test_joints_for_a_tracker_without_use_for_them_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="uses no joints"):
        track_recording(take(tmp_path / "take.npz"), FakeTracker(), tmp_path / "run", joints=JointChoice("depth"))


@pytest.mark.parametrize(
    ("choice", "recordings", "said"),
    [(JointChoice(size=(64, 48)), 1, "--joints-size belongs"), (JointChoice("json"), 2, "belong to one recording")],
)
def test_a_choice_that_cannot_work_is_refused(choice: JointChoice, recordings: int, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        choice.check(recordings)


class JointTracker(FakeTracker):
    """Tracker that uses joints."""

    joints_wanted = "required"


def test_a_run_stores_the_source_of_its_joints(tmp_path: Path) -> None:
    recording = take(tmp_path / "take.npz", joints=True)
    track_recording(recording, JointTracker(), tmp_path / "given")
    track_recording(recording, JointTracker(), tmp_path / "none", joints=JointChoice("none"))
    assert RunInfo.load(tmp_path / "given").joints_2d.startswith("given ")
    assert RunInfo.load(tmp_path / "none").joints_2d == "none"


@pytest.mark.data("realsense")
def test_openpose_joints_of_a_real_frame_land_on_the_right_people_and_sides(data_folder: Path, tmp_path: Path) -> None:
    clip = data_folder / "depth" / "realsense" / "image_i1"
    people = [{"pose_keypoints_2d": rows.ravel().tolist()} for rows in np.load(clip / "body_joints.npy")]
    recording = open_recording(clip)
    folder = folder_of(tmp_path / "json", {"people": people})
    recording.give_joints_2d(read_joints(folder, len(recording), recording.raw_camera))
    frame = next(iter(recording.stream()))
    sightings = find_people(recording, SensingSettings()).find(frame.depth_mm, frame.timestamp, {})
    given = [s for s in GivenJoints(recording.camera).add(frame, sightings) if s.joints is not None]
    assert given
    for sighting in given:
        points = lift(sighting.joints, sighting.depth, sighting.camera).points
        for part in ("shoulder", "elbow", "hip"):
            left, right = (points[skeleton.REPORTED.index(f"{side}_{part}")] for side in ("left", "right"))
            assert np.isnan(left[0] + right[0]) or left[0] > right[0] + 0.05  # both face the camera
        assert np.nanmax(np.linalg.norm(points - np.nanmedian(points, axis=0), axis=1)) < 1.5
