"""Poses drawn and scored in bulk, against plain references."""

import numpy as np
import pytest

from tests.support.subjects import LEVEL, moving_poses
from toolkit.app.config import load_settings
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.kernels.fit import swarm as kernel
from toolkit.kernels.image import raster
from toolkit.sensing.camera import Camera
from toolkit.trackers.qammaz.discrepancy import (
    JOINT_WEIGHTS,
    Discrepancy,
    DiscrepancySettings,
    SeenJoints,
    SmallImage,
    figure_of,
    small_image,
)
from toolkit.trackers.qammaz.tracker import SwarmTrackerSettings

BODY = load_body("neutral")
CAMERA = Camera(60.0, 70.0, 29.2, 34.7, 60, 70)
POSES = moving_poses(6, np.random.default_rng(0))


def view_of(pose: np.ndarray, depth: np.ndarray, intrinsics: np.ndarray = CAMERA.intrinsics) -> kernel.View:
    """Return positions with the root's orientation as reference, so that a position's own one is 0."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec(pose[skeleton.ROOT_ROTATION]).as_matrix()
    return kernel.View(np.ascontiguousarray(LEVEL.T), LEVEL.T @ turn, np.array(intrinsics), depth, 0.3, 1.0)


def drawn(pose: np.ndarray, kind: str) -> tuple[np.ndarray, kernel.Buffers]:
    """Return the kernel's depth (h, w), 0 where empty."""
    figure, view = figure_of(BODY, kind), view_of(pose, np.zeros(CAMERA.shape))
    buffers = kernel.buffers_for(figure, CAMERA.shape)
    position = pose.copy()
    position[skeleton.ROOT_ROTATION] = 0.0
    kernel.place(position, figure, view, buffers)
    kernel.draw(figure, view, buffers)
    inverse = buffers.inverse
    return np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0), buffers


def twin_cost(depth: np.ndarray, seen: np.ndarray, clamp: float) -> float:
    """Return Eq. 3 without its division, pixel by pixel."""
    total = 0.0
    for h, o in zip(depth.ravel(), seen.ravel(), strict=True):
        if np.isnan(o) or (h == 0 and o == 0):
            continue
        total += min(abs(h - o), clamp) if h > 0 and o > 0 else clamp
    return total


@pytest.mark.parametrize("pose", POSES)
def test_joints_are_placed_as_the_body_places_them(pose: np.ndarray) -> None:
    buffers = drawn(pose, "balls")[1]
    placed = BODY.place(pose)
    np.testing.assert_allclose(buffers.origins, placed.origins @ LEVEL, atol=1e-9)
    np.testing.assert_allclose(buffers.rotations, LEVEL.T @ placed.rotations, atol=1e-9)


@pytest.mark.parametrize("pose", POSES[:3])
def test_the_mesh_is_drawn_as_the_z_buffer_of_the_fit_draws_it(pose: np.ndarray) -> None:
    vertices = BODY.vertex_positions(pose) @ LEVEL
    projected, inverse = np.empty_like(vertices), np.empty(CAMERA.shape)
    raster.project(vertices, np.array(CAMERA.intrinsics), projected)
    raster.rasterise(projected, BODY.faces.astype(np.int64), inverse, np.empty(CAMERA.shape, dtype=np.int32))
    expected = np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0)
    np.testing.assert_allclose(drawn(pose, "mesh")[0], expected, atol=1e-9)


