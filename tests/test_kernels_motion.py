"""Kernels of motion against SciPy, finite differences and plain NumPy, and the skin and pictures made with them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_normal

from toolkit.body import skeleton
from toolkit.body.body import vertex_normals
from toolkit.body.rotations.matrices import euler_matrices
from toolkit.body.shape import load_body
from toolkit.kernels import kinematics
from toolkit.kernels.fit import placing
from toolkit.kernels.image.shading import NEAREST, shade_triangles
from toolkit.kernels.learning import gaussians
from toolkit.kernels.motion import relations
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.simulation.skinning import SKINNINGS


def random_pose(spread: float = 0.4) -> np.ndarray:
    pose = np.random.default_rng(7).normal(0.0, spread, skeleton.POSE_SIZE)
    return np.clip(pose, *skeleton.POSE_LIMITS.T)


@pytest.mark.parametrize("length", [0.0, 1e-8, 1e-5, 1e-3, 0.7, 3.1, 6.0])
def test_the_exponential_map_and_its_left_jacobian_hold_at_every_angle(length: float) -> None:
    axis = np.array([0.36, -0.48, 0.8])
    vector, out, jacobian = length * axis, np.empty((3, 3)), np.empty((3, 3))
    kinematics.rotation_from_vector(*vector, out)
    np.testing.assert_allclose(out, Rotation.from_rotvec(vector).as_matrix(), atol=1e-12)
    kinematics.left_jacobian(*vector, jacobian)
    step = 1e-6
    for k, unit in enumerate(np.eye(3)):
        turned = Rotation.from_rotvec(vector + step * unit) * Rotation.from_rotvec(vector - step * unit).inv()
        np.testing.assert_allclose(jacobian[:, k], turned.as_rotvec() / (2 * step), atol=1e-8)


def test_axes_of_a_pose_say_how_the_tips_move_with_each_entry() -> None:
    body, pose, step = load_body("neutral"), random_pose(), 1e-6
    count = len(skeleton.JOINT_NAMES)
    vectors, turns, origins = np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 3))
    chain = (skeleton.PARENTS, body.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS)
    kinematics.forward_kinematics(pose, *chain, vectors, turns, origins)
    axes = np.empty((skeleton.POSE_SIZE - 3, 3))
    kinematics.world_axes(skeleton.PARENTS, vectors, turns, skeleton.DOF_JOINT, skeleton.DOF_AXIS, axes)
    last = count - 1
    ancestors, joint = [], last
    while joint >= 0:
        ancestors.append(joint)
        joint = int(skeleton.PARENTS[joint])
    for entry, joint in enumerate(skeleton.DOF_JOINT):
        moved = []
        for sign in (1, -1):
            other = pose.copy()
            other[3 + entry] += sign * step
            kinematics.forward_kinematics(other, *chain, vectors, turns, origins)
            moved.append(origins[last].copy())
        kinematics.forward_kinematics(pose, *chain, vectors, turns, origins)
        lever = np.cross(axes[entry], origins[last] - origins[joint]) if joint in ancestors else np.zeros(3)
        np.testing.assert_allclose((moved[0] - moved[1]) / (2 * step), lever, atol=1e-7)


def test_a_body_placed_before_a_camera_is_the_skinned_body_turned_there() -> None:
    body, pose = load_body("neutral"), random_pose()
    turn = level_rotation(np.array([0.1, -0.9, -0.3])).T
    count, vertices = len(skeleton.JOINT_NAMES), len(body.vertices)
    turns, origins, axes = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty((skeleton.POSE_SIZE - 3, 3))
    points, normals = np.empty((vertices, 3)), np.empty((vertices, 3))
    placing.place(
        pose, skeleton.PARENTS, body.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS, turn, body.vertices, body.normals,
        body.skin_joints, body.skin_weights, turns, origins, axes, points, normals,
    )  # fmt: skip
    np.testing.assert_allclose(points, body.vertex_positions(pose) @ turn.T, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-9)
    outward = vertex_normals(points, body.faces)
    assert np.median((normals * outward).sum(axis=1)) > 0.97


def test_a_drawn_mesh_has_its_depth_and_nothing_beside_it() -> None:
    camera = Camera(50.0, 50.0, 9.5, 9.5, 20, 20)
    # A square of 0.4 m at 2 m covers 10 by 10 pixels.
    points = np.array([(-0.2, -0.2, 2.0), (0.2, -0.2, 2.0), (0.2, 0.2, 2.0), (-0.2, 0.2, 2.0)])
    faces = np.array([(0, 2, 1), (0, 3, 2)])
    depth, triangle, (fx, fy, cx, cy) = placing.draw(points, faces, camera.intrinsics, *camera.shape)
    assert np.count_nonzero(depth) == 100
    assert depth.shape == (12, 12) and (fx, fy, cx, cy) == (50.0, 50.0, 5.5, 5.5)
    np.testing.assert_allclose(depth[1:11, 1:11], 2.0)
    assert ((triangle >= 0) == (depth > 0)).all()
    depth, _, _ = placing.draw(points, faces[:, ::-1].copy(), camera.intrinsics, *camera.shape)
    assert not depth.any(), "seen from behind"


def test_of_a_mesh_that_leaves_the_image_what_is_in_it_is_drawn_and_of_one_beside_it_or_behind_nothing() -> None:
    camera = Camera(50.0, 50.0, 9.5, 9.5, 20, 20)
    points = np.array([(-0.2, -0.2, 2.0), (0.2, -0.2, 2.0), (0.2, 0.2, 2.0), (-0.2, 0.2, 2.0)])
    faces = np.array([(0, 2, 1), (0, 3, 2)])
    depth, _, (_, _, cx, cy) = placing.draw(points + [0.2, -0.31, 0.0], faces, camera.intrinsics, *camera.shape)
    assert depth.shape == (8, 11) and (cx, cy) == (0.5, 9.5)
    assert np.count_nonzero(depth) == 7 * 10
    for away in ([3.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, -5.0]):
        depth, triangle, _ = placing.draw(points + away, faces, camera.intrinsics, *camera.shape)
        assert depth.size == triangle.size == 0


# Mixtures of Gaussians of which some variables are known.


def mixture(count: int, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(count)
    roots = rng.normal(0.0, 1.0, (count, size, size))
    weights = rng.dirichlet(np.ones(count))
    return np.log(weights), rng.normal(0.0, 1.0, (count, size)), roots @ roots.transpose(0, 2, 1) + 0.3 * np.eye(size)


def test_what_is_known_of_a_mixture_says_what_the_joint_density_says_of_the_rest() -> None:
    log_weights, means, covariances = mixture(3, 5)
    known, unknown, noise = np.array([4, 1]), np.array([0, 2, 3]), 0.2
    values = np.array([0.4, -1.1])
    factors, gains, remaining = np.empty((3, 2, 2)), np.empty((3, 3, 2)), np.empty((3, 3, 3))
    gaussians.condition(covariances, known, unknown, noise, factors, gains, remaining)
    shares, mean, covariance = np.empty(3), np.empty(3), np.empty((3, 3))
    density = gaussians.responsibilities(values, log_weights, means, known, factors, shares)
    gaussians.expect(values, shares, means, known, unknown, gains, remaining, mean, covariance)

    likely, centres, spreads = [], [], []
    for weight, centre, full in zip(np.exp(log_weights), means, covariances, strict=True):
        a = full[np.ix_(known, known)] + noise**2 * np.eye(2)
        b = full[np.ix_(unknown, known)]
        likely.append(weight * multivariate_normal(centre[known], a).pdf(values))
        centres.append(centre[unknown] + b @ np.linalg.solve(a, values - centre[known]))
        spreads.append(full[np.ix_(unknown, unknown)] - b @ np.linalg.solve(a, b.T))
    expected = np.array(likely) / np.sum(likely)
    np.testing.assert_allclose(shares, expected, rtol=1e-9)
    assert density == pytest.approx(np.log(np.sum(likely)))
    np.testing.assert_allclose(mean, expected @ np.array(centres), rtol=1e-9)
    second = sum(p * (s + np.outer(c, c)) for p, s, c in zip(expected, spreads, centres, strict=True))
    np.testing.assert_allclose(covariance, second - np.outer(mean, mean), atol=1e-9)


def test_far_from_every_gaussian_shares_are_still_numbers() -> None:
    log_weights, means, covariances = mixture(2, 3)
    factors, gains, remaining = np.empty((2, 1, 1)), np.empty((2, 2, 1)), np.empty((2, 2, 2))
    gaussians.condition(covariances, np.array([0]), np.array([1, 2]), 0.0, factors, gains, remaining)
    shares = np.empty(2)
    density = gaussians.responsibilities(np.array([1e3]), log_weights, means, np.array([0]), factors, shares)
    assert np.isfinite(density) and shares.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(("intrinsic", "order"), [(True, "XYZ"), (True, "ZXZ"), (False, "yxz")])
def test_euler_angles_are_turned_one_after_the_other(intrinsic: bool, order: str) -> None:
    angles = np.random.default_rng(1).uniform(-4.0, 4.0, (20, 3))
    axes = np.array(["xyz".index(letter.lower()) for letter in order])
    expected = np.tile(np.eye(3), (20, 1, 1))
    for k, axis in enumerate(axes):
        turn = Rotation.from_rotvec(angles[:, [k]] * np.eye(3)[axis]).as_matrix()
        expected = expected @ turn if intrinsic else turn @ expected
    np.testing.assert_allclose(euler_matrices(axes, intrinsic, angles), expected, atol=1e-12)


def test_skin_that_twists_keeps_its_volume_by_dual_quaternions_only() -> None:
    body, pose = load_body("neutral"), np.zeros(skeleton.POSE_SIZE)
    np.testing.assert_allclose(SKINNINGS["dual"](body, pose), SKINNINGS["linear"](body, pose), atol=1e-9)
    pose[skeleton.POSE_NAMES.index("left_shoulder_rx")] = 1.5
    blended = np.flatnonzero((body.skin_weights > 0.3).sum(axis=1) == 2)
    axis = body.joints[skeleton.JOINT_NAMES.index("left_shoulder"), 1:]

    def radius(vertices: np.ndarray) -> float:
        twisted = [n for n in blended if {"left_shoulder"} & {skeleton.JOINT_NAMES[j] for j in body.skin_joints[n]}]
        return float(np.linalg.norm(vertices[twisted, 1:] - axis, axis=1).mean())

    assert radius(SKINNINGS["dual"](body, pose)) > radius(SKINNINGS["linear"](body, pose))


# A shaded mesh.

CAMERA = Camera(40.0, 40.0, 9.5, 9.5, 20, 20)
LIGHTS, KEY = np.array([0.2, 0.5, 0.3]), np.array([0.0, 0.0, -1.0])


def shaded(*triangles: tuple[np.ndarray, float], normal: tuple[float, ...] = (0, 0, -1)) -> tuple[np.ndarray, ...]:
    vertices = np.concatenate([corners for corners, _ in triangles])
    colors = np.concatenate([np.full((3, 3), grey) for _, grey in triangles])
    faces = np.arange(len(vertices)).reshape(-1, 3)
    normals = np.tile(np.array(normal, dtype=np.float64), (len(vertices), 1))
    depth, image = np.full(CAMERA.shape, np.inf), np.zeros((*CAMERA.shape, 3), dtype=np.uint8)
    shade_triangles(vertices, normals, colors, faces, CAMERA.intrinsics, LIGHTS, KEY, depth, image)
    return depth, image


def triangle(z: float) -> np.ndarray:
    return np.array([(-0.2 * z, -0.2 * z, z), (-0.2 * z, 0.6 * z, z), (0.6 * z, -0.2 * z, z)])


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_triangle_is_drawn_whichever_comes_first(order: tuple[int, int]) -> None:
    both = [(triangle(2.0), 50.0), (triangle(1.0), 200.0)]
    depth, image = shaded(*(both[k] for k in order))
    np.testing.assert_allclose(depth[9, 9], 1.0)
    ray = np.array([-0.5 / 40, -0.5 / 40, 1.0])
    assert image[9, 9, 0] == int(200.0 * (0.2 + 0.5 + 0.3 / np.linalg.norm(ray)))


def test_what_turns_away_and_what_reaches_the_camera_is_not_drawn() -> None:
    for corners in (triangle(1.0)[::-1].copy(), triangle(0.5 * NEAREST)):
        depth, image = shaded((corners, 200.0))
        assert np.isinf(depth).all() and not image.any()


def test_a_surface_that_is_lit_from_behind_has_the_light_from_everywhere_only() -> None:
    _, image = shaded((triangle(1.0), 100.0), normal=(0.0, 0.0, 1.0))
    assert image[9, 9, 0] == 20


# Relational quantities of a frame.


def quantity(joints: np.ndarray, *row: int, frame: int = 0, rate: float = 10.0) -> float:
    axes = np.tile(np.eye(3)[0], (len(joints), 1))
    out = np.empty(1)
    relations.quantities(joints, axes, frame, rate, np.array([row + (0,) * (6 - len(row)) + (1, 1)]), out)
    return float(out[0])


def test_quantities_of_points_are_those_of_school_geometry() -> None:
    here = np.array([[(0, 0, 0), (1, 0, 0), (0, 0, 1), (0.5, 0.7, 0.2), (0.3, -0.2, 0.9)]], dtype=np.float64)
    assert quantity(here, relations.PLANE, 0, 1, 2, 3, 4) == pytest.approx(-0.9)  # its normal points down
    assert quantity(here, relations.NPLANE, 0, 1, 0, 3, 4) == pytest.approx(0.2)
    assert quantity(here, relations.ANGLE, 0, 1, 0, 2) == pytest.approx(90.0)
    assert quantity(here, relations.INCLINE, 0, 1) == pytest.approx(90.0)
    assert quantity(here, relations.HEIGHT, 3, 0b10000) == pytest.approx(0.7)
    assert quantity(here, relations.HEIGHT, 3, 0) == pytest.approx(0.9)
    assert quantity(here, relations.TALL) == pytest.approx(0.9)
    assert quantity(here, relations.WIDE, 0b00111) == pytest.approx(np.sqrt(2.0))


def test_a_speed_is_that_of_the_next_step_and_repeats_at_the_end() -> None:
    joints = np.zeros((3, 2, 3))
    joints[:, 0, 0] = 0.0, 0.1, 0.3
    joints[:, 1, 1] = 0.0, 0.5, 1.0
    assert [quantity(joints, relations.SPEED, 0, frame=k) for k in range(3)] == pytest.approx([1.0, 2.0, 2.0])
    assert quantity(joints, relations.SLOWER, 0, 1, frame=1) == pytest.approx(2.0)
    assert quantity(joints[:1], relations.SPEED, 0) == 0.0


def test_a_feature_stays_on_while_the_loose_test_holds() -> None:
    on, states = np.zeros(1, dtype=bool), []
    for value in (1.4, 1.6, 1.2, 0.9, 1.2):
        relations.push_tests(np.array([value]), np.array([relations.ABOVE]), np.array([1.0]), np.array([1.5]), on)
        states.append(bool(on[0]))
    assert states == [False, True, True, False, False]
