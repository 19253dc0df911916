"""First pose of an upper body from the candidates for head and hands (Lopez-Mendez 2011, 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.database import canonical
from toolkit.io.typed_values import Range
from toolkit.kernels import linear, quaternions
from toolkit.kernels.fit import aiming
from toolkit.trackers.lopez2011.costs import ParticleFrame, costs_of_both_arms, costs_of_whole, mean_cost
from toolkit.trackers.lopez2011.effectors import Effectors, Fork
from toolkit.trackers.lopez2011.filter import UpperFilter
from toolkit.trackers.lopez2011.proposals import SPREAD
from toolkit.trackers.lopez2011.upper import UpperBody, aimed_all_round

HANGING = 1.1
"""Angle of hanging arms from the T-pose before inverse kinematics, radians."""


@dataclass(frozen=True)
class InitialSettings:
    """Settings of the first pose.

    Attributes
    ----------
    rounds : number of filter rounds on the first frame; trunk and size are inaccurate at first
    unlabelled : also search without the fork, with the highest points as head; occluded or truncated hands form no
        fork, and shoulders may form a wrong one
    """

    rounds: Annotated[int, Range(0)] = 10
    unlabelled: bool = True


@dataclass(frozen=True, eq=False)
class InitialPose:
    """First pose (P,), level frame, its particles (N, P), and its log-probability (Eq. 7)."""

    pose: np.ndarray
    particles: np.ndarray
    score: float


class StartPose(NamedTuple):
    """Pose (P,) before inverse kinematics, and the targets of its crown and of no or both hands: (1 or 3, 3)."""

    pose: np.ndarray
    wanted: np.ndarray


def standing_pose(upper: UpperBody, head: np.ndarray, turned: float = 0.0, leaning: float = 0.0) -> np.ndarray:
    """Return the pose (P,) of an upright person with hanging arms and the crown at `head` (3,), level frame.

    The person faces the camera, turned by `turned` radians to their left, and leans forward by `leaning` radians.
    """
    pose = np.zeros(skeleton.POSE_SIZE)
    yaw = math.atan2(-head[0], -head[2]) + turned
    pose[skeleton.ROOT_ROTATION] = quaternions.leaning_and_turned(leaning, yaw)
    for side, sign in zip(skeleton.SIDES, (-1.0, 1.0), strict=True):
        pose[skeleton.POSE_NAMES.index(f"{side}_shoulder_rz")] = sign * HANGING
    crown = upper.body.end_effector_positions(pose)[skeleton.END_EFFECTORS.index("head")]
    pose[skeleton.ROOT_POSITION] = head - crown
    return pose


def initial_pose(
    upper: UpperBody,
    filtering: UpperFilter,
    effectors: Effectors,
    fork: Fork | None,
    frame: ParticleFrame,
    settings: InitialSettings,
    rng: np.random.Generator,
) -> InitialPose | None:
    """Return the first pose: model at the head, arms by inverse kinematics, filtered, with its score (Eq. 7).

    Crown and hands of the fork enter Eq. 7 by their distances. Independent of a fork, which may be one of shoulders,
    each of the highest points is tried as the head of a person with various angles and leans; the arms of the most
    probable trunks rest or reach for candidates on their side. Poses are compared over the whole image, the best are
    filtered, and the best result is returned. None if nothing can be tried.
    """
    starts = [] if fork is None else [_labelled(upper, effectors.points, fork, frame)]
    turns = (-0.6, 0.0, 0.6)  # angles of the body from the camera that are tried without a fork, radians
    leans = (0.0, 0.35, 0.7)  # forward leans that are tried, radians
    armed = 6  # number of trunks that get arms
    if settings.unlabelled:
        trunks = [(head, turn, lean) for head in _heads(effectors) for turn in turns for lean in leans]
        poses = np.stack([standing_pose(upper, *trunk) for trunk in trunks])
        costs = costs_of_whole(upper, poses, frame)
        starts += [
            unlabelled_start(upper, effectors.points, trunks[row][0], poses[row], frame)
            for row in np.argsort(costs, kind="stable")[:armed]
        ]
    if not starts:
        return None
    costs = costs_of_whole(upper, np.stack([start.pose for start in starts]), frame)
    filtered = 2  # number of filtered starts; the cheapest may have a hand in place of the head
    cheapest = np.argsort(costs, kind="stable")[:filtered]
    found = [_filtered(upper, filtering, starts[row], frame, settings, rng) for row in cheapest]
    return found[int(np.argmin(costs_of_whole(upper, np.stack([first.pose for first in found]), frame)))]


def _heads(effectors: Effectors) -> np.ndarray:
    """Return the possible crowns (K, 3): the highest candidates, and the highest point above the source."""
    points = effectors.points
    heads = 3  # number of head candidates without a fork; raised hands may be higher than the head
    highest = points[np.argsort(-points[:, 1], kind="stable")[:heads]]
    return np.concatenate([highest, effectors.summit[None]])


def _filtered(
    upper: UpperBody, filtering: UpperFilter, start: StartPose, frame: ParticleFrame, settings: InitialSettings,
    rng: np.random.Generator,
) -> InitialPose:  # fmt: skip
    """Return the filtered pose of a start on the same frame."""
    pose, wanted = start
    labelled = frame._replace(candidates=wanted[1:]) if len(wanted) > 1 else frame
    particles = np.repeat(pose[None], filtering.settings.count, axis=0)
    frame_time = 1.0 / 30.0  # diffusion time of each round on the first frame, seconds
    for turn in range(settings.rounds):
        particles = filtering.trunk(upper, particles, pose, labelled, frame_time, rng)
        filtered = filtering.arms(upper, particles, pose, labelled, frame_time, filtering.first_arm(turn), rng)
        particles, pose = filtered.particles, filtered.estimate
    crown = upper.body.end_effector_positions(pose)[[skeleton.END_EFFECTORS.index("head")]]
    found = np.concatenate([crown, place_hands(upper, pose)])[: len(wanted)]
    missed = linear.lengths(found - wanted) / SPREAD
    return InitialPose(pose, particles, -0.5 * float((missed**2).mean()) - mean_cost(upper, pose, frame))


def _labelled(upper: UpperBody, points: np.ndarray, fork: Fork, frame: ParticleFrame) -> StartPose:
    """Return a pose with crown and hands at the points of the fork."""
    wanted = points[[fork.head, fork.left_hand, fork.right_hand]]
    pose = standing_pose(upper, wanted[0])
    for side in range(2):
        pose = _best_arm(upper, pose, side, wanted[[1 + side]], frame, resting=False)
    return StartPose(pose, wanted)


def unlabelled_start(
    upper: UpperBody, points: np.ndarray, head: np.ndarray, pose: np.ndarray, frame: ParticleFrame
) -> StartPose:
    """Return a `pose` (P,) with the crown at `head` (3,) and arms that rest or reach for candidates on their sides."""
    others = sides_of(points[(points != head).any(axis=1)], pose)
    for side in range(2):
        pose = _best_arm(upper, pose, side, others[side], frame, resting=True)
    return StartPose(pose, head[None])


def sides_of(points: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split points (n, 3) into those left and right of a person in a pose (P,), in the ground plane."""
    yaw = float(canonical.body_facing(pose))
    away = points - pose[skeleton.ROOT_POSITION]
    left = away[:, 0] * math.cos(yaw) - away[:, 2] * math.sin(yaw)
    return points[left > 0], points[left <= 0]


