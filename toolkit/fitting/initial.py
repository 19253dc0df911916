"""The first pose of an upper body, and its size, from the candidates for head and hands (Lopez-Mendez 2011, 3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.errors import SettingsError
from toolkit.fitting.arms import SIDES
from toolkit.fitting.particles import ParticleFrame, UpperFilter
from toolkit.fitting.upper import UpperBody, arm_of
from toolkit.kernels import aiming, linear
from toolkit.landmarks.effectors import Effectors, Fork

HANGING = 1.1
"""Radians by which the arms hang down from the T-pose before they are aimed."""
FRAME_TIME = 1.0 / 30.0
"""Seconds of diffusion in each round on the first frame."""
BREADTH_NOISE, ARM_NOISE = 0.04, 0.09
"""Metres: standard deviations of the two measurements of a person's size, as their medians over a take."""
FLESH = 0.02
"""Metres by which a silhouette is broader at the shoulders than the distance of their joints."""
HIDDEN = 0.10
"""Metres of an arm before the point at which its path bends, below the shoulder."""

HEADS = 3
"""Candidates that may be the head where no fork says which one is: raised hands are above it."""


@dataclass(frozen=True)
class InitialSettings:
    """How a first pose is found; the reasons stand beside the values in `configs/lopez2011.yaml`.

    Attributes
    ----------
    swivels : of each arm that are tried
    rounds : times that the first frame is filtered
    accepted : the first pose is taken if the log-probability of Eq. 7 is above this (`th`)
    unlabelled : whether a person without a fork is looked for too, with one of the highest candidates as head
    """

    swivels: int = 24
    rounds: int = 10
    accepted: float = -40.0
    unlabelled: bool = True

    def __post_init__(self) -> None:
        if self.swivels < 1 or self.rounds < 0:
            raise SettingsError(
                f"initial.swivels and rounds are {self.swivels} and {self.rounds}; give at least 1 and 0"
            )


@dataclass(frozen=True, eq=False)
class Initial:
    """A first pose (P,), level frame, its particles (N, P), and its log-probability (Eq. 7)."""

    pose: np.ndarray
    particles: np.ndarray
    score: float


def standing_pose(upper: UpperBody, head: np.ndarray) -> np.ndarray:
    """Somebody upright who faces the camera, arms hanging, with the crown at `head` (3,): pose (P,), level frame."""
    pose = np.zeros(skeleton.POSE_SIZE)
    yaw = math.atan2(-head[0], -head[2])
    pose[skeleton.ROOT_ROTATION] = [0.0, yaw, 0.0]
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
) -> Initial:
    """The model moved to the head, arms by inverse kinematics, filtered on the same frame, and its probability (Eq. 7).

    The places that the fork names are terms of Eq. 7, by their distances from crown and hands. Without a fork each of
    the highest candidates may be the head, and an arm hangs or reaches for any candidate of its own side; the cheapest
    pose is filtered.
    """
    points = effectors.points
    labelled = frame
    if fork is None:
        highest = np.argsort(-points[:, 1], kind="stable")[:HEADS]
        starts = [_guessed(upper, filtering, points, int(row), frame, settings.swivels) for row in highest]
        costs = [filtering.cost(upper, start, frame) for start in starts]
        best = int(np.argmin(costs))
        pose, wanted = starts[best], points[[highest[best]]]
    else:
        wanted = points[[fork.head, fork.left_hand, fork.right_hand]]
        labelled = frame._replace(candidates=wanted[1:])
        pose = standing_pose(upper, wanted[0])
        for side in range(2):
            targets = wanted[[1 + side]]
            pose = _best_arm(upper, filtering, pose, side, targets, frame, settings.swivels, hanging=False)
    particles = np.repeat(pose[None], filtering.settings.count, axis=0)
    for turn in range(settings.rounds):
        particles = filtering.trunk(upper, particles, pose, labelled, FRAME_TIME, rng)
        filtered = filtering.arms(upper, particles, pose, labelled, FRAME_TIME, turn % 2, rng)
        particles, pose = filtered.particles, filtered.estimate
    crown = upper.body.end_effector_positions(pose)[[skeleton.END_EFFECTORS.index("head")]]
    found = np.concatenate([crown, place_hands(upper, pose)])[: len(wanted)]
    missed = linear.lengths(found - wanted) / filtering.settings.spread
    return Initial(pose, particles, -0.5 * float((missed**2).mean()) - filtering.cost(upper, pose, frame))


