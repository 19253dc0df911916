"""Pose priors as quadratics in the pose vector."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.fitting.placed import NormalSystem
from toolkit.kernels import linear
from toolkit.kernels.fit import twists


class PoseTerm(Protocol):
    """A term of the pose vector; called after `system.assemble`."""

    def add(self, system: NormalSystem, pose: np.ndarray) -> None:
        """Add the quadratic of this term."""

    def energy(self, pose: np.ndarray) -> float:
        """Return the cost of `pose` (P,), at least 0."""


@dataclass(frozen=True)
class GaussianPrior:
    """Gaussian prior on the joint angles: `1/2 weight (pose - mean)' precision (pose - mean)`, without the root.

    mean : float64 (P,), radians; precision : float64 (P - 6, P - 6)
    """

    weight: float
    mean: np.ndarray
    precision: np.ndarray

    @classmethod
    def of_poses(cls, poses: np.ndarray, weight: float) -> GaussianPrior:
        """Return the prior of a sample of poses (N, P)."""
        spread = 0.1  # radians, added to each angle, so that no variance is zero
        angles = np.asarray(poses, dtype=np.float64)[:, 6:]
        mean, covariance = linear.moments(angles)
        precision = linear.inverse(covariance + spread**2 * np.eye(angles.shape[1]))
        return cls(weight, np.concatenate([np.zeros(6), mean]), precision)

    def add(self, system: NormalSystem, pose: np.ndarray) -> None:
        """See `PoseTerm.add`."""
        twists.add_gaussian(system.matrix, system.vector, pose, self.mean, self.precision, self.weight)

    def energy(self, pose: np.ndarray) -> float:
        """See `PoseTerm.energy`."""
        away = (pose - self.mean)[6:]
        return 0.5 * self.weight * linear.dot(away, linear.times(self.precision, away))


@dataclass(frozen=True, eq=False)
class LimbPrior:
    """Independent Gaussian priors on some angles: `1/2 weight sum (angle - mean)^2 / variance` (after thesis 6.4.3).

    entries : int64 (A,), pose entries of the angles; mean, variance : float64 (A,), radians and their square
    """

    weight: float
    entries: np.ndarray
    mean: np.ndarray
    variance: np.ndarray

    def add(self, system: NormalSystem, pose: np.ndarray) -> None:
        """See `PoseTerm.add`."""
        precision = self.weight / self.variance
        system.matrix[self.entries, self.entries] += precision
        system.vector[self.entries] += precision * (pose[self.entries] - self.mean)

    def energy(self, pose: np.ndarray) -> float:
        """See `PoseTerm.energy`."""
        return 0.5 * self.weight * float(((pose[self.entries] - self.mean) ** 2 / self.variance).sum())


@dataclass(frozen=True, eq=False)
class ResidualTerm:
    """Robust residuals of the pose: `1/2 weight sigma^2 sum r^2 / (sigma^2 + r^2)` (Geman-McClure).

    They are linearised by finite differences over `entries`; the other entries are constant.

    weight : weight of a residual relative to one correspondence; sigma : metres; entries : int64 (A,)
    residuals : from a pose (P,) to float64 (R,), metres
    """

    weight: float
    sigma: float
    entries: np.ndarray
    residuals: Callable[[np.ndarray], np.ndarray]

    def violation(self, pose: np.ndarray) -> float:
        """Return the robust sum of the residuals of `pose` (P,), between 0 and their number."""
        square = (self.residuals(pose) / self.sigma) ** 2
        return float((square / (1.0 + square)).sum())

    def add(self, system: NormalSystem, pose: np.ndarray) -> None:
        """See `PoseTerm.add`."""
        here = self.residuals(pose)
        if not here.any():
            return
        slopes = np.empty((len(self.entries), len(here)))
        step = 1e-5  # step of finite differences, radians
        for row, entry in enumerate(self.entries):
            moved = pose.copy()
            moved[entry] += step
            slopes[row] = (self.residuals(moved) - here) / step
        robust = self.weight / (1.0 + (here / self.sigma) ** 2) ** 2
        system.vector[self.entries] += (slopes * robust * here).sum(axis=1)
        system.matrix[np.ix_(self.entries, self.entries)] += (slopes[:, None] * slopes[None] * robust).sum(axis=2)

    def energy(self, pose: np.ndarray) -> float:
        """See `PoseTerm.energy`."""
        return 0.5 * self.weight * self.sigma**2 * self.violation(pose)
