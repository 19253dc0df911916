"""Arms of many particles brought to where hands may be, compiled (Lopez-Mendez 2011, Eq. 4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from toolkit.kernels.fit.swivel import ArmBones, solve_arm
from toolkit.kernels.kinematics import forward_kinematics, rotation_from_vector


class ArmRig(NamedTuple):
    """One arm in the kinematic chain of a body.

    parents, rest, dof_joint, dof_axis : of the whole chain, as in `kinematics.forward_kinematics`
    clavicle, shoulder, elbow, wrist : joints
    shoulder_entry, elbow_entry : where the shoulder's rotation vector and the elbow's angle stand in a pose
    bones : the arm as inverse kinematics needs it
    fore : float64 (3,), wrist from elbow in the rest pose; hand : float64 (3,), the hand's place from the wrist
    """

    parents: np.ndarray
    rest: np.ndarray
    dof_joint: np.ndarray
    dof_axis: np.ndarray
    clavicle: int
    shoulder: int
    elbow: int
    wrist: int
    shoulder_entry: int
    elbow_entry: int
    bones: ArmBones
    fore: np.ndarray
    hand: np.ndarray


class Aim(NamedTuple):
    """What a hand's place is worth (Eq. 4): spread in metres (`Sigma_e`), `lambda`, and the least log-probability."""

    spread: float
    smoothness: float
    least: float


@njit(cache=True)
def place_hands(poses: np.ndarray, arm: ArmRig, hands: np.ndarray) -> None:
    """Where every pose (N, P) has its hand (`F(x)`): fills `hands` (N, 3), metres, frame of the poses."""
    joints = arm.parents.shape[0]
    vectors, origins, rotations = np.empty((joints, 3)), np.empty((joints, 3)), np.empty((joints, 3, 3))
    for n in range(poses.shape[0]):
        forward_kinematics(poses[n], arm.parents, arm.rest, arm.dof_joint, arm.dof_axis, vectors, rotations, origins)
        r = rotations[arm.wrist]
        for a in range(3):
            reach = r[a, 0] * arm.hand[0] + r[a, 1] * arm.hand[1] + r[a, 2] * arm.hand[2]
            hands[n, a] = origins[arm.wrist, a] + reach


@njit(cache=True)
def aim_arms(
    poses: np.ndarray,
    arm: ArmRig,
    wanted: np.ndarray,
    targets: np.ndarray,
    swivels: np.ndarray,
    aim: Aim,
    scores: np.ndarray,
) -> None:
    """Bring the arms of the `wanted` (N,) among `poses` (N, P) to their `targets` (N, 3), frame of the poses, in place.

    `swivels` (N,) are radians from the swivel that is nearest to the pose before. `scores` (N,) receives the
    log-probability of each answer (Eq. 4); an answer below `aim.least` is refused, its score is minus infinity and its
    pose stays, as it does where none is wanted.
    """
    joints = arm.parents.shape[0]
    vectors, origins, rotations = np.empty((joints, 3)), np.empty((joints, 3)), np.empty((joints, 3, 3))
    bend, fore, target, angles = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(4)
    for n in range(poses.shape[0]):
        scores[n] = -np.inf
        if not wanted[n]:
            continue
        forward_kinematics(poses[n], arm.parents, arm.rest, arm.dof_joint, arm.dof_axis, vectors, rotations, origins)
        rotation_from_vector(vectors[arm.wrist, 0], vectors[arm.wrist, 1], vectors[arm.wrist, 2], bend)
        carrier = rotations[arm.clavicle]
        for a in range(3):
            fore[a] = arm.fore[a] + bend[a, 0] * arm.hand[0] + bend[a, 1] * arm.hand[1] + bend[a, 2] * arm.hand[2]
            target[a] = 0.0
            for b in range(3):
                target[a] += carrier[b, a] * (targets[n, b] - origins[arm.shoulder, b])
            angles[a] = poses[n, arm.shoulder_entry + a]
        angles[3] = poses[n, arm.elbow_entry]
        missed = solve_arm(arm.bones, fore, target, swivels[n], angles)
        if missed == np.inf:
            continue
        moved = (angles[3] - poses[n, arm.elbow_entry]) ** 2
        for a in range(3):
            moved += (angles[a] - poses[n, arm.shoulder_entry + a]) ** 2
        score = -0.5 * (missed / aim.spread) ** 2 - 0.5 * aim.smoothness * moved
        if score < aim.least:
            continue
        scores[n] = score
        for a in range(3):
            poses[n, arm.shoulder_entry + a] = angles[a]
        poses[n, arm.elbow_entry] = angles[3]