def _guessed(
    upper: UpperBody, filtering: UpperFilter, points: np.ndarray, head: int, frame: ParticleFrame, swivels: int
) -> np.ndarray:
    """A pose (P,) with the crown at one of the candidates (M, 3) and arms that hang or reach for the others."""
    pose = standing_pose(upper, points[head])
    others = sides_of(np.delete(points, head, axis=0), pose)
    for side in range(2):
        pose = _best_arm(upper, filtering, pose, side, others[side], frame, swivels, hanging=True)
    return pose


def sides_of(points: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) on the left and on the right of somebody in a pose (P,), seen along the ground."""
    yaw = pose[skeleton.ROOT_ROTATION][1]
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
    upper: UpperBody, filtering: UpperFilter, pose: np.ndarray, side: int, targets: np.ndarray, frame: ParticleFrame,
    swivels: int, *, hanging: bool,
) -> np.ndarray:  # fmt: skip
    """The pose (P,) with the hand of one arm at one of `targets` (n, 3) at some swivel, whatever costs least.

    The arm as it is takes part if it may be `hanging`, and is kept if no target can be reached.
    """
    count = swivels * len(targets)
    poses, scores = np.repeat(pose[None], count, axis=0), np.empty(count)
    angles = np.tile(np.linspace(-np.pi, np.pi, swivels, endpoint=False), len(targets))
    anything = aiming.Aim(filtering.settings.spread, 0.0, -np.inf)
    wanted = np.ones(count, dtype=np.bool_)
    aiming.aim_arms(poses, upper.arms[side], wanted, np.repeat(targets, swivels, axis=0), angles, anything, scores)
    poses = np.concatenate([pose[None], poses[np.isfinite(scores)]])
    if not hanging and len(poses) > 1:
        poses = poses[1:]
    costs = filtering.costs_of_arm(upper, poses, side, frame._replace(candidates=targets))
    return poses[int(costs.argmin())]


def sized_body(breadths: Sequence[float], arms: Sequence[float]) -> Body | None:
    """The likeliest body of the shape space for measured shoulder breadths and arm lengths, metres; None without any.

    Both are linear in the coefficients to good approximation, and the coefficients are Gaussian: given the medians of
    the measurements, without outliers, the body is their conditional mean.
    """
    space = ShapeSpace.load()
    measured = [
        (_settled(values), noise, read)
        for values, noise, read in ((breadths, BREADTH_NOISE, _breadth), (arms, ARM_NOISE, _arm))
        if len(values)
    ]
    if not measured:
        return None
    mean = space.body()
    rows = [[read(space.body(unit)) - read(mean) for unit in np.eye(space.size)] for _, _, read in measured]
    change = np.array(rows)
    noise = np.diag([sigma**2 for _, sigma, _ in measured])
    away = np.array([value - read(mean) for value, _, read in measured])
    gain = linear.solved(linear.gram(change.T.copy(), np.ones(space.size)) + noise, away)
    return space.body(linear.combined(gain, change))


def _settled(values: Sequence[float]) -> float:
    """Mean of the values within one standard deviation of their median (Lopez-Mendez 2011, 3)."""
    array = np.array(values)
    near = np.abs(array - np.median(array)) <= array.std() + 1e-9
    return float(array[near].mean())


def _breadth(body: Body) -> float:
    left, right = (body.joints[skeleton.JOINT_NAMES.index(f"{side}_shoulder")] for side in SIDES)
    return float(left[0] - right[0]) + FLESH


def _arm(body: Body) -> float:
    arm = arm_of("left", body)
    return float(linear.lengths(np.stack([arm.bones.upper, arm.fore, arm.hand])).sum()) - HIDDEN
