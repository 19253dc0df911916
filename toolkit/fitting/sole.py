"""Feet that rest on the floor: points of the sole on its plane, and where the foot came to rest (thesis, Eq. 6.7)."""

from __future__ import annotations

import numpy as np

from toolkit.body.body import Body
from toolkit.body.sole import Sole
from toolkit.fitting.priors import ResidualTerm


def floor_term(
    body: Body, leg: str, entries: np.ndarray, height: float, rest: np.ndarray | None, weight: float, sigma: float
) -> ResidualTerm:
    """The sole of a foot on the floor: both points pulled down or up to it, and to where they came to rest.

    Parameters
    ----------
    body : whose foot it is
    leg, entries : `left_leg` or `right_leg`, and where the angles stand in a pose that may give way
    height : metres, y of the floor under the foot, level frame
    rest : float64 (2, 3), where heel and ball rest, of which x and z count; None where that is not known
    weight, sigma : see `ResidualTerm`
    """
    sole = Sole.of(body, leg)

    def residuals(pose: np.ndarray) -> np.ndarray:
        points = sole.at(body, pose)
        above = points[:, 1] - height
        return above if rest is None else np.concatenate([above, (points - rest)[:, [0, 2]].ravel()])

    return ResidualTerm(weight, sigma, entries, residuals)
