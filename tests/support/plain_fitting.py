"""Local optimisation in NumPy and SciPy, the reference for the compiled one (Baak 2013, 5.4.1).

The correspondences are those of `Open3DScene`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.body.body import BELOW, Body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.objective import WORSE, Comparison, Objective
from toolkit.fitting.placed import Drawn, NormalSystem, PlacedBody, Placer
from toolkit.fitting.priors import PoseTerm
from toolkit.fitting.refiner import Refiner, pair_terms
from toolkit.fitting.scene import EXTREMUM_WEIGHT, Scene
from toolkit.fitting.terms import CLOUD_PLANE, CLOUD_POINT, CloudTerm, SurfaceTerm, visible_chosen


class PlainPlacer(Placer):
    """Placer of bodies in vectorised NumPy."""

    @classmethod
    def like(cls, placer: Placer) -> PlainPlacer:
        """Return a placer with the same camera."""
        plain = cls.__new__(cls)
        vars(plain).update(vars(placer))
        return plain

    def place(self, body: Body, pose: np.ndarray, normals: np.ndarray | None = None) -> PlacedBody:
        """See `Placer.place`."""
        return PlainPlacedBody(self, body, pose, body.normals if normals is None else normals)


class PlainPlacedBody(PlacedBody):
    """Body placed and drawn in vectorised NumPy."""

    def __init__(self, placer: Placer, body: Body, pose: np.ndarray, rest_normals: np.ndarray) -> None:
        self.placer, self.body = placer, body
        vectors = np.zeros((len(skeleton.JOINTS), 3))
        vectors[skeleton.DOF_JOINT, skeleton.DOF_AXIS] = pose[3:]
        local = Rotation.from_rotvec(vectors).as_matrix()
        rotations, origins = np.empty_like(local), np.empty_like(vectors)
        parents = np.broadcast_to(np.eye(3), local.shape).copy()
        for j, p in enumerate(skeleton.PARENTS):
            if p < 0:
                rotations[j], origins[j] = local[j], pose[:3]
            else:
                parents[j] = rotations[p]
                rotations[j] = rotations[p] @ local[j]
                origins[j] = origins[p] + rotations[p] @ (body.joints[j] - body.joints[p])
        turned = parents @ left_jacobians(vectors)
        axes = turned[skeleton.DOF_JOINT, :, skeleton.DOF_AXIS]
        from_level = placer.from_level
        self.rotations = from_level @ rotations
        self.origins = origins @ from_level.T
        self.axes = axes @ from_level.T
        joints, weights = body.skin_joints, body.skin_weights
        carried = self.rotations[joints] @ (body.vertices[:, None] - body.joints[joints])[..., None]
        self.vertices = (weights[..., None] * (carried[..., 0] + self.origins[joints])).sum(axis=1)
        normals = (weights[..., None] * (self.rotations[joints] @ rest_normals[:, None, :, None])[..., 0]).sum(axis=1)
        self.normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)

    @cached_property
    def drawn(self) -> Drawn:
        """Draw the whole image: all pixels of each triangle's box at once; the nearest triangle of a pixel is kept."""
        fx, fy, cx, cy = self.placer.intrinsics
        faces, (height, width) = self.placer.faces, self.placer.camera.shape
        x, y, z = self.vertices.T
        behind = z <= 0.05
        safe = np.where(behind, 1.0, z)
        corners = np.stack([fx * x / safe + cx, fy * y / safe + cy, 1.0 / safe], axis=1)[faces]
        edge_b, edge_c = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = edge_b[:, 0] * edge_c[:, 1] - edge_b[:, 1] * edge_c[:, 0]
        low = np.maximum(np.ceil(corners[..., :2].min(axis=1)), 0).astype(int)
        high = np.minimum(np.floor(corners[..., :2].max(axis=1)), [width - 1, height - 1]).astype(int)
        sides = np.maximum(high - low + 1, 0)
        seen = np.flatnonzero((area < -1e-12) & ~behind[faces].any(axis=1) & (sides.min(axis=1) > 0))
        counts = sides[seen].prod(axis=1)
        face = np.repeat(seen, counts)
        place = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)
        u = low[face, 0] + place % sides[face, 0]
        v = low[face, 1] + place // sides[face, 0]
        du, dv = u - corners[face, 0, 0], v - corners[face, 0, 1]
        beta = (du * edge_c[face, 1] - dv * edge_c[face, 0]) / area[face]
        gamma = (dv * edge_b[face, 0] - du * edge_b[face, 1]) / area[face]
        inside = (beta >= -1e-9) & (gamma >= -1e-9) & (beta + gamma <= 1.0 + 1e-9)
        face, pixel = face[inside], (v * width + u)[inside]
        inverse = corners[face, 0, 2] + beta[inside] * edge_b[face, 2] + gamma[inside] * edge_c[face, 2]
        order = np.lexsort((face, -inverse))
        pixels, nearest = np.unique(pixel[order], return_index=True)
        image = np.zeros((height, width)), np.full((height, width), -1, dtype=np.int32)
        drawn = Drawn(*image, self.placer.intrinsics)
        drawn.depth.reshape(-1)[pixels] = 1.0 / inverse[order][nearest]
        drawn.triangle.reshape(-1)[pixels] = face[order][nearest]
        return drawn

    def visible(self, facing: float, tolerance: float, seen: np.ndarray, intrinsics: np.ndarray) -> np.ndarray:
        """See `PlacedBody.visible`."""
        fx, fy, cx, cy = self.placer.intrinsics
        height, width = self.placer.camera.shape
        points = self.chosen_points
        z = points[:, 2]
        cosine = -(self.normals[self.placer.chosen] * points).sum(axis=1) / np.linalg.norm(points, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.rint(fx * points[:, 0] / z + cx)
            v = np.rint(fy * points[:, 1] / z + cy)
        within = (u >= 0) & (u < width) & (v >= 0) & (v < height) & (z > 0.05)
        front = np.zeros(len(points))
        front[within] = self.drawn.depth[v[within].astype(int), u[within].astype(int)]
        hidden = (front > 0.0) & (front < z - tolerance)
        return within & (cosine >= facing) & ~hidden & self._observed(points, seen, intrinsics)

    @staticmethod
    def _observed(points: np.ndarray, seen: np.ndarray, intrinsics: np.ndarray) -> np.ndarray:
        fx, fy, cx, cy = intrinsics
        height, width = seen.shape
        z = np.where(points[:, 2] > 0.05, points[:, 2], np.inf)
        u, v = np.rint(fx * points[:, 0] / z + cx), np.rint(fy * points[:, 1] / z + cy)
        inside = np.isfinite(z) & (u >= 0) & (u < width) & (v >= 0) & (v < height)
        observed = np.zeros(len(points), dtype=np.bool_)
        observed[inside] = ~np.isnan(seen[v[inside].astype(int), u[inside].astype(int)])
        return observed


def left_jacobians(vectors: np.ndarray) -> np.ndarray:
    """Return left Jacobians (J, 3, 3) of the exponential map at rotation vectors (J, 3)."""
    squared = (vectors**2).sum(axis=1)
    small = squared < 1e-8
    angle = np.sqrt(np.where(small, 1.0, squared))
    b = np.where(small, 0.5 - squared / 24.0, (1.0 - np.cos(angle)) / angle**2)
    c = np.where(small, 1.0 / 6.0 - squared / 120.0, (angle - np.sin(angle)) / angle**3)
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return np.eye(3) + b[:, None, None] * cross + c[:, None, None] * (cross @ cross)


class PlainSystem(NormalSystem):
    """Normal equations from one dense Jacobian of all pairs."""

    def reset(self, reference: np.ndarray) -> None:
        """See `NormalSystem.reset`."""
        super().reset(reference)
        self._rows: list[tuple[np.ndarray, ...]] = []

    def gather(
        self,
        placed: PlacedBody,
        vertex: np.ndarray,
        points: np.ndarray,
        residual: np.ndarray,
        weight: np.ndarray,
        plane: float,
        point: float,
    ) -> None:
        """Add pairs: `points` (N, 3) that move with mesh vertices (N,), residuals (N, 3), robust weights (N,)."""
        shares = placed.body.skin_weights[vertex]
        row, slot = np.nonzero(shares > 0.0)
        weights = shares[row, slot] * weight[row]
        joints = placed.body.skin_joints[vertex[row], slot]
        self._rows.append(
            (joints, points[row], placed.normals[vertex[row]], residual[row], plane * weights, point * weights)
        )

    def assemble(self, placed: PlacedBody) -> None:
        """Assemble as `NormalSystem.assemble`, with the pairs of the terms that are not plain."""
        super().assemble(placed)
        joints, points, normals, residual, plane, point = (
            np.concatenate(part) for part in zip(*self._rows, strict=True)
        )
        jacobian = np.zeros((len(joints), 3, skeleton.POSE_SIZE))
        jacobian[:, :, :3] = placed.placer.from_level
        levers = points[:, None] - placed.origins[skeleton.DOF_JOINT]
        moves = np.cross(np.broadcast_to(placed.axes, levers.shape), levers)
        moves *= BELOW[skeleton.DOF_JOINT][:, joints].T[..., None]
        jacobian[:, :, 3:] = moves.transpose(0, 2, 1)
        along = np.sqrt(plane)[:, None] * np.einsum("na,nap->np", normals, jacobian)
        along_residual = np.sqrt(plane) * np.einsum("na,na->n", normals, residual)
        full = (np.sqrt(point)[:, None, None] * jacobian).reshape(-1, skeleton.POSE_SIZE)
        full_residual = (np.sqrt(point)[:, None] * residual).ravel()
        self.matrix += along.T @ along + full.T @ full
        self.vector += along.T @ along_residual + full.T @ full_residual


class PlainSurfaceTerm(SurfaceTerm):
    """Surface term that adds its pairs to a `PlainSystem`."""

    def add(self, system: Any, placed: PlacedBody, scene: Scene) -> None:
        """See `PairTerm.add`."""
        found = self.pairs(placed, scene)
        points = placed.vertices[found.vertex]
        system.gather(placed, found.vertex, points, found.residual, found.weight, self.plane, self.point)


class PlainCloudTerm(CloudTerm):
    """Cloud term that adds its pairs to a `PlainSystem`."""

    def add(self, system: Any, placed: PlacedBody, scene: Scene) -> None:
        """See `PairTerm.add`."""
        points, vertex_of = self.nearest(placed, scene)
        found = vertex_of >= 0
        residual = points[found] - scene.samples[found]
        weights = np.ones(len(scene.samples))
        weights[scene.plain_samples :] = np.where(scene.cut, 1.0, EXTREMUM_WEIGHT)
        robust = weights[found] * (1.0 + (residual**2).sum(axis=1) / self.sigma**2) ** -2
        system.gather(placed, vertex_of[found], points[found], residual, robust, CLOUD_PLANE, CLOUD_POINT)


def plain_solve(
    matrix: np.ndarray, vector: np.ndarray, pose: np.ndarray, limits: np.ndarray, damping: np.ndarray, step: np.ndarray
) -> None:
    """Fill `step` with the damped least squares within limits by an active set that only grows, as `refiner.Solve`."""
    step[:] = 0.0
    fixed = np.zeros(len(vector), dtype=bool)
    low, high = limits[:, 0] - pose, limits[:, 1] - pose
    damped = matrix + np.diag(damping)
    for _ in range(3):
        free = ~fixed
        right = -vector[free] - matrix[np.ix_(free, fixed)] @ step[fixed]
        try:
            step[free] = cho_solve(cho_factor(damped[np.ix_(free, free)]), right)
        except LinAlgError:
            step[:] = 0.0
            return
        outside = (step < low) | (step > high)
        step[:] = np.clip(step, low, high)
        if not (outside & free).any():
            break
        fixed |= outside


def plain_refiner(placer: PlainPlacer, settings: FittingSettings, pose_terms: Sequence[PoseTerm] = ()) -> Refiner:
    """Return a refiner whose steps all use NumPy or SciPy."""
    plain = {SurfaceTerm: PlainSurfaceTerm, CloudTerm: PlainCloudTerm}
    terms = [plain[type(term)](**vars(term)) if type(term) in plain else term for term in pair_terms(settings)]
    return Refiner(placer, settings, pose_terms, terms=terms, system=PlainSystem(), solve=plain_solve)


class PlainObjective(Objective):
    """Objective of the same settings in NumPy and SciPy."""

    def compare(self, body: Body, pose: np.ndarray, scene: Scene, bound: float = np.inf) -> Comparison:
        """See `Objective.compare`."""
        placed, s = self.placer.place(body, pose), self.settings
        visible, points = visible_chosen(placed, scene, s.facing, s.vertices), placed.chosen_points
        nearest = np.empty_like(points)
        scene.medians(points, visible, s.unexplained, 1, nearest)
        gaps = np.linalg.norm(points - nearest, axis=1)
        samples = scene.samples[: scene.plain_samples]
        explained, drawn = scene.nearest_drawn(placed, samples, s.unexplained)
        sample_gaps = np.linalg.norm(explained - samples, axis=1)
        far = ~(sample_gaps < s.unexplained) | (drawn < 0)
        sample_gaps[far] = s.unexplained
        extrema = np.linalg.norm(scene.extrema[:, None] - placed.vertices, axis=2).min(axis=1)
        parts = (gaps[visible], sample_gaps if scene.plain_samples else extrema)
        surface = sum(_mean_capped(part, s.unexplained) for part in parts)
        distance = surface + sum(evidence.cost(placed) for evidence in scene.evidence)
        energy = sum(term.energy(pose) for term in (*self.pose_terms, *scene.priors))
        if distance > bound:
            return WORSE
        return Comparison(distance, surface, gaps, sample_gaps, energy, placed, scene)


def _mean_capped(distances: np.ndarray, cap: float) -> float:
    """Return the mean of distances (N,), each capped, NaN counted as the cap; the cap for no distances."""
    return float(np.minimum(np.where(np.isnan(distances), cap, distances), cap).mean()) if len(distances) else cap