def mixed(depth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return an observed image with all three kinds of pixels."""
    seen = np.where(depth > 0, depth + rng.normal(0, 0.1, depth.shape), 0.0)
    seen[rng.random(depth.shape) < 0.1] = np.nan
    seen[rng.random(depth.shape) < 0.1] = 0.0
    return seen


@pytest.mark.parametrize("kind", ["balls", "mesh"])
def test_a_batch_costs_what_plain_loops_say(kind: str) -> None:
    rng = np.random.default_rng(1)
    seen_depth = mixed(drawn(POSES[0], kind)[0], rng)
    image = SmallImage(seen_depth, np.array(CAMERA.intrinsics), 2.8)
    truth = BODY.joint_positions(POSES[0]) @ LEVEL
    noisy = truth + rng.normal(0, 0.05, truth.shape)
    noisy[5] = np.nan
    slopes = truth[:, :2] / truth[:, 2:] + rng.normal(0, 0.02, (20, 2))
    confidence = rng.uniform(0.4, 1.0, 20)
    confidence[[7, 12]] = 0.0
    seen = SeenJoints(slopes, noisy, confidence)
    settings = DiscrepancySettings(kind, depth=2.0, joints_2d=0.7, joints_3d=0.4)
    discrepancy = Discrepancy(BODY, image, seen, LEVEL, POSES[0], settings)
    costs = discrepancy(discrepancy.position_of(POSES))
    derived = [skeleton.REPORTED.index(name) for name in ("pelvis", "spine", "neck")]
    w = JOINT_WEIGHTS * confidence
    w[derived] = 0.0
    w3 = np.where(np.isnan(noisy[:, 0]), 0.0, w)
    for pose, cost in zip(POSES, costs, strict=True):
        joints = BODY.joint_positions(pose) @ LEVEL
        in_image = 2.8 * np.linalg.norm(joints[:, :2] / joints[:, 2:] - slopes, axis=1)
        in_space = np.nan_to_num(np.linalg.norm(joints - noisy, axis=1))
        expected = 2.0 * twin_cost(drawn(pose, kind)[0], seen_depth, 0.3) / np.count_nonzero(seen_depth > 0)
        expected += (0.7 * (w * in_image).sum() + 0.4 * (w3 * in_space).sum()) / w.sum()
        assert cost == pytest.approx(expected, abs=1e-4)


def test_qammaz_costs_what_equations_3_to_6_say() -> None:
    """With the settings of configs/qammaz.yaml: N_P has no floor, joints count by w_i, not by confidence."""
    settings = load_settings(SwarmTrackerSettings, "qammaz").discrepancy
    rng = np.random.default_rng(5)
    seen_depth = mixed(drawn(POSES[0], "mesh")[0], rng)
    image = SmallImage(seen_depth, np.array(CAMERA.intrinsics), 2.8)
    away = POSES[0].copy()
    away[0] += 0.4  # less than half of the person is near the previous solution
    truth = BODY.joint_positions(POSES[0]) @ LEVEL
    slopes, points = truth[:, :2] / truth[:, 2:] + 0.02, truth + rng.normal(0, 0.05, truth.shape)
    points[9] = np.nan
    seen = SeenJoints(slopes, points, rng.uniform(0.3, 1.0, 20))
    found = Discrepancy(BODY, image, seen, LEVEL, away, settings, previous=True)
    previous = drawn(away, "mesh")[0]
    near = sum(d > 0 and h > 0 and abs(d - h) < 0.3 for d, h in zip(seen_depth.ravel(), previous.ravel(), strict=True))
    assert 0 < near < 0.5 * image.person
    names = [n.split("_")[-1] for n in skeleton.REPORTED]
    weights = [{"hip": 0.2, "wrist": 1.8, "ankle": 1.8, "pelvis": 0, "spine": 0, "neck": 0}.get(n, 1.0) for n in names]
    for pose, cost in zip(POSES, found(found.position_of(POSES)), strict=True):
        joints = BODY.joint_positions(pose) @ LEVEL
        in_image = in_space = total = 0.0
        for i, w in enumerate(weights):
            in_image += w * 2.8 * np.linalg.norm(joints[i, :2] / joints[i, 2] - slopes[i])
            total += w
            if np.isfinite(points[i, 0]):
                in_space += w * np.linalg.norm(joints[i] - points[i])
        expected = settings.depth * twin_cost(drawn(pose, "mesh")[0], seen_depth, settings.clamp) / near
        expected += (settings.joints_2d * in_image + settings.joints_3d * in_space) / total
        assert cost == pytest.approx(expected, abs=1e-4)


def test_the_depth_term_is_zero_at_the_pose_that_drew_the_image() -> None:
    for kind in ("balls", "mesh"):
        image = SmallImage(drawn(POSES[0], kind)[0], np.array(CAMERA.intrinsics), 2.8)
        found = Discrepancy(BODY, image, None, LEVEL, POSES[0], DiscrepancySettings(kind))
        assert found(found.position_of(POSES[:1]))[0] == pytest.approx(0.0, abs=1e-6)
        assert (found(found.position_of(POSES[1:])) > 1e-3).all()


def test_the_small_image_holds_the_persons_box_and_what_is_known() -> None:
    depth = np.zeros((100, 80), dtype=np.float32)
    depth[40:60, 70:80] = 2.5
    unobserved = np.zeros(depth.shape, dtype=bool)
    unobserved[:45] = True
    small = small_image(depth, unobserved, np.array([90.0, 90.0, 40.0, 50.0]), (40, 25))
    assert small.distance == 2.5
    assert np.isnan(small.depth[:, -2:]).all()  # beyond the image
    assert np.isnan(small.depth[0]).all() and (small.depth[-2:, :20] == 0.0).all()
    # a point of the person is seen at the same place, in other pixels
    x, y = (75 - 40.0) / 90.0, (52 - 50.0) / 90.0
    fx, fy, cx, cy = small.intrinsics
    u, v = fx * x + cx, fy * y + cy
    assert small.depth[round(v), round(u)] == 2.5
    # Its pixels are 10 by 20, the box 12.5 by 25 around (74.5, 49.5).
    assert (u, v) == pytest.approx(((75 - 68.25) / 0.5 - 0.5, (52 - 37) / 0.625 - 0.5))
