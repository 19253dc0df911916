"""Evaluation on each depth frame: an exactly known body drawn into a recording."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.poses import pose_at
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.evaluation.evaluate import evaluate_runs
from toolkit.evaluation.extrema_scores import all_free
from toolkit.evaluation.joint_errors import visible_joints
from toolkit.evaluation.scores import RunScores
from toolkit.io.files import sha256_of
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.cloud import Cloud
from toolkit.simulation.raycast import render_depth
from toolkit.tracks import TRACKED, FrameResult, RunInfo, TrackWriter

CAMERA = Camera(285.6, 285.6, 159.5, 119.5, 320, 240)
ROTATION = level_rotation(np.array([0.0, -1.0, 0.0]))
FRAMES = 3


@pytest.fixture(scope="module")
def body() -> Body:
    return load_body("neutral")


pose = partial(pose_at, (0.0, 0.0, -2.8))


def joints_of(body: Body, at: np.ndarray) -> np.ndarray:
    return (body.joint_positions(at) @ ROTATION).astype(np.float32)


def evaluated(folder: Path, body: Body, true: np.ndarray, found: np.ndarray) -> RunScores:
    """Return scores of a run with one pose in each frame where another is true."""
    depth = (1000 * render_depth(body, true, CAMERA, ROTATION)).round().astype(np.uint16)
    recording, run, times = folder / "take.npz", folder / "run", np.arange(FRAMES) / 30
    save_recording(
        recording, depth=np.repeat(depth[None], FRAMES, 0), camera=CAMERA, timestamps=times, up_camera=(0, -1, 0),
        joints=np.repeat(joints_of(body, true)[None], FRAMES, 0),
    )  # fmt: skip
    writer = TrackWriter(run, ("fit",), ("local",))
    for time in times:
        ones = np.ones(20, np.float32)
        writer.append(FrameResult(found, joints_of(body, found), ones, TRACKED, 0, np.ones(1, np.float32)), time)
    writer.finish()
    RunInfo(
        str(recording), sha256_of(recording), {}, skeleton.fingerprint(), body.shape.tolist(), body.scale, "",
        ROTATION.ravel().tolist(), {}, "0.1.0",
    ).save(run)  # fmt: skip
    return evaluate_runs([run]).rows[0]


def test_the_true_pose_explains_its_depth_image(tmp_path: Path, body: Body) -> None:
    row = evaluated(tmp_path, body, pose(), pose())
    assert row.overlap is not None and row.overlap > 0.95
    assert row.residual_mm is not None and row.residual_mm < 2
    assert row.error_mm == row.visible_mm == 0.0
    assert row.hidden_mm is None
    assert row.extrema == row.extrema_free == 1.0


def test_a_displaced_pose_shows_in_overlap_and_residual(tmp_path: Path, body: Body) -> None:
    aside, behind = pose(root_tx=0.1), pose(root_tz=-0.1)
    assert (evaluated(tmp_path, body, pose(), aside).overlap or 1.0) < 0.8
    row = evaluated(tmp_path / "behind", body, pose(), behind)
    assert row.residual_mm == pytest.approx(100, abs=5)
    assert row.error_mm == pytest.approx(100, abs=0.1)


def test_a_joint_behind_the_body_is_hidden_and_its_error_shown_apart(tmp_path: Path, body: Body) -> None:
    sideways = pose(root_ry=np.pi / 2)  # the right side is seen, the left arm is behind the body
    depth = render_depth(body, sideways, CAMERA, ROTATION)
    seen = visible_joints(joints_of(body, sideways), depth, CAMERA)
    assert not seen[skeleton.REPORTED.index("left_hand")] and seen[skeleton.REPORTED.index("right_hand")]
    raised = sideways.copy()
    raised[skeleton.POSE_NAMES.index("left_shoulder_rz")] = 0.6
    row = evaluated(tmp_path, body, sideways, raised)
    assert row.hidden_mm is not None and row.visible_mm is not None and row.hidden_mm > 10 * row.visible_mm
    assert row.extrema is None


def test_a_hand_at_the_hip_is_not_free_of_the_body(body: Body) -> None:
    for angles, free in (({}, True), ({"left_shoulder_rz": -1.65, "right_shoulder_rz": 1.65}, False)):
        depth = render_depth(body, pose(**angles), CAMERA, ROTATION)
        cloud = Cloud.from_depth(depth, CAMERA, ROTATION)
        assert all_free(cloud, body.joint_positions(pose(**angles)), LandmarkSettings()) is free
