"""Occluded limbs: their estimate by the pose prior, and its uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import BELOW
from toolkit.database.prior import HEIGHT, SIZE, PosePrior, variables
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.orientation import OrientationTerm
from toolkit.fitting.placed import PlacedBody
from toolkit.fitting.terms import CARRIERS, carried


@dataclass(frozen=True, eq=False)
class Guess:
    """Pose whose unobserved angles were inferred from the prior.

    Attributes
    ----------
    pose : float64 (P,), level frame
    spread : float64 (20,), metres: standard deviation, in each direction, of the inferred reported joints;
        0 for all others
    """

    pose: np.ndarray
    spread: np.ndarray

    @property
    def observed(self) -> np.ndarray:
        """Reported joints that were not inferred: bool (20,)."""
        return self.spread == 0.0


class OccludedLimbs:
    """Estimator of occluded limbs that prevents jumps.

    Without observation the pose term of the fit alone moves a limb, to its expectation given the rest of the body. A
    pose that was retrieved for the rest has no better estimate.

    Parameters
    ----------
    prior : mixture of poses: the uncertainty of these limbs, given the rest
    """

    def __init__(self, prior: PosePrior) -> None:
        self._prior = prior

    def guess(self, pose: np.ndarray, seen: Comparison, objective: Objective, before: np.ndarray | None) -> Guess:
        """Return a pose (P,) with its unobserved limbs, and their uncertainty.

        Parameters
        ----------
        seen : comparison of the pose with the frame by `objective`
        before : pose (P,) of the frame before, whose unobserved limbs stay; None where the pose itself goes on from it,
            or where there is none
        """
        nothing = Guess(pose, np.zeros(len(skeleton.REPORTED)))
        placed, scene = seen.placed, seen.scene
        if placed is None or scene is None or any(isinstance(known, OrientationTerm) for known in scene.evidence):
            return nothing
        hidden = unobserved_joints(placed, seen.observed)
        if scene.withheld is not None:
            hidden |= scene.withheld
        entries = np.flatnonzero(hidden[skeleton.DOF_JOINT[3:]])
        if not len(entries):
            return nothing
        if before is not None:
            pose = pose.copy()
            pose[6 + entries] = before[6 + entries]
            placed = objective.placer.place(placed.body, pose)
        known = np.ones(SIZE, dtype=np.bool_)
        known[entries] = known[HEIGHT] = False
        count = len(entries)
        covariance = self._prior.expected(variables(pose, placed.body), known).covariance[:count, :count]
        return Guess(pose, spread_of_joints(placed, entries, covariance))


def unobserved_joints(placed: PlacedBody, observed: np.ndarray) -> np.ndarray:
    """Return the unobserved joints: almost no measurement at and below them: bool (18,).

    `observed` : float64 (C,), 1 for chosen vertices that lie where something was observed, else 0
    """
    part = placed.body.part[placed.placer.chosen]
    counts, seen = (np.bincount(part, weights, len(skeleton.JOINTS)) for weights in (None, observed))
    least_observed = 0.15  # fraction of the chosen vertices at and below a joint for which its angles are observed
    hidden = np.asarray((BELOW * seen).sum(axis=1) < least_observed * (BELOW * counts).sum(axis=1))
    hidden[0] = False
    return hidden


def spread_of_joints(placed: PlacedBody, entries: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the uncertainty of reported joints from the covariance of angles.

    Parameters
    ----------
    entries : int64 (B,), angles, as entries of `pose[6:]`
    covariance : float64 (B, B), radians squared

    Returns
    -------
    float64 (20,), metres: standard deviation in each direction, to first order; 0 of derived joints
    """
    out = np.zeros(len(skeleton.REPORTED))
    joints = skeleton.DOF_JOINT[3 + entries]
    for row, (carrier, site) in enumerate(CARRIERS):
        if carrier < 0:
            continue
        moves = np.flatnonzero(BELOW[joints, carrier])
        point = carried(placed, carrier, site)
        axes, (x, y, z) = placed.axes[3 + entries[moves]].T, (point - placed.origins[joints[moves]]).T
        levers = np.stack([axes[1] * z - axes[2] * y, axes[2] * x - axes[0] * z, axes[0] * y - axes[1] * x], axis=1)
        products = (levers[:, None] * levers[None]).sum(axis=2)
        out[row] = math.sqrt(max(float((covariance[np.ix_(moves, moves)] * products).sum()) / 3.0, 0.0))
    return out
