"""The first pose of an upper body from the candidates for head and hands (Lopez-Mendez 2011, 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.database import canonical
from toolkit.fitting.arms import SIDES
from toolkit.io.errors import SettingsError
from toolkit.kernels import linear
from toolkit.kernels.fit import aiming
from toolkit.trackers.lopez2011.costs import ParticleFrame, costs_of_both_arms, costs_of_whole, mean_cost
from toolkit.trackers.lopez2011.effectors import Effectors, Fork
from toolkit.trackers.lopez2011.filter import UpperFilter
from toolkit.trackers.lopez2011.proposals import SPREAD
from toolkit.trackers.lopez2011.upper import UpperBody, aimed_all_round

HANGING = 1.1
"""Radians by which the arms hang down from the T-pose before they are aimed."""
FRAME_TIME = 1.0 / 30.0
"""Seconds of diffusion in each round on the first frame."""
HEADS = 3
"""Candidates that may be the head where no fork says which one is: raised hands are above it."""
TURNS = (-0.6, 0.0, 0.6)
"""Radians by which a person may be turned away from the camera, where no fork says that they face it."""
LEANS = (0.0, 0.35, 0.7)
"""Radians by which a person may lean forward."""
ARMED = 6
"""Trunks to which arms are given, out of all that were tried."""
FILTERED = 2
"""Starts that are filtered: the cheapest one may be a hand taken for the head."""
LIFTS, BENDS = (-HANGING, -0.5, 0.2, 1.0), (0.0, 0.6)
"""Radians from the T-pose, and shares of the elbow's range, of arms that need no candidate: hidden or cut-off hands."""

SWIVELS = 24
"""Swivels of each arm that are tried: 15 degrees apart."""


@dataclass(frozen=True)
class InitialSettings:
    """How a first pose is found.

    Attributes
    ----------
    rounds : times that the first frame is filtered: trunk and size are rough at first
    unlabelled : whether a person is looked for without the fork too, with one of the highest places as head: hands that
        are cut off or hidden make no fork, and shoulders may make one
    """

    rounds: int = 10
    unlabelled: bool = True

    def __post_init__(self) -> None:
        if self.rounds < 0:
            raise SettingsError(f"initial.rounds is {self.rounds}; it is a number of times and not negative")


@dataclass(frozen=True, eq=False)
class InitialPoseEstimator:
    """A first pose (P,), level frame, its particles (N, P), and its log-probability (Eq. 7)."""

    pose: np.ndarray
    particles: np.ndarray
    score: float


class InitialPose(NamedTuple):
    """A pose (P,), and where its crown, and perhaps left and right hand, ought to be: (1, 3) or (3, 3), level frame."""

    pose: np.ndarray
    wanted: np.ndarray


def standing_pose(upper: UpperBody, head: np.ndarray, turned: float = 0.0, leaning: float = 0.0) -> np.ndarray:
    """A person upright, arms hanging, with the crown at `head` (3,): pose (P,), level frame.

    They face the camera, but for `turned` radians to their left, and lean forward by `leaning` radians.
    """
    pose = np.zeros(skeleton.POSE_SIZE)
    yaw = math.atan2(-head[0], -head[2]) + turned
    pose[skeleton.ROOT_ROTATION] = Rotation.from_euler("xy", [leaning, yaw]).as_rotvec()
    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
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
) -> InitialPoseEstimator | None:
    """The model moved to the head, arms by inverse kinematics, filtered on the same frame, and its probability (Eq. 7).

    The places that the fork names are terms of Eq. 7, by their distances from crown and hands. Without a fork, and
    beside one, which may be of shoulders, each of the highest places may be the head of a person who is turned or leans
    somehow, and in the likeliest of these trunks an arm rests or reaches for any candidate of its own side. Poses that
    are far apart are compared over the whole image; the cheapest are filtered, and the cheapest of these is the answer.
    None if nothing may be tried.
    """
    starts = [] if fork is None else [_labelled(upper, effectors.points, fork, frame)]
    if settings.unlabelled:
        trunks = [(head, turn, lean) for head in _heads(effectors) for turn in TURNS for lean in LEANS]
        poses = np.stack([standing_pose(upper, *trunk) for trunk in trunks])
        costs = costs_of_whole(upper, poses, frame)
        starts += [
            unlabelled_start(upper, effectors.points, trunks[row][0], poses[row], frame)
            for row in np.argsort(costs, kind="stable")[:ARMED]
        ]
    if not starts:
        return None
    costs = costs_of_whole(upper, np.stack([start.pose for start in starts]), frame)
    cheapest = np.argsort(costs, kind="stable")[:FILTERED]
    found = [_filtered(upper, filtering, starts[row], frame, settings, rng) for row in cheapest]
    return found[int(np.argmin(costs_of_whole(upper, np.stack([first.pose for first in found]), frame)))]


