from dataclasses import replace

import numpy as np
import pytest

from benchmarks.speed import compare
from tests.database_helpers import small_database
from tests.fitting_helpers import Fit
from tests.support.plain_fitting import PlainObjective, PlainPlacer, plain_refiner
from tests.support.subjects import LEVEL, camera_for, draw, moving_poses, write_recording
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.joint_evidence import EstimatedJoints
from toolkit.fitting.open3d_scene import Open3DScene
from toolkit.fitting.scene import Scene
from toolkit.fitting.terms import JointTerm
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.recordings.opening import open_recording
from toolkit.sensing.cloud import Cloud
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings

BODY = load_body("neutral")
CAMERA = camera_for(2500)


def frame(seed: int) -> tuple[np.ndarray, Cloud]:
    """Return a pose (P,) and the cloud of the body in it."""
    rng = np.random.default_rng(seed)
    pose = moving_poses(20, rng)[seed]
    return pose, Cloud.from_depth(draw(BODY, pose, CAMERA, rng), CAMERA, LEVEL)


@pytest.mark.parametrize("seed", range(3))
def test_the_plain_refiner_finds_the_pose_of_the_compiled_one(seed: int) -> None:
    pose, cloud = frame(seed)
    settings = replace(FittingSettings(), cloud_samples=200)
    fast, plain = Fit(BODY, CAMERA, LEVEL, settings), Fit(BODY, CAMERA, LEVEL, settings)
    plain.placer = PlainPlacer.like(fast.placer)
    plain.objective, plain.refiner = PlainObjective(plain.placer, settings), plain_refiner(plain.placer, settings)
    extrema = cloud.points[:: len(cloud) // 20].astype(np.float64)
    scene, plain_scene = Scene(cloud, extrema, 200), Open3DScene(cloud, extrema, 200)
    start = pose + np.random.default_rng(seed).normal(0.0, 0.05, len(pose))
    start = np.clip(start, *skeleton.POSE_LIMITS.T)
    pull = JointTerm(BODY.joint_positions(pose) @ LEVEL, np.full(20, 5.0), 0.3)
    for terms in ([], [pull]):
        found, again = (f.refine(start, s, terms=terms) for f, s in ((fast, scene), (plain, plain_scene)))
        joints = BODY.joint_positions(np.stack([found, again]))
        assert np.linalg.norm(joints[0] - joints[1], axis=1).max() < 1e-3
    assert plain.distance(pose, plain_scene) == pytest.approx(fast.distance(pose, scene), abs=1e-9)
    away = JointEstimate(BODY.joint_positions(pose) + [0.25, 0.0, 0.0], np.ones(20))
    known = [EstimatedJoints(away, cloud.rotation, 30.0)]
    with_estimate = fast.distance(pose, Scene(cloud, extrema, 200, evidence=known))
    assert plain.distance(pose, Open3DScene(cloud, extrema, 200, known)) == pytest.approx(with_estimate, abs=1e-9)
    assert with_estimate > fast.distance(pose, scene) + 0.1
    shins = np.array([name.endswith(("knee", "ankle")) for name in skeleton.JOINT_NAMES])
    withheld, plainly = (kind(cloud, extrema, 200, withheld=shins) for kind in (Scene, Open3DScene))
    assert plain.distance(pose, plainly) == pytest.approx(fast.distance(pose, withheld), abs=1e-9)
    assert fast.distance(pose, withheld) > fast.distance(pose, scene) + 0.01


def test_the_plain_tracker_finds_the_poses_of_the_hybrid_tracker(tmp_path) -> None:
    path = tmp_path / "rendered.npz"
    write_recording(path, 2500, 8)
    row = compare(open_recording(path), small_database(), HybridSettings(hypotheses=("local", "extrema")), frames=8)
    assert row["apart_mm"]["max"] < 1.0
    assert row["equal_sources"] == 1.0
