from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.speed import compare
from tests.database_helpers import small_database
from tests.fitting_helpers import Fit, whole_image
from tests.support.plain_fitting import PlainObjective, PlainPlacer, plain_refiner, plain_solve
from tests.support.plain_landmarks import plain_centre, plain_extrema, plain_graph, plain_source
from tests.support.subjects import LEVEL, camera_for, draw, moving_poses, write_recording
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.fitting.estimated_joints import EstimatedJoints
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.open3d_scene import Open3DScene
from toolkit.fitting.placed import Placer
from toolkit.fitting.scene import Scene
from toolkit.fitting.terms import JointTerm
from toolkit.kernels.fit import twists
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.extrema import extrema_of_graph, source_node
from toolkit.landmarks.graph import grid_graph
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.landmarks.landmark_settings import LandmarkSettings
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


@pytest.mark.parametrize("seed", range(4))
def test_plain_and_compiled_landmarks_are_the_same(seed: int) -> None:
    settings = LandmarkSettings()
    _, cloud = frame(seed)
    scale = (0.8, 1.0, 1.1, 1.2)[seed]
    centre = cloud_centre(cloud.points, None, scale)
    assert plain_centre(cloud.points, None, scale) == pytest.approx(centre, abs=1e-6)
    graph = grid_graph(cloud, settings)
    matrix, largest = plain_graph(cloud, settings)
    assert (matrix != graph.matrix()).nnz == 0
    source = source_node(graph, cloud.points, centre, settings, scale)
    assert plain_source(cloud.points, largest, centre, settings, scale) == source
    fast, plain = extrema_of_graph(graph, cloud.points, 20, source), plain_extrema(matrix, cloud.points, source, 20)
    for name in ("nodes", "points", "distances", "visited"):
        assert np.array_equal(getattr(fast, name), getattr(plain, name))
    assert np.array_equal(fast.from_source[fast.nodes], plain.from_source[plain.nodes])


@pytest.mark.parametrize("seed", range(3))
def test_a_plainly_placed_body_is_the_compiled_one(seed: int) -> None:
    pose, cloud = frame(seed)
    hidden = np.random.default_rng(seed).random(cloud.depth.shape) < 0.2
    scene = Scene(cloud, np.zeros((0, 3)), 0, unobserved=hidden)
    fast, plain = (kind(BODY, CAMERA, LEVEL).place(BODY, pose) for kind in (Placer, PlainPlacer))
    for name in ("vertices", "normals", "rotations", "origins", "axes"):
        assert getattr(plain, name) == pytest.approx(getattr(fast, name), abs=1e-9), name
    depth, triangle = whole_image(fast)
    assert plain.drawn.depth == pytest.approx(depth, abs=1e-9)
    assert (plain.drawn.triangle == triangle).mean() > 0.9999
    assert np.array_equal(
        plain.visible(0.1, 0.03, scene.seen, scene.intrinsics), fast.visible(0.1, 0.03, scene.seen, scene.intrinsics)
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_plain_bounded_step_is_the_compiled_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(60, skeleton.POSE_SIZE))
    matrix, vector = half.T @ half, 60 * rng.normal(size=skeleton.POSE_SIZE)
    damping = np.full(skeleton.POSE_SIZE, 0.5)
    pose, step = np.zeros(skeleton.POSE_SIZE), np.empty(skeleton.POSE_SIZE)
    twists.bounded_step(matrix, vector, pose, skeleton.POSE_LIMITS, damping, step)
    plain = np.empty_like(step)
    plain_solve(matrix, vector, pose, skeleton.POSE_LIMITS, damping, plain)
    assert plain == pytest.approx(step, abs=1e-9)
    assert (step[6:] == skeleton.POSE_LIMITS[6:, 0]).any()


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
