"""Arms of many particles moved to hand candidates by inverse kinematics, compiled (Lopez-Mendez 2011, Eq. 4)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from toolkit.kernels.fit.swivel import ArmBones, solve_arm
from toolkit.kernels.kinematics import forward_kinematics, rotation_from_vector


class ArmRig(NamedTuple):
    """One arm in the kinematic chain of a body.

    parents, rest, dof_joint, dof_axis : those of the whole chain, as in `kinematics.forward_kinematics`
    clavicle, shoulder, elbow, wrist : joints
    shoulder_entry, elbow_entry : pose entries of the shoulder's rotation vector and of the elbow's angle
    bones : the arm as inverse kinematics needs it
    fore : float64 (3,), wrist from elbow in the rest pose; hand : float64 (3,), hand from wrist
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
    """Parameters of the score of a hand (Eq. 4): `Sigma_e` in metres, `lambda`, and minimum log-probability."""

    spread: float
    smoothness: float
    least: float


@njit(cache=True)
def place_hands(poses: np.ndarray, arm: ArmRig, hands: np.ndarray) -> None:
    """Compute the hand of each pose (N, P) (`F(x)`): fills `hands` (N, 3), metres, frame of the poses."""
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
    """Move the arms of the `wanted` (N,) among `poses` (N, P) to their `targets` (N, 3), frame of the poses, in place.

    `swivels` (N,) are radians from the swivel nearest to the previous pose. `scores` (N,) receives the log-probability
    of each result (Eq. 4); below `aim.least` the result is rejected: its score is minus infinity and the pose is
    unchanged, as for poses that are not wanted.
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
