"""First pose of an upper body from the candidates for head and hands (Lopez-Mendez 2011, 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.kernels import linear
from toolkit.kernels.fit import aiming
from toolkit.trackers.lopez2011.costs import ParticleFrame, costs_of, mean_cost
from toolkit.trackers.lopez2011.effectors import Effectors, Fork
from toolkit.trackers.lopez2011.filter import SPREAD
from toolkit.trackers.lopez2011.upper import UpperBody, aimed_all_round


@dataclass(frozen=True, eq=False)
class InitialPose:
    """First pose (P,), level frame, and its log-probability (Eq. 7)."""

    pose: np.ndarray
    score: float


def standing_pose(upper: UpperBody, head: np.ndarray) -> np.ndarray:
    """Return the pose (P,) of an upright person with hanging arms and the crown at `head` (3,), level frame.

    The person faces the camera.
    """
    from scipy.spatial.transform import Rotation

    hanging = 1.1  # angle of hanging arms from the T-pose before inverse kinematics, radians
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[skeleton.ROOT_ROTATION] = Rotation.from_euler("y", math.atan2(-head[0], -head[2])).as_rotvec()
    for side, sign in zip(skeleton.SIDES, (-1.0, 1.0), strict=True):
        pose[skeleton.POSE_NAMES.index(f"{side}_shoulder_rz")] = sign * hanging
    pose[skeleton.ROOT_POSITION] = head - crown_of(upper, pose)
    return pose


def crown_of(upper: UpperBody, pose: np.ndarray) -> np.ndarray:
    """Return the crown (3,) of a pose (P,), level frame."""
    return upper.body.end_effector_positions(pose)[skeleton.END_EFFECTORS.index("head")]


def initial_pose(upper: UpperBody, effectors: Effectors, fork: Fork, frame: ParticleFrame) -> InitialPose:
    """Return the first pose: model at the head, arms by inverse kinematics, with its score (Eq. 7)."""
    wanted = effectors.points[[fork.head, fork.left_hand, fork.right_hand]]
    pose = standing_pose(upper, wanted[0])
    for side in range(2):
        pose = _best_arm(upper, pose, side, wanted[[1 + side]], frame)
    found = np.concatenate([crown_of(upper, pose)[None], place_hands(upper, pose)])
    missed = linear.lengths(found - wanted) / SPREAD
    return InitialPose(pose, -0.5 * float((missed**2).mean()) - mean_cost(upper, pose, frame))


def place_hands(upper: UpperBody, pose: np.ndarray) -> np.ndarray:
    """Return the positions of left and right hand in a pose (P,) (`F(x)`): float64 (2, 3)."""
    hands = np.empty((2, 1, 3))
    for arm, hand in zip(upper.arms, hands, strict=True):
        aiming.place_hands(pose[None], arm, hand)
    return hands[:, 0]


def _best_arm(upper: UpperBody, pose: np.ndarray, side: int, target: np.ndarray, frame: ParticleFrame) -> np.ndarray:
    """Return the pose (P,) with the hand of one arm at a target (1, 3), at the swivel with the lowest cost.

    The arm is unchanged if the target cannot be reached.
    """
    anything = aiming.Aim(SPREAD, 0.0, -np.inf)
    swivels = 24  # number of swivels of an arm (15 degrees apart)
    poses = aimed_all_round(pose, upper.arms[side], target, swivels, anything)
    return poses[int(costs_of(upper, poses, frame).argmin())] if len(poses) else pose
