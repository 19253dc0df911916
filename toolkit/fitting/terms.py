"""Residual terms of the local optimisation; each adds its quadratic to the normal equations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.body import skeleton
from toolkit.fitting.placed import NormalSystem, PlacedBody, balls_of
from toolkit.fitting.scene import Scene
from toolkit.kernels import linear
from toolkit.kernels.fit import pairs, twists

CLOUD_PLANE, CLOUD_POINT = 1.0, 0.3
"""Plane and point weights of a cloud-to-mesh pair."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Correspondences: vertex int64 (N,), residual float64 (N, 3), mesh minus measurement, metres, and weight (N,)."""

    vertex: np.ndarray
    residual: np.ndarray
    weight: np.ndarray


class PairTerm(Protocol):
    """A term of point pairs; called between `system.reset` and `system.assemble`."""

    def add(self, system: NormalSystem, placed: PlacedBody, scene: Scene) -> None:
        """Add the pairs of this term for the placed body."""


class MeshTerm(PairTerm, Protocol):
    """A term between the mesh and the measured points that exposes its pairs."""

    def pairs(self, placed: PlacedBody, scene: Scene) -> Pairs:
        """Return the correspondences."""


@dataclass(frozen=True)
class SurfaceTerm:
    """Pairs from visible chosen vertices to the median of their nearest measured points (Baak 2013, 5.4.1).

    `FittingSettings.vertices` selects the vertices.
    """

    reach: float
    neighbours: int
    sigma: float
    plane: float
    point: float
    facing: float
    vertices: str = "seen"

    def targets(self, placed: PlacedBody, scene: Scene) -> np.ndarray:
        """Return the measured counterpart of each chosen vertex, float64 (C, 3), NaN in column 0 without one."""
        visible = visible_chosen(placed, scene, self.facing, self.vertices)
        points = placed.chosen_points
        targets = np.empty_like(points)
        scene.medians(points, visible, self.reach, self.neighbours, targets)
        return targets

    def pairs(self, placed: PlacedBody, scene: Scene) -> Pairs:
        """Return the correspondences."""
        targets = self.targets(placed, scene)
        found = ~np.isnan(targets[:, 0])
        vertex = placed.placer.chosen[found]
        residual = placed.vertices[vertex] - targets[found]
        return Pairs(vertex, residual, _robust(residual, self.sigma))

    def add(self, system: NormalSystem, placed: PlacedBody, scene: Scene) -> None:
        """See `PairTerm.add`."""
        targets, chosen = self.targets(placed, scene), placed.placer.chosen
        pairs.add_pairs(
            targets, placed.chosen_points, chosen, np.ones(len(chosen)), placed.normals,
            placed.body.skin_joints, placed.body.skin_weights, system.reference,
            self.sigma, self.plane, self.point, system.hessian, system.gradient,
        )  # fmt: skip


