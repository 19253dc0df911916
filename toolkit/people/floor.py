"""Floor of a scene and the vertical that it defines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.kernels import linear
from toolkit.kernels.cloud.planes import largest_plane
from toolkit.sensing.camera import DEFAULT_UP, Camera

FLOOR_SAMPLES = 6000  # sampled points; a floor of a tenth of the scene still has 600
INLIER_DISTANCE = 0.03  # m; a Kinect's quantisation at 3 m
LARGEST_TILT = np.deg2rad(50.0)  # maximum tilt of a camera without roll
SMALLEST_FLOOR = 0.8  # m^2; no plane of a person is this large
LOWEST_CAMERA = 0.1  # m above the floor; nearer points may be on an edge-on plane
SHARE_ABOVE = 0.97  # fraction of the scene above the plane; a table has the floor below it


@dataclass(frozen=True)
class Floor:
    """Plane `up_camera . p + height = 0` of points p, metres, camera frame.

    Attributes
    ----------
    up_camera : float64 (3,), its unit normal, pointing up
    height : metres of the camera above it
    """

    up_camera: np.ndarray
    height: float


def find_floor(depth_mm: np.ndarray, camera: Camera) -> Floor | None:
    """Find the floor in a depth image, uint16 (H, W), millimetres; None where no floor is visible.

    Planes are taken one after the other by RANSAC from a sample of the points. The floor is the largest one
    that is nearly level for a camera tilted by up to 50 degrees, has the scene above it and is larger than any plane
    of a person.
    """
    v, u = np.nonzero(depth_mm)
    if len(v) * _pixel_area(depth_mm, camera) < SMALLEST_FLOOR:
        return None
    picked = np.linspace(0, len(v) - 1, min(FLOOR_SAMPLES, len(v))).astype(np.int64)
    v, u = v[picked], u[picked]
    z = depth_mm[v, u] * 1e-3
    points = np.column_stack([camera.rays()[v, u] * z[:, None], z])
    # A sampled pixel represents the pixels per sample, each covering z^2 / (fx fy).
    areas = z**2 / (camera.fx * camera.fy) * (np.count_nonzero(depth_mm) / len(points))
    seed = 0  # each search of a scene finds the same floor
    rest, rng = np.ones(len(points), dtype=bool), np.random.default_rng(seed)
    iterations = 2000  # find a plane of a tenth of the points with probability 0.86, of a fifth always
    planes = 6  # walls, ceiling and tables may be larger than the floor
    for _ in range(planes):
        if rest.sum() < FLOOR_SAMPLES // 100:
            return None
        plane, members = largest_plane(points[rest], INLIER_DISTANCE, iterations, rng)
        members = np.flatnonzero(rest)[members]
        floor = _as_floor(plane)
        if floor is not None:
            rises = linear.times(points, floor.up_camera)
            slant = np.abs(rises[members]) / linear.lengths(points[members])
            area = (areas[members] / np.maximum(slant, 0.05)).sum()
            if area >= SMALLEST_FLOOR and (rises + floor.height > -3 * INLIER_DISTANCE).mean() >= SHARE_ABOVE:
                return floor
        rest[members] = False
    return None


def find_known_floor(depth_mm: np.ndarray, camera: Camera, up_camera: np.ndarray) -> Floor | None:
    """Find the floor in a depth image, uint16 (H, W), millimetres, with a known vertical; None where none is visible.

    Of the level surfaces of a floor's size with the scene above them, the largest is taken. A surface that is as large
    a little higher belongs to walls, which have the same width at every height.
    """
    v, u = np.nonzero(depth_mm)
    if not len(v):
        return None
    picked = np.linspace(0, len(v) - 1, min(FLOOR_SAMPLES, len(v))).astype(np.int64)
    z = depth_mm[v[picked], u[picked]] * 1e-3
    points = np.column_stack([camera.rays()[v[picked], u[picked]] * z[:, None], z])
    rises = linear.times(points, up_camera)
    slant = np.maximum(np.abs(rises) / linear.lengths(points), 0.05)
    areas = z**2 / (camera.fx * camera.fy) * (len(v) / len(points)) / slant
    found, largest = None, SMALLEST_FLOOR
    prominent = 1.5  # ratio to the area 9 cm higher: walls have the same width there
    for level in np.arange(rises.min(), min(rises.max(), -LOWEST_CAMERA), 0.5 * INLIER_DISTANCE):
        members = np.abs(rises - level) < INLIER_DISTANCE
        standing = np.abs(rises - level - 3 * INLIER_DISTANCE) < INLIER_DISTANCE
        above = (rises > level - 3 * INLIER_DISTANCE).mean()
        area = areas[members].sum()
        if above >= SHARE_ABOVE and area >= max(largest, prominent * areas[standing].sum()):
            found, largest = Floor(np.asarray(up_camera), -float(np.median(rises[members]))), area
    return found


def _pixel_area(depth_mm: np.ndarray, camera: Camera) -> float:
    far = float(depth_mm.max()) * 1e-3
    return 20.0 * far * far / (camera.fx * camera.fy)  # 20: the slant that `find_floor` allows


def _as_floor(plane: np.ndarray) -> Floor | None:
    normal, offset = plane[:3], plane[3]
    if np.sum(normal * DEFAULT_UP) < 0:
        normal, offset = -normal, -offset
    upright = np.sum(normal * DEFAULT_UP) >= np.cos(LARGEST_TILT)
    return Floor(normal, float(offset)) if upright and offset >= LOWEST_CAMERA else None
