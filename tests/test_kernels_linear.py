"""Linear algebra in a fixed order, equal at all memory alignments; inverse kinematics of an arm."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.kernels import linear
from toolkit.kernels.fit.swivel import ArmBones, solve_arm

RNG = np.random.default_rng(5)


def shifted(array: np.ndarray, offset: int) -> np.ndarray:
    """Return a copy that begins `offset` bytes after a multiple of 64."""
    memory = np.empty(array.nbytes + 128, dtype=np.uint8)
    start = -memory.ctypes.data % 64 + offset
    copy = memory[start : start + array.nbytes].view(array.dtype).reshape(array.shape)
    copy[:] = array
    return copy


def definite(size: int, rng: np.random.Generator) -> np.ndarray:
    root = rng.normal(size=(size, size))
    return root @ root.T + np.eye(size)


@pytest.mark.parametrize(
    ("function", "reference", "shapes"),
    [
        (linear.rotated, np.matmul, [(50, 3), (3, 3)]),
        (linear.times, np.matmul, [(20, 37), (37,)]),
        (linear.combined, lambda w, r: np.tensordot(w, r, axes=1), [(16,), (16, 30, 3)]),
        (linear.dot, np.dot, [(37,), (37,)]),
        (linear.lengths, lambda v: np.linalg.norm(v, axis=1), [(50, 3)]),
        (linear.dots, lambda a, b: (a * b).sum(axis=1), [(50, 3), (50, 3)]),
        (linear.gram, lambda c, w: c.T @ np.diag(w) @ c, [(60, 16), (60,)]),
        (lambda r: linear.moments(r)[0], lambda r: r.mean(axis=0), [(60, 7)]),
        (lambda r: linear.moments(r)[1], lambda r: np.cov(r.T), [(60, 7)]),
    ],
)
def test_products_are_those_of_numpy_wherever_the_arrays_lie(
    function: Callable[..., np.ndarray], reference: Callable[..., np.ndarray], shapes: list[tuple[int, ...]]
) -> None:
    arrays = [RNG.normal(size=shape) for shape in shapes]
    found = np.asarray(function(*arrays))
    np.testing.assert_allclose(found, reference(*arrays), rtol=1e-12, atol=1e-13)
    for offset in (8, 16, 24, 40):
        assert np.asarray(function(*(shifted(array, offset) for array in arrays))).tobytes() == found.tobytes()


def test_points_of_any_shape_type_and_layout_are_rotated() -> None:
    points, rotation = RNG.normal(size=(2, 5, 3)).astype(np.float32), RNG.normal(size=(3, 3)).T
    expected = points.astype(np.float64) @ rotation
    np.testing.assert_allclose(linear.rotated(points, rotation), expected, rtol=1e-14)
    np.testing.assert_allclose(linear.rotated(points[:, ::2], rotation), expected[:, ::2], rtol=1e-14)
    np.testing.assert_allclose(linear.rotated(points[0, 0], rotation), expected[0, 0], rtol=1e-14)


@given(size=st.integers(1, 12), seed=st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_a_solution_solves_and_an_inverse_inverts(size: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, vector = definite(size, rng), rng.normal(size=size)
    np.testing.assert_allclose(matrix @ linear.solved(matrix, vector), vector, atol=1e-9)
    inverse = linear.inverse(matrix)
    np.testing.assert_allclose(matrix @ inverse, np.eye(size), atol=1e-9)
    assert (inverse == inverse.T).all()


def test_a_matrix_that_is_not_positive_definite_is_refused() -> None:
    with pytest.raises(ValueError, match="positive definite"):
        linear.solved(np.diag([1.0, -1.0]), np.ones(2))


@given(
    values=st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3),
    seed=st.integers(0, 1000),
    scale=st.sampled_from([1e-6, 1.0, 1e4]),
)
@settings(max_examples=60, deadline=None)
def test_principal_axes_are_orthonormal_and_give_the_matrix_back(values: list[float], seed: int, scale: float) -> None:
    frame = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    matrix = scale * frame @ np.diag(values) @ frame.T
    matrix = 0.5 * (matrix + matrix.T)
    found, axes = linear.principal_axes(matrix)
    assert (np.diff(found) >= 0.0).all()
    np.testing.assert_allclose(found, np.linalg.eigvalsh(matrix), atol=1e-13 * scale * 10)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-13)
    np.testing.assert_allclose(axes @ np.diag(found) @ axes.T, matrix, atol=1e-13 * scale * 10)


FREE = np.array([[-100.0, 100.0]] * 3)


def bones_of(side: str, shoulder_limits: np.ndarray | None = None) -> tuple[ArmBones, np.ndarray]:
    """Return the bones of an arm of the neutral body, and the hand from the elbow with a straight wrist."""
    body, joint = load_body(), skeleton.JOINT_NAMES.index
    shoulder, elbow, wrist = (body.joints[joint(f"{side}_{name}")] for name in ("shoulder", "elbow", "wrist"))
    entries = [skeleton.POSE_NAMES.index(f"{side}_{name}") for name in ("shoulder_rx", "elbow_ry")]
    limits = skeleton.POSE_LIMITS[entries[0] : entries[0] + 3] if shoulder_limits is None else shoulder_limits
    return ArmBones(elbow - shoulder, limits.copy(), skeleton.POSE_LIMITS[entries[1]].copy()), wrist - elbow


def hand_of(bones: ArmBones, fore: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Return the hand from the shoulder by forward kinematics."""
    elbow = Rotation.from_euler("y", arm[3])
    return Rotation.from_rotvec(arm[:3]).apply(bones.upper + elbow.apply(fore))


