"""Inverse kinematics of an arm against the forward kinematics of the body."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.kernels.fit.swivel import ArmBones, solve_arm

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
