"""Organised metric point cloud of one filtered depth image (`M_I` in Baak 2013, 5.3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.kernels.image import depth as kernels
from toolkit.sensing.camera import Camera


@dataclass(frozen=True, eq=False)
class Cloud:
    """Point cloud with the pixel of each point.

    Attributes
    ----------
    points : float32 (N, 3), metres, level frame, in row-major order of their pixels
    pixels : int32 (N,), flat index v * width + u
    index : int32 (H, W), a pixel's row in `points`, -1 for none
    camera : camera of `depth`
    rotation : float64 (3, 3), `R_level_camera`
    depth : float32 (H, W), metres along z, 0 = nothing
    """

    points: np.ndarray
    pixels: np.ndarray
    index: np.ndarray
    camera: Camera
    rotation: np.ndarray
    depth: np.ndarray

    @classmethod
    def from_depth(cls, depth: np.ndarray, camera: Camera, rotation: np.ndarray) -> Cloud:
        """Return the cloud of a depth image, float32 (H, W) metres (0 = no measurement), of an undistorted `camera`."""
        depth = np.ascontiguousarray(depth, dtype=np.float32)
        index = np.empty(depth.shape, dtype=np.int32)
        pixels = np.empty(depth.size, dtype=np.int32)
        count = kernels.index_pixels(depth, index, pixels)
        points = np.empty((count, 3), dtype=np.float32)
        rotation = np.ascontiguousarray(rotation, dtype=np.float64)
        pixels = pixels[:count].copy()
        kernels.back_project(depth, pixels, camera.intrinsics, rotation, points)
        return cls(points, pixels, index, camera, rotation, depth)

    @classmethod
    def from_open3d(cls, cloud: Any, camera: Camera, rotation: np.ndarray) -> Cloud:
        """Return the cloud of an Open3D point cloud for an undistorted `camera`; the nearest point of a pixel counts.

        Parameters
        ----------
        cloud : `open3d.geometry.PointCloud` or `open3d.t.geometry.PointCloud`, metres, frame of `camera`; points that
            are not finite or lie behind the camera or outside its image are left out
        camera, rotation : as in `from_depth`
        """
        tensors = hasattr(cloud, "point")
        positions = cloud.point.positions.cpu().numpy() if tensors else np.asarray(cloud.points)
        points = np.ascontiguousarray(positions, dtype=np.float64).reshape(-1, 3)
        depth = np.zeros(camera.shape)
        kernels.z_buffer(points[np.isfinite(points).all(axis=1)], camera.intrinsics, depth)
        return cls.from_depth(depth, camera, rotation)

    def to_open3d(self) -> Any:
        """Return an `open3d.geometry.PointCloud` of the points, frame of the camera, metres, in the same order."""
        import open3d as o3d

        points = np.empty((len(self), 3))
        kernels.back_project(self.depth, self.pixels, self.camera.intrinsics, np.eye(3), points)
        return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))

    def __len__(self) -> int:
        return len(self.points)

    def spread_rows(self, count: int) -> np.ndarray:
        """Return about `count` rows of the cloud, evenly spaced in scan order: int64 (min(count, N),)."""
        return np.linspace(0, len(self) - 1, min(count, len(self))).astype(np.int64)


def window_of(depth: np.ndarray) -> tuple[slice, slice]:
    """Return the rows and columns of the bounding box of all depths above 0; empty if there are none."""
    measured = depth > 0
    rows, columns = np.flatnonzero(measured.any(axis=1)), np.flatnonzero(measured.any(axis=0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def cropped(depth: np.ndarray, intrinsics: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a copy of a depth image (H, W) cropped to its measurements, and its intrinsics (4,)."""
    rows, columns = window_of(depth)
    return depth[rows, columns].copy(), intrinsics - [0.0, 0.0, columns.start, rows.start]


def marked(depth: np.ndarray, mask: np.ndarray, value: float) -> np.ndarray:
    """Return a depth image (H, W) with `value` where `mask` (H, W) is set: a new array of its type."""
    return np.where(mask, depth.dtype.type(value), depth)