@dataclass(frozen=True)
class CloudTerm:
    """Pairs from measured samples to the nearest visible point of the drawn body, weighted by `Scene.weights`."""

    reach: float
    sigma: float

    def nearest(self, placed: PlacedBody, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
        """Return the nearest visible surface point (N, 3) and its mesh vertex (N,), -1 for none, of each sample."""
        return scene.nearest_drawn(placed, scene.samples, self.reach)

    def pairs(self, placed: PlacedBody, scene: Scene) -> Pairs:
        """Return the correspondences."""
        points, vertex_of = self.nearest(placed, scene)
        found = vertex_of >= 0
        residual = points[found] - scene.samples[found]
        return Pairs(vertex_of[found], residual, _robust(residual, self.sigma))

    def add(self, system: NormalSystem, placed: PlacedBody, scene: Scene) -> None:
        """See `PairTerm.add`."""
        points, vertex_of = self.nearest(placed, scene)
        pairs.add_pairs(
            scene.samples, points, vertex_of, scene.weights, placed.normals,
            placed.body.skin_joints, placed.body.skin_weights, system.reference,
            self.sigma, CLOUD_PLANE, CLOUD_POINT, system.hessian, system.gradient,
        )  # fmt: skip


def visible_chosen(placed: PlacedBody, scene: Scene, facing: float, vertices: str = "seen") -> np.ndarray:
    """Return which chosen vertices would be measured, bool (C,); none of a link out of view (`Scene.withheld`).

    With `vertices` "front" a fixed set is used (Baak 2013, Fig. 5.6a).
    """
    if vertices == "front":
        return placed.placer.front
    # Distance behind the drawn body at which a vertex is hidden, metres: below the thickness of a hand, above the
    # mesh facets.
    hidden = 0.03
    visible = placed.visible(facing, hidden, scene.seen, scene.intrinsics)
    if scene.withheld is not None:
        visible &= ~scene.withheld[placed.body.part[placed.placer.chosen]]
    return visible


@dataclass(frozen=True)
class JointTerm:
    """Pairs from joint centres and sites to given points, for estimated joints.

    targets : float64 (20, 3), camera frame, metres; weights : float64 (20,); derived joints are left out
    """

    targets: np.ndarray
    weights: np.ndarray
    sigma: float

    def add(self, system: NormalSystem, placed: PlacedBody, scene: Scene) -> None:
        """See `PairTerm.add`."""
        for row, (carrier, site) in enumerate(CARRIERS):
            if carrier < 0 or self.weights[row] <= 0.0:
                continue
            point = carried(placed, carrier, site)
            pull(system, carrier, point, point - self.targets[row], self.weights[row], self.sigma)


def pull(system: NormalSystem, carrier: int, point: np.ndarray, away: np.ndarray, weight: float, sigma: float) -> None:
    """Attract a point (3,) of joint `carrier` by `away` (3,), metres, with a Geman-McClure weight."""
    p, robust = point - system.reference, weight / (1.0 + linear.dot(away, away) / sigma**2) ** 2
    twists.add_pair(
        system.hessian, system.gradient, carrier, p[0], p[1], p[2], 0.0, 0.0, 0.0, away[0], away[1], away[2],
        0.0, robust,
    )  # fmt: skip


def carried(placed: PlacedBody, carrier: int, site: int) -> np.ndarray:
    """Return the position of a reported joint with this entry in `CARRIERS`: float64 (3,), camera frame, metres."""
    point = np.asarray(placed.origins[carrier])
    if site < 0:
        return point
    offset = placed.body.sites[site] - placed.body.joints[carrier]
    return point + linear.times(placed.rotations[carrier], offset)


@dataclass(frozen=True)
class ContactTerm:
    """Self-penetration term: overlapping balls of the body repel each other."""

    weight: float

    def add(self, system: NormalSystem, placed: PlacedBody, scene: Scene) -> None:
        """See `PairTerm.add`."""
        balls = balls_of(placed.body)
        pairs.add_contacts(
            balls.apart, balls.joint, balls.offset, balls.radius, placed.rotations, placed.origins, system.reference,
            SOFT, self.weight, system.hessian, system.gradient,
        )  # fmt: skip


def _carriers() -> list[tuple[int, int]]:
    sites = [name for name, _ in skeleton.SITES]
    carriers = []
    for name in skeleton.REPORTED:
        if name in sites:
            site = sites.index(name)
            carriers.append((int(skeleton.SITE_PARENTS[site]), site))
        else:
            carriers.append((skeleton.JOINT_NAMES.index(name) if name in skeleton.JOINT_NAMES else -1, -1))
    return carriers


CARRIERS: tuple[tuple[int, int], ...] = tuple(_carriers())
"""Articulated joint and site (-1 for none) of each reported joint; -1, -1 for a derived one."""
CARRIED: np.ndarray = np.array([carrier >= 0 for carrier, _ in CARRIERS])
"""Reported joints that the body carries, bool (20,); the others are derived from them."""


def _robust(residual: np.ndarray, sigma: float) -> np.ndarray:
    """Return Geman-McClure weights (N,) of residuals (N, 3)."""
    return (1.0 + linear.dots(residual, residual) / sigma**2) ** -2


SOFT = 0.8
"""Distance of two balls relative to the sum of their radii at which they penetrate; below 1, because flesh is soft."""