def place_hands(upper: UpperBody, pose: np.ndarray) -> np.ndarray:
    """Return the positions of left and right hand in a pose (P,) (`F(x)`): float64 (2, 3)."""
    hands = np.empty((2, 1, 3))
    for arm, hand in zip(upper.arms, hands, strict=True):
        aiming.place_hands(pose[None], arm, hand)
    return hands[:, 0]


def _best_arm(
    upper: UpperBody, pose: np.ndarray, side: int, targets: np.ndarray, frame: ParticleFrame, *, resting: bool
) -> np.ndarray:
    """Return the pose (P,) with the hand of one arm at one of `targets` (n, 3) at the swivel with the lowest cost.

    Resting arms take part if allowed; the arm is unchanged if no target can be reached.
    """
    anything = aiming.Aim(SPREAD, 0.0, -np.inf)
    swivels = 24  # number of swivels of each arm (15 degrees apart)
    poses, _ = aimed_all_round(pose, upper.arms[side], targets, swivels, anything)
    if resting or len(poses) == 0:
        poses = np.concatenate([_rested(pose, side) if resting else pose[None], poses])
    return poses[int(costs_of_both_arms(upper, poses, frame).argmin())]


def _rested(pose: np.ndarray, side: int) -> np.ndarray:
    """Return the pose (P,) with one arm hanging, lifted or raised, straight or bent: float64 (n, P)."""
    lift = skeleton.POSE_NAMES.index(f"{skeleton.SIDES[side]}_shoulder_rz")
    bend = skeleton.POSE_NAMES.index(f"{skeleton.SIDES[side]}_elbow_ry")
    low, high = skeleton.POSE_LIMITS[bend]
    lifts = (-HANGING, -0.5, 0.2, 1.0)  # elevations from the T-pose of arms without a candidate, radians
    bends = (0.0, 0.6)  # fractions of the elbow's range of arms without a candidate
    poses = np.repeat(pose[None], len(lifts) * len(bends), axis=0)
    poses[:, lift] = np.repeat((1.0, -1.0)[side] * np.array(lifts), len(bends))
    poses[:, bend] = np.tile((low if -low > high else high) * np.array(bends), len(lifts))
    return poses
