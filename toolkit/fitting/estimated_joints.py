"""Evidence from estimated joints, which prevents a fit with a wrong body size before the body is estimated."""

from __future__ import annotations

import math

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import BELOW
from toolkit.fitting.placed import NormalSystem, PlacedBody
from toolkit.fitting.terms import CARRIERS, carried, pull
from toolkit.kernels import linear
from toolkit.landmarks.joint_network import JointEstimate

WITHIN = 0.1
"""Error for which the reliability of an estimate is defined, metres; a pose within it has no cost."""
CAP = 0.2
"""Maximum excess distance of a joint, metres, as `FittingSettings.unexplained` for a point."""
OUT_OF_VIEW = 0.2
"""Probability of being in view below which a joint counts as out of view."""


class EstimatedJoints:
    """Evidence that reliable joints lie within 10 cm of their estimates.

    Parameters
    ----------
    estimate : level frame
    rotation : R_level_camera, float64 (3, 3)
    weight : of one sure joint against one correspondence
    """

    def __init__(self, estimate: JointEstimate, rotation: np.ndarray, weight: float) -> None:
        sure = 0.8  # minimum reliability of an estimate that is used as evidence
        self._rows = [
            row for row, (carrier, _) in enumerate(CARRIERS) if carrier >= 0 and estimate.reliability[row] >= sure
        ]
        self._targets = linear.rotated(estimate.points, rotation)
        self._weight = weight

    def attract(self, system: NormalSystem, placed: PlacedBody) -> None:
        """See `FrameEvidence.attract`: joints are attracted to within 10 cm of their estimates."""
        sigma = 0.3  # scale of the Geman-McClure weight of the excess distance, metres
        for row in self._rows:
            point, beyond = self._beyond(placed, row)
            if beyond.any():
                pull(system, CARRIERS[row][0], point, beyond, self._weight, sigma)

    def cost(self, placed: PlacedBody) -> float:
        """See `FrameEvidence.cost`: mean excess distance of the reliable joints."""
        if not self._rows:
            return 0.0
        return sum(min(math.hypot(*self._beyond(placed, row)[1]), CAP) for row in self._rows) / len(self._rows)

    def _beyond(self, placed: PlacedBody, row: int) -> tuple[np.ndarray, np.ndarray]:
        """Return a reported joint (3,) and its excess vector from its estimate (3,), camera frame, metres."""
        point = carried(placed, *CARRIERS[row])
        away = point - self._targets[row]
        length = math.hypot(*away)
        return point, away * max(1.0 - WITHIN / max(length, WITHIN), 0.0)


def links_out_of_view(in_view: np.ndarray) -> np.ndarray:
    """Return joints whose links and all their descendants end out of view, bool (18,), by the `in_view` (20,) of
    estimates."""
    return np.asarray(((in_view < OUT_OF_VIEW) | ~_ENDS).all(axis=1))


def _end_of(carrier: int, site: int) -> int:
    """Return the joint whose link ends at a reported joint with this entry in `CARRIERS`; -1 for derived joints."""
    return carrier if site >= 0 or carrier < 0 else int(skeleton.PARENTS[carrier])


_ENDS: np.ndarray = np.stack([BELOW[:, end] & (end >= 0) for end in (_end_of(*place) for place in CARRIERS)], axis=1)
"""Bool (18, 20): True if the link of a joint, or of a descendant, ends at a reported joint; each joint has one."""
