"""Priors on the pose itself: what is likely before a frame is looked at, as quadratics in the pose vector."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.body import skeleton
from toolkit.fitting.placed import NormalSystem
from toolkit.kernels import linear


class PoseTerm(Protocol):
    """A term in the pose vector itself; called after `system.assemble`."""

    def add(self, system: NormalSystem, pose: np.ndarray) -> None:
        """Add this term's quadratic in the pose."""

    def energy(self, pose: np.ndarray) -> float:
        """What the term costs at `pose` (P,), at least 0."""


SPREAD = 0.1
"""Radians: spread that the pose prior adds to every angle."""


@dataclass(frozen=True)
class GaussianPrior:
    """Joint angles near a mean: `1/2 weight (pose - mean)' precision (pose - mean)` over the entries after the root's.

    mean : float64 (P,), radians; precision : float64 (P - 6, P - 6)
    """

    weight: float
    mean: np.ndarray
    precision: np.ndarray

    @classmethod
    def of_poses(cls, poses: np.ndarray, weight: float) -> GaussianPrior:
        """The prior of a sample of poses (N, P); `SPREAD` keeps angles that it never moves from being frozen."""
        angles = np.asarray(poses, dtype=np.float64)[:, 6:]
        mean, covariance = linear.moments(angles)
        precision = linear.inverse(covariance + SPREAD**2 * np.eye(angles.shape[1]))
        return cls(weight, np.concatenate([np.zeros(6), mean]), precision)

    def add(self, system: NormalSystem, pose: np.ndarray) -> None:
        """See `PoseTerm.add`."""
        free = slice(6, skeleton.POSE_SIZE)
        system.matrix[free, free] += self.weight * self.precision
        system.vector[free] += self.weight * linear.times(self.precision, pose[free] - self.mean[free])

    def energy(self, pose: np.ndarray) -> float:
        """See `PoseTerm.energy`."""
        away = (pose - self.mean)[6:]
        return 0.5 * self.weight * linear.dot(away, linear.times(self.precision, away))


@dataclass(frozen=True, eq=False)
class LimbPrior:
    """Some angles near a mean, each by its own: `1/2 weight sum (angle - mean)^2 / variance` (after thesis 6.4.3).

    entries : int64 (A,), where the angles stand in a pose; mean, variance : float64 (A,), radians and their square
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
