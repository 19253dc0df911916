"""Residual terms of the local optimisation; each adds its quadratic to the normal equations and knows no loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.body import skeleton
from toolkit.fitting.posed import NormalSystem, PosedBody
from toolkit.fitting.scene import Scene
from toolkit.kernels import pairs


class PairTerm(Protocol):
    """A term made of point pairs; called between `system.reset` and `system.assemble`."""

    def add(self, system: NormalSystem, posed: PosedBody, scene: Scene) -> None:
        """Add this term's pairs for the body as it is placed now."""


class PoseTerm(Protocol):
    """A term in the pose vector itself; called after `system.assemble`."""

    def add(self, system: NormalSystem, pose: np.ndarray) -> None:
        """Add this term's quadratic in the pose."""


@dataclass(frozen=True)
class SurfaceTerm:
    """Visible chosen vertices to the median of their nearest measured points (Baak 2013, 5.4.1).

    Vertices that face away or are hidden behind the body get no correspondence.
    """

    reach: float
    neighbours: int
    sigma: float
    plane: float
    point: float
    facing: float
    tolerance: float

    def add(self, system: NormalSystem, posed: PosedBody, scene: Scene) -> None:
        """See `PairTerm.add`."""
        visible = posed.find_visible(self.facing, self.tolerance)
        points = posed.vertices[posed.chosen]
        targets = np.empty_like(points)
        scene.neighbours.medians(points, visible, self.reach, self.neighbours, targets)
        pairs.add_surface_pairs(
            posed.chosen, targets, np.ones(len(points)), posed.vertices, posed.normals,
            posed.body.skin_joints, posed.body.skin_weights, system.reference,
            self.sigma, self.plane, self.point, system.hessian, system.gradient,
        )  # fmt: skip


@dataclass(frozen=True)
class CloudTerm:
    """Measured samples to the nearest visible point of the drawn body; extrema count `extremum_weight` times."""

    reach: float
    sigma: float
    plane: float
    point: float
    extremum_weight: float

    def add(self, system: NormalSystem, posed: PosedBody, scene: Scene) -> None:
        """See `PairTerm.add`."""
        samples = scene.samples
        points = np.empty_like(samples)
        vertex_of = np.empty(len(samples), dtype=np.int64)
        pairs.nearest_model_points(
            samples, posed.depth, posed.triangle, posed.intrinsics, posed.faces, posed.vertices,
            self.reach, points, vertex_of,
        )  # fmt: skip
        weights = np.ones(len(samples))
        weights[scene.plain_samples :] = self.extremum_weight
        pairs.add_cloud_pairs(
            samples, points, vertex_of, weights, posed.normals, posed.body.skin_joints, posed.body.skin_weights,
            system.reference, self.sigma, self.plane, self.point, system.hessian, system.gradient,
        )  # fmt: skip


@dataclass(frozen=True)
class GaussianPrior:
    """Joint angles near a mean: `1/2 weight (pose - mean)' precision (pose - mean)` over the entries after the root's.

    mean : float64 (P,), radians; precision : float64 (P - 6, P - 6)
    """

    weight: float
    mean: np.ndarray
    precision: np.ndarray

    def add(self, system: NormalSystem, pose: np.ndarray) -> None:
        """See `PoseTerm.add`."""
        free = slice(6, skeleton.POSE_SIZE)
        system.matrix[free, free] += self.weight * self.precision
        system.vector[free] += self.weight * (self.precision @ (pose[free] - self.mean[free]))
