"""Joints of the regressor as evidence: before the body is learnt, a fit may settle in a wrong size."""

from __future__ import annotations

import math

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import BELOW
from toolkit.fitting.placed import NormalSystem, PlacedBody
from toolkit.fitting.terms import CARRIERS, carried, pull
from toolkit.kernels import linear
from toolkit.landmarks.regressor import JointEstimate

SURE = 0.8
"""Reliability from which on a voted joint is evidence."""
WITHIN = 0.1
"""Metres: the reliability of a vote is the probability of an error below it; a pose within it costs nothing."""
CAP = 0.2
"""Metres that a joint is too far, at most: what `FittingSettings.unexplained` is for a point."""
OUT_OF_VIEW = 0.2
"""Probability of a joint to be in view below which it is taken to be out of it."""
SIGMA = 0.3
"""Metres too far at which a vote's pull has fallen to a quarter."""


class VotedJoints:
    """Joints that are surely within 10 cm of where the pixels vote for them.

    Parameters
    ----------
    votes : level frame
    rotation : R_level_camera, float64 (3, 3)
    weight : of one sure joint against one correspondence
    """

    def __init__(self, votes: JointEstimate, rotation: np.ndarray, weight: float) -> None:
        self._rows = [
            row for row, (carrier, _) in enumerate(CARRIERS) if carrier >= 0 and votes.reliability[row] >= SURE
        ]
        self._targets = linear.rotated(votes.points, rotation)
        self._weight = weight

    def attract(self, system: NormalSystem, placed: PlacedBody) -> None:
        """See `Evidence.attract`: joints are drawn to within 10 cm of their votes, and no nearer."""
        for row in self._rows:
            point, beyond = self._beyond(placed, row)
            if beyond.any():
                pull(system, CARRIERS[row][0], point, beyond, self._weight, SIGMA)

    def cost(self, placed: PlacedBody) -> float:
        """See `Evidence.cost`: by how much the sure joints are too far, on average."""
        if not self._rows:
            return 0.0
        return sum(min(math.hypot(*self._beyond(placed, row)[1]), CAP) for row in self._rows) / len(self._rows)

    def _beyond(self, placed: PlacedBody, row: int) -> tuple[np.ndarray, np.ndarray]:
        """A reported joint (3,), and by how much it is too far from its vote (3,), camera frame, metres."""
        point = carried(placed, *CARRIERS[row])
        away = point - self._targets[row]
        length = math.hypot(*away)
        return point, away * max(1.0 - WITHIN / max(length, WITHIN), 0.0)


def links_out_of_view(in_view: np.ndarray) -> np.ndarray:
    """Bool (18,): joints whose links and all that hangs below them end out of view, by the `in_view` (20,) of votes."""
    return np.asarray(((in_view < OUT_OF_VIEW) | ~_ENDS).all(axis=1))


def _end_of(carrier: int, site: int) -> int:
    """The joint whose link ends in a reported joint that stands in `CARRIERS` as this; -1 for derived ones."""
    return carrier if site >= 0 or carrier < 0 else int(skeleton.PARENTS[carrier])


_ENDS: np.ndarray = np.stack([BELOW[:, end] & (end >= 0) for end in (_end_of(*place) for place in CARRIERS)], axis=1)
"""Bool (18, 20): where the link of a joint, or one below it, ends in a reported joint; each has one."""
