"""Stature of a person: prior of the population, evidence of the floor, and choice between sizes that explain the
frames.

Sizes are compared in metres, as poses are: a body that is some millimetres nearer to the frame outweighs an unlikely
stature.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.kernels import linear
from toolkit.landmarks.cuts import CUT_PIXELS
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.sensing.cloud import Cloud

COST_PER_LOG_ODDS = 0.004
"""Metres of distance from a frame per natural unit of information about the size: neighbouring sizes of a person
truncated at the waist differ by as much by chance.
"""
UPRIGHT = 0.15
"""Metres by which a stature may differ from the height of the head: if nearer, the person stood and this is the
stature; if farther, the person sat or was occluded.
"""


def stature_prior_cost(stature: float) -> float:
    """Return the prior cost of a stature in metres as distance in metres, 0 for the most likely."""
    # Metres: mean and spread of adults' statures; degrees of freedom of their Student's t, whose heavy tails
    # include children.
    adults, spread, tails = 1.70, 0.09, 2.0
    away = (stature - adults) / spread
    return COST_PER_LOG_ODDS * 0.5 * (tails + 1.0) * math.log1p(away**2 / tails)


def likeliest_size(bodies: Sequence[Body], estimate: JointEstimate | None) -> Body:
    """Return the body whose bones are as long as those between the estimated joints; the one of the most probable
    stature without an estimate.
    """
    if estimate is None:
        return min(bodies, key=lambda body: stature_prior_cost(body.height))
    first, second = skeleton.BONE_ROWS.T
    weights = estimate.reliability[first] * estimate.reliability[second]

    def total_length(joints: np.ndarray) -> float:
        return linear.dot(weights, linear.lengths(joints[first] - joints[second]))

    rest, seen = np.zeros(skeleton.POSE_SIZE), total_length(estimate.points)
    return min(bodies, key=lambda body: abs(total_length(body.joint_positions(rest)) - seen))


def off_floor(lowest: float, floor: float | None) -> float:
    """Return the cost, metres, of a body's lowest point at `lowest` with a floor at `floor`: both y, metres, level
    frame; 0 without a known floor.
    """
    return 0.0 if floor is None else _missed_by(lowest - floor)


def too_small(stature: float, stood: float) -> float:
    """Return the cost, metres, of a stature below the head's height `stood` above the floor; 0 for taller ones."""
    return _missed_by(max(stood - stature, 0.0))


def _missed_by(away: float) -> float:
    """Return the cost, metres, of a body whose lowest point is this many metres away from the floor."""
    # Metres by which the soles of a correct body miss the floor; maximum natural units of this evidence, because people
    # jump, kneel and sit.
    floor_sigma, floor_cap = 0.04, 4.0
    return COST_PER_LOG_ODDS * min(0.5 * (away / floor_sigma) ** 2, floor_cap)


def head_top(cloud: Cloud, head: np.ndarray) -> float:
    """Return y of the top of a head expected at `head` (3,): metres, level frame; NaN if nothing is measured there or
    the image border truncates the head.
    """
    away = cloud.points[:, [0, 2]] - head[[0, 2]]
    # Horizontal distance from the middle of a head to its top, metres; and the rank of the highest points that is
    # taken as the top: higher ones are noise.
    top_reach, top_rank = 0.2, 5
    near = np.flatnonzero((away**2).sum(axis=1) < top_reach**2)
    highest = near[np.argsort(cloud.points[near, 1], kind="stable")[-top_rank:]]
    (height, width), (rows, columns) = cloud.camera.shape, np.divmod(cloud.pixels[highest], cloud.camera.width)
    to_border = np.minimum(np.minimum(rows, height - 1 - rows), np.minimum(columns, width - 1 - columns))
    if len(highest) < top_rank or to_border.min() < CUT_PIXELS:
        return math.nan
    return float(cloud.points[highest[0], 1])


def height_stood(tops: np.ndarray, floor: float | None) -> float:
    """Return the standing height of the top of a person's head above the floor, metres; 0 if unknown.

    `tops` (N,), of some frames, and `floor` are y, metres, level frame.
    """
    known = tops[np.isfinite(tops)]
    # Fraction of the frames in which the head is not higher than that of a standing person: others are
    # noise.
    standing = 0.75
    return 0.0 if floor is None or not len(known) else float(np.quantile(known, standing)) - floor


def statures_of(stood: float, likely: float) -> tuple[float, float]:
    """Return the range of statures, metres, of a person whose head was at the height `stood` with the `likely` stature;
    a seated person may have any.
    """
    # Metres by which a walking person may be taller than the head's height: the knees are bent.
    bent_stature_spread = 0.04
    return (stood, stood + bent_stature_spread) if abs(likely - stood) < UPRIGHT else (0.0, math.inf)


def is_refuted(stature: float, stood: float) -> bool:
    """Return True if a stature is far below the head's height `stood` above the floor, both in metres."""
    return stood - stature > UPRIGHT


@dataclass(frozen=True)
class StatureBelief:
    """Probabilities of bodies of different statures, given the frames so far.

    Attributes
    ----------
    bodies : bodies of different statures
    costs : float64 (B,), metres, sum over the frames
    frames : number of these frames
    stood : metres above the floor at which the top of the head was, see `height_stood`
    """

    bodies: tuple[Body, ...]
    costs: np.ndarray
    frames: int = 0
    stood: float = 0.0

    @classmethod
    def of(cls, bodies: tuple[Body, ...], stood: float = 0.0) -> StatureBelief:
        """Return the belief before the first frame."""
        return cls(bodies, np.zeros(len(bodies)), stood=stood)

    def narrowed(self, costs: Mapping[int, float]) -> StatureBelief:
        """Return the belief after a frame with costs of bodies by number; untried ones get the largest cost."""
        worst = max(costs.values(), default=0.0)
        frame = np.array([costs.get(number, worst) for number in range(len(self.bodies))])
        return replace(self, costs=self.costs + frame, frames=self.frames + 1)

    @property
    def shares(self) -> np.ndarray:
        """Probability of each body, float64 (B,); the frames count as one because their errors are correlated."""
        statures = [stature_prior_cost(body.height) + too_small(body.height, self.stood) for body in self.bodies]
        mean = self.costs / max(self.frames, 1) + np.array(statures)
        weights = np.exp(-(mean - mean.min()) / COST_PER_LOG_ODDS)
        return np.asarray(weights / weights.sum())

    @property
    def shape(self) -> np.ndarray:
        """Shape coefficients, float64 (K,): the mean over the likely bodies."""
        return np.asarray(sum(share * body.shape for share, body in zip(self.shares, self.bodies, strict=True)))

    @property
    def possible(self) -> tuple[int, ...]:
        """Numbers of the bodies to try again: one frame may fit another size better than the person's."""
        spread = 0.03  # metres by which the mean cost of another size may be lower
        mean = self.costs / max(self.frames, 1)
        return tuple(np.flatnonzero(mean <= mean.min() + spread).tolist())

    @property
    def likely(self) -> tuple[int, ...]:
        """Numbers of the bodies with at least a tenth of the highest probability, the most likely first."""
        shares = self.shares
        order = np.argsort(-shares, kind="stable")
        return tuple(order[shares[order] >= 0.1 * shares.max()].tolist())
