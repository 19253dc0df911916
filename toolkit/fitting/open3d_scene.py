"""Correspondences by Open3D's kd-trees, as Baak 2013, 5.4.1 has them: the reference of the search on the pixel grid."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from toolkit.fitting.placed import PlacedBody
from toolkit.fitting.scene import Scene
from toolkit.kernels.image.raster import NEAREST
from toolkit.sensing.kd_tree import KdTree


class Open3DScene(Scene):
    """A scene with a kd-tree over the measured points; its correspondences equal those of `Scene` to the bit.

    Of points at exactly one distance either search may take another one.
    """

    @cached_property
    def _points(self) -> np.ndarray:
        depth, intrinsics = self._person
        return back_projected(depth, intrinsics)[0]

    @cached_property
    def _tree(self) -> KdTree:
        return KdTree(self._points)

    def medians(self, points: np.ndarray, wanted: np.ndarray, reach: float, count: int, out: np.ndarray) -> None:
        """See `Scene.medians`."""
        out[:, 0] = np.nan
        rows = np.flatnonzero(wanted & (points[:, 2] > NEAREST))
        if len(rows) == 0 or len(self._points) == 0:
            return
        nearest, squared = self._tree.query(points[rows], min(count, len(self._points)))
        near = squared < reach**2
        counterparts = self._points[nearest]
        whole, part = near.all(axis=1), near.any(axis=1) & ~near.all(axis=1)
        out[rows[whole]] = np.median(counterparts[whole], axis=1)
        counterparts[~near] = np.nan
        out[rows[part]] = np.nanmedian(counterparts[part], axis=1)

    def nearest_drawn(self, placed: PlacedBody, samples: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """See `Scene.nearest_drawn`."""
        points, vertex_of = np.empty_like(samples), np.full(len(samples), -1, dtype=np.int64)
        rows = np.flatnonzero(samples[:, 2] > NEAREST)
        drawn, pixels = back_projected(placed.drawn.depth, placed.drawn.intrinsics)
        if len(rows) == 0 or len(drawn) == 0:
            return points, vertex_of
        nearest, squared = KdTree(drawn).query(samples[rows], 1)
        near = squared[:, 0] < reach**2
        rows, nearest = rows[near], nearest[near, 0]
        points[rows] = drawn[nearest]
        corners = placed.placer.faces[placed.drawn.triangle.reshape(-1)[pixels[nearest]]]
        squared = ((placed.vertices[corners] - points[rows][:, None]) ** 2).sum(axis=2)
        vertex_of[rows] = corners[np.arange(len(corners)), squared.argmin(axis=1)]
        return points, self.without_withheld(placed, vertex_of)


def back_projected(depth: np.ndarray, intrinsics: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 3) of the pixels with depth (H, W) > 0, camera frame, metres, and their flat indices."""
    v, u = np.nonzero(depth > 0)
    z = depth[v, u].astype(np.float64)
    fx, fy, cx, cy = intrinsics
    return np.stack([(u - cx) * z / fx, (v - cy) * z / fy, z], axis=1), v * depth.shape[1] + u


SCENES: dict[str, type[Scene]] = {"grid": Scene, "open3d": Open3DScene}
"""Scene by the setting `fitting.correspondences`."""
