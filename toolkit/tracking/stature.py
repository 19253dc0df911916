"""How tall a person is: what is likely of people, what the floor says, and which of several sizes explains the frames.

Sizes are compared in metres, as poses are: so many millimetres nearer to the frame outweigh an unlikely stature.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from toolkit.body.body import Body
from toolkit.landmarks.cuts import CUT_PIXELS
from toolkit.sensing.cloud import Cloud

COST_PER_LOG_ODDS = 0.004
"""Metres of distance from a frame that are worth a natural unit of information about the size: those of neighbouring
sizes of a person who is cut at the waist differ by as much by chance."""
SIZE_COST_SPREAD = 0.03
"""Metres by which a frame may be nearer to a body of another size than the person's."""
HEAD_REACH, HIGHEST = 0.2, 5
"""Metres from the middle of a head, horizontally, within which its top is; and which of the highest points is taken for
it: noise is above."""


def stature_prior_cost(stature: float) -> float:
    """Metres of distance that a stature in metres costs, 0 for the likeliest."""
    # Metres: middle and spread of adults' statures; degrees of freedom of their Student's t, whose heavy tails hold
    # children.
    adults, spread, tails = 1.70, 0.09, 2.0
    away = (stature - adults) / spread
    return COST_PER_LOG_ODDS * 0.5 * (tails + 1.0) * math.log1p(away**2 / tails)


def off_floor(lowest: float, floor: float | None) -> float:
    """Cost, metres, of a body's lowest point at `lowest` above or below a floor at `floor`: both y, metres,
    level frame; nothing where no floor is known.
    """
    return 0.0 if floor is None else _missed_by(lowest - floor)


def too_small(stature: float, stood: float) -> float:
    """Cost, metres, of a stature whose head was seen at `stood` metres above the floor; nothing for the taller."""
    return _missed_by(max(stood - stature, 0.0))


def _missed_by(away: float) -> float:
    """Cost, metres, of a body that ends so many metres away from where the floor says that it does."""
    # Metres by which the soles of a right body miss the floor; natural units that they can say at most, for people
    # jump, kneel and sit.
    floor_sigma, floor_cap = 0.04, 4.0
    return COST_PER_LOG_ODDS * min(0.5 * (away / floor_sigma) ** 2, floor_cap)


def head_top(cloud: Cloud, head: np.ndarray) -> float:
    """Y of the top of a head whose middle is expected at `head` (3,): metres, level frame; NaN where nothing is
    measured there, or the image's border cuts the head off.
    """
    away = cloud.points[:, [0, 2]] - head[[0, 2]]
    near = np.flatnonzero((away**2).sum(axis=1) < HEAD_REACH**2)
    highest = near[np.argsort(cloud.points[near, 1], kind="stable")[-HIGHEST:]]
    (height, width), (rows, columns) = cloud.camera.shape, np.divmod(cloud.pixels[highest], cloud.camera.width)
    to_border = np.minimum(np.minimum(rows, height - 1 - rows), np.minimum(columns, width - 1 - columns))
    if len(highest) < HIGHEST or to_border.min() < CUT_PIXELS:
        return math.nan
    return float(cloud.points[highest[0], 1])


def height_stood(tops: np.ndarray, floor: float | None) -> float:
    """How high above the floor the top of a person's head was where they stood, metres; 0 where it is not known.

    `tops` (N,), of some frames, and `floor` are y, metres, level frame.
    """
    known = tops[np.isfinite(tops)]
    # Share of the frames in which a head is not higher than that of a person who stands: in the others there is
    # noise.
    standing = 0.75
    return 0.0 if floor is None or not len(known) else float(np.quantile(known, standing)) - floor


def statures_of(stood: float, likely: float) -> tuple[float, float]:
    """Least and largest stature, metres, of a person whose head `stood` so high and who is `likely` to be so tall; a
    person who sits may have any.
    """
    # Metres by which a likely stature may differ from the height of the head: nearer, the person stood, and it is the
    # stature; farther, they sat, or something hid the head.
    upright = 0.15
    # Metres by which a person who walks may be taller than the head is high: the knees are bent.
    bent_stature_spread = 0.04
    return (stood, stood + bent_stature_spread) if abs(likely - stood) < upright else (0.0, math.inf)


@dataclass(frozen=True)
class StatureBelief:
    """How likely each of several bodies is, given the frames so far.

    Attributes
    ----------
    bodies : of different statures
    costs : float64 (B,), metres, the sum over the frames of what each costs
    frames : how many frames that is
    stood : metres above the floor at which the top of the head was, see `height_stood`
    """

    bodies: tuple[Body, ...]
    costs: np.ndarray
    frames: int = 0
    stood: float = 0.0

    @classmethod
    def of(cls, bodies: tuple[Body, ...], stood: float = 0.0) -> StatureBelief:
        """Before the first frame."""
        return cls(bodies, np.zeros(len(bodies)), stood=stood)

    def narrowed(self, costs: Mapping[int, float]) -> StatureBelief:
        """After a frame in which these bodies, by number, lay so far from it; those that were not tried are as bad as
        the worst.
        """
        worst = max(costs.values(), default=0.0)
        frame = np.array([costs.get(number, worst) for number in range(len(self.bodies))])
        return replace(self, costs=self.costs + frame, frames=self.frames + 1)

    @property
    def shares(self) -> np.ndarray:
        """Float64 (B,): probability of each body; a frame tells as much as all, for their errors are the same ones."""
        statures = [stature_prior_cost(body.height) + too_small(body.height, self.stood) for body in self.bodies]
        mean = self.costs / max(self.frames, 1) + np.array(statures)
        weights = np.exp(-(mean - mean.min()) / COST_PER_LOG_ODDS)
        return np.asarray(weights / weights.sum())

    @property
    def shape(self) -> np.ndarray:
        """Float64 (K,): shape coefficients, the mean over the likely bodies."""
        return np.asarray(sum(share * body.shape for share, body in zip(self.shares, self.bodies, strict=True)))

    @property
    def possible(self) -> tuple[int, ...]:
        """Numbers of the bodies that are worth trying again: one frame may mislead by `SIZE_COST_SPREAD`."""
        mean = self.costs / max(self.frames, 1)
        return tuple(np.flatnonzero(mean <= mean.min() + SIZE_COST_SPREAD).tolist())

    @property
    def likely(self) -> tuple[int, ...]:
        """Numbers of the bodies that are at least a tenth as likely as the likeliest, that one first."""
        shares = self.shares
        order = np.argsort(-shares, kind="stable")
        return tuple(order[shares[order] >= 0.1 * shares.max()].tolist())