def _heads(effectors: Effectors) -> np.ndarray:
    """Where the crown may be (K, 3): the highest candidates, and the highest point above the source."""
    points = effectors.points
    highest = points[np.argsort(-points[:, 1], kind="stable")[:HEADS]]
    return np.concatenate([highest, effectors.summit[None]])


def _filtered(
    upper: UpperBody, filtering: UpperFilter, start: InitialPose, frame: ParticleFrame, settings: InitialSettings,
    rng: np.random.Generator,
) -> InitialPoseEstimator:  # fmt: skip
    """The pose that a start leads to on the same frame."""
    pose, wanted = start
    labelled = frame._replace(candidates=wanted[1:]) if len(wanted) > 1 else frame
    particles = np.repeat(pose[None], filtering.settings.count, axis=0)
    for turn in range(settings.rounds):
        particles = filtering.trunk(upper, particles, pose, labelled, FRAME_TIME, rng)
        filtered = filtering.arms(upper, particles, pose, labelled, FRAME_TIME, filtering.first_arm(turn), rng)
        particles, pose = filtered.particles, filtered.estimate
    crown = upper.body.end_effector_positions(pose)[[skeleton.END_EFFECTORS.index("head")]]
    found = np.concatenate([crown, place_hands(upper, pose)])[: len(wanted)]
    missed = linear.lengths(found - wanted) / SPREAD
    return InitialPoseEstimator(pose, particles, -0.5 * float((missed**2).mean()) - mean_cost(upper, pose, frame))


def _labelled(upper: UpperBody, points: np.ndarray, fork: Fork, frame: ParticleFrame) -> InitialPose:
    """A pose with crown and hands where the fork names them."""
    wanted = points[[fork.head, fork.left_hand, fork.right_hand]]
    pose = standing_pose(upper, wanted[0])
    for side in range(2):
        pose = _best_arm(upper, pose, side, wanted[[1 + side]], frame, resting=False)
    return InitialPose(pose, wanted)


def unlabelled_start(
    upper: UpperBody, points: np.ndarray, head: np.ndarray, pose: np.ndarray, frame: ParticleFrame
) -> InitialPose:
    """A `pose` (P,) with the crown at `head` (3,) and arms that rest or reach for the candidates on their sides."""
    others = sides_of(points[(points != head).any(axis=1)], pose)
    for side in range(2):
        pose = _best_arm(upper, pose, side, others[side], frame, resting=True)
    return InitialPose(pose, head[None])


def sides_of(points: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) on the left and on the right of a person in a pose (P,), seen along the ground."""
    yaw = float(canonical.body_facing(pose))
    away = points - pose[skeleton.ROOT_POSITION]
    left = away[:, 0] * math.cos(yaw) - away[:, 2] * math.sin(yaw)
    return points[left > 0], points[left <= 0]


def place_hands(upper: UpperBody, pose: np.ndarray) -> np.ndarray:
    """Where a pose (P,) has its hands (`F(x)`), left and right: float64 (2, 3)."""
    hands = np.empty((2, 1, 3))
    for arm, hand in zip(upper.arms, hands, strict=True):
        aiming.place_hands(pose[None], arm, hand)
    return hands[:, 0]


def _best_arm(
    upper: UpperBody, pose: np.ndarray, side: int, targets: np.ndarray, frame: ParticleFrame, *, resting: bool
) -> np.ndarray:
    """The pose (P,) with the hand of one arm at one of `targets` (n, 3) at some swivel, whatever costs least.

    Arms that rest take part if they may; the arm as it is stays if no target can be reached.
    """
    anything = aiming.Aim(SPREAD, 0.0, -np.inf)
    poses, _ = aimed_all_round(pose, upper.arms[side], targets, SWIVELS, anything)
    if resting or len(poses) == 0:
        poses = np.concatenate([_rested(pose, side) if resting else pose[None], poses])
    return poses[int(costs_of_both_arms(upper, poses, frame).argmin())]


def _rested(pose: np.ndarray, side: int) -> np.ndarray:
    """The pose (P,) with one arm hanging, lifted or raised, straight or bent: float64 (n, P)."""
    lift = skeleton.POSE_NAMES.index(f"{SIDES[side]}_shoulder_rz")
    bend = skeleton.POSE_NAMES.index(f"{SIDES[side]}_elbow_ry")
    low, high = skeleton.POSE_LIMITS[bend]
    poses = np.repeat(pose[None], len(LIFTS) * len(BENDS), axis=0)
    poses[:, lift] = np.repeat((1.0, -1.0)[side] * np.array(LIFTS), len(BENDS))
    poses[:, bend] = np.tile((low if -low > high else high) * np.array(BENDS), len(LIFTS))
    return poses