@given(seed=st.integers(0, 100_000), side=st.sampled_from(["left", "right"]))
@settings(max_examples=150, deadline=None)
def test_every_reachable_target_is_hit_at_every_swivel_and_bones_keep_their_lengths(seed: int, side: str) -> None:
    rng = np.random.default_rng(seed)
    bones, fore = bones_of(side, FREE)
    elbow = rng.uniform(*bones.elbow_limits)
    target = Rotation.random(random_state=seed).apply(bones.upper + Rotation.from_euler("y", elbow).apply(fore))
    arm = np.array([*rng.normal(0.0, 0.7, 3), rng.uniform(*bones.elbow_limits)])
    assert solve_arm(bones, fore, target, rng.uniform(-np.pi, np.pi), arm) < 1e-6
    np.testing.assert_allclose(hand_of(bones, fore, arm), target, atol=1e-6)
    assert bones.elbow_limits[0] <= arm[3] <= bones.elbow_limits[1]


def test_the_body_puts_its_wrist_where_the_arm_was_solved_for() -> None:
    body, joint = load_body(), skeleton.JOINT_NAMES.index
    bones, fore = bones_of("left")
    arm = np.array([0.2, -0.5, -0.6, -0.9])
    target = np.array([0.2, -0.1, 0.3])
    assert solve_arm(bones, fore, target, 0.2, arm) < 1e-6
    pose = np.zeros(skeleton.POSE_SIZE)
    entry = skeleton.POSE_NAMES.index("left_shoulder_rx")
    pose[entry : entry + 3] = arm[:3]
    pose[skeleton.POSE_NAMES.index("left_elbow_ry")] = arm[3]
    placed = body.place(pose)
    wrist = placed.origins[joint("left_wrist")] - placed.origins[joint("left_shoulder")]
    np.testing.assert_allclose(wrist, target, atol=1e-6)


def test_no_swivel_is_the_nearest_one_to_the_arm_before() -> None:
    bones, fore = bones_of("left", FREE)
    before = np.array([0.3, -0.4, -0.2, -0.7])
    target = np.array([0.1, 0.2, 0.35])

    def turned(swivel: float) -> float:
        arm = before.copy()
        solve_arm(bones, fore, target, swivel, arm)
        return float((Rotation.from_rotvec(arm[:3]) * Rotation.from_rotvec(before[:3]).inv()).magnitude())

    angles = np.linspace(-np.pi, np.pi, 73)
    assert turned(0.0) <= min(turned(angle) for angle in angles) + 1e-9


def test_beyond_reach_the_arm_points_at_the_target_and_returns_the_distance() -> None:
    bones, fore = bones_of("right", FREE)
    arm = np.array([0.1, 0.2, 0.3, 0.5])
    target = np.array([-2.0, 0.5, 1.0])
    missed = solve_arm(bones, fore, target, 0.4, arm)
    hand = hand_of(bones, fore, arm)
    reach = max(
        np.linalg.norm(bones.upper + Rotation.from_euler("y", e).apply(fore)) for e in np.linspace(-0.05, 1, 300)
    )
    assert missed == pytest.approx(np.linalg.norm(target) - reach, abs=1e-4)
    assert np.dot(hand, target) == pytest.approx(np.linalg.norm(hand) * np.linalg.norm(target))


def test_a_target_at_the_shoulder_bends_the_arm_and_leaves_its_swing() -> None:
    bones, fore = bones_of("left")
    arm = np.array([0.1, -0.2, 0.3, -0.5])
    missed = solve_arm(bones, fore, np.zeros(3), 1.0, arm)
    np.testing.assert_allclose(arm[:3], [0.1, -0.2, 0.3], atol=1e-12)
    assert missed == pytest.approx(np.linalg.norm(hand_of(bones, fore, arm)))


def test_an_arm_that_would_leave_its_limits_is_refused_and_left() -> None:
    bones, fore = bones_of("left", np.array([[-0.1, 0.1]] * 3))
    arm = np.array([0.0, 0.0, 0.0, -0.4])
    assert solve_arm(bones, fore, np.array([-0.3, 0.3, 0.0]), 0.0, arm) == np.inf
    assert arm.tolist() == [0.0, 0.0, 0.0, -0.4]


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("swivel", [0.0, 1.3])
def test_a_target_on_the_line_of_a_straight_arm_is_hit(side: str, swivel: float) -> None:
    bones, fore = bones_of(side, FREE)
    straight = hand_of(bones, fore, np.zeros(4))
    for target in (0.8 * straight, straight, -0.8 * straight, 0.8 * np.linalg.norm(straight) * np.eye(3)[1]):
        arm = np.zeros(4)
        assert solve_arm(bones, fore, target, swivel, arm) < 1e-6
        np.testing.assert_allclose(hand_of(bones, fore, arm), target, atol=1e-6)
