"""Large planes of one depth image: walls, floor, ceiling."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from toolkit.io.archives import Column
from toolkit.kernels import linear
from toolkit.kernels.cloud.planes import best_plane


@dataclass(frozen=True, eq=False)
class Plane:
    """Plane in an image.

    Attributes
    ----------
    normal : float64 (3,), camera frame, length 1, towards the camera
    offset : metres: `normal . p + offset = 0` on it; the camera's distance from it
    area : area that its points cover, m^2
    """

    normal: Annotated[np.ndarray, Column("f", (3,), -1.0 - 1e-6, 1.0 + 1e-6)]
    offset: float
    area: float


def find_planes(depth: np.ndarray, rays: np.ndarray, tolerance: np.ndarray) -> list[Plane]:
    """Find large planes of a depth image, the largest first.

    Parameters
    ----------
    depth : float32 (H, W), metres along z, 0 = no measurement
    rays : float64 (H, W, 2), x/z and y/z
    tolerance : float (H, W), metres within which a pixel lies on a plane
    """
    v, u = np.nonzero(depth)
    if len(v) < 50:
        return []
    samples = 2500  # sampled points of the image: a wall of a twentieth of it still has 125
    share = max(1.0, len(v) / samples)
    picked = np.linspace(0, len(v) - 1, min(samples, len(v))).astype(np.int64)
    v, u = v[picked], u[picked]
    z = depth[v, u].astype(np.float64)
    points = np.column_stack([rays[v, u] * z[:, None], z])
    tolerances = tolerance[v, u].astype(np.float64)
    pitch = (rays[0, -1, 0] - rays[0, 0, 0]) / max(depth.shape[1] - 1, 1)
    facing = share * (z * pitch) ** 2  # m^2 per sample, seen perpendicularly
    rng = np.random.default_rng(0)
    rest = np.ones(len(points), dtype=bool)
    planes: list[Plane] = []
    # m^2, and m of the shorter side, of a wall or a floor; no person has such a plane
    least_area, least_side = 1.2, 0.9
    neighbourhood = 0.1  # fraction of the image width
    most_planes = 8
    filled = 0.35  # minimum fraction of a plane's rectangle that its points cover; a cut through clutter covers less
    least_slant = 0.3  # sine of the angle at which a plane is seen: nearer to edge-on, its area is unknown
    for _ in range(most_planes):
        members = np.flatnonzero(rest)
        if facing[members].sum() < least_area / 4 or len(members) < 50:
            break
        triples = _triples(v[members], u[members], neighbourhood * depth.shape[1], rng)
        plane = np.zeros(4)
        if best_plane(points[members], tolerances[members], facing[members], triples, plane) == 0.0:
            break
        normal, offset, on = _refitted(points, tolerances, rest, plane)
        rest &= ~on
        slant = np.abs(linear.times(points, normal)) / linear.lengths(points)
        area = float((facing[on] / np.maximum(slant[on], least_slant)).sum())
        sides = _sides(points[on], normal)
        large = area >= least_area and sides[1] >= least_side and area >= filled * sides[0] * sides[1]
        if large and _bounds(points, tolerances, on, normal, offset):
            planes.append(Plane(normal, offset, area))
    return sorted(planes, key=lambda p: -p.area)


def on_planes(depth: np.ndarray, rays: np.ndarray, tolerance: np.ndarray, planes: list[Plane]) -> np.ndarray:
    """Return the measured pixels that lie on one of the planes: bool (H, W)."""
    import cv2

    mask = np.zeros(depth.shape, dtype=bool)
    core_size = 2  # coarse pixels: surfaces on a plane that are thinner than twice this stand out of it
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * core_size + 1, 2 * core_size + 1))
    for plane in planes:
        slopes = rays[..., 0] * plane.normal[0] + rays[..., 1] * plane.normal[1] + plane.normal[2]
        on = (depth > 0) & (np.abs(depth * slopes + plane.offset) <= tolerance)
        # A plane is infinite and also cuts people: it is a wall only where it is wide.
        core = cv2.erode(on.astype(np.uint8), disc, borderType=cv2.BORDER_CONSTANT, borderValue=1)
        mask |= on & (cv2.dilate(core, np.ones((4 * core_size + 1, 4 * core_size + 1), np.uint8)) > 0)
    return mask


def _triples(v: np.ndarray, u: np.ndarray, radius: float, rng: np.random.Generator) -> np.ndarray:
    """Draw rows of three points each, half of them from anywhere, half close to the first."""
    n = len(v)
    # half of them from one neighbourhood: a plane of a fifth of the points is hit with probability 0.9999
    triple_count = 400
    triples = rng.integers(0, n, size=(triple_count, 3))
    for k in range(triple_count // 2):
        first = triples[k, 0]
        near = np.flatnonzero((np.abs(v - v[first]) <= radius) & (np.abs(u - u[first]) <= radius))
        triples[k, 1:] = near[rng.integers(0, len(near), size=2)]
    return triples


def _refitted(
    points: np.ndarray, tolerances: np.ndarray, rest: np.ndarray, plane: np.ndarray
) -> tuple[np.ndarray, float, np.ndarray]:
    """Fit a plane by repeated least squares over its points; return normal towards the camera, offset, and members."""
    normal, offset = plane[:3], float(plane[3])
    on = rest & (np.abs(linear.times(points, normal) + offset) <= tolerances)
    refits = 3
    for _ in range(refits):
        weights = 1.0 / tolerances[on] ** 2
        centre = (points[on] * weights[:, None]).sum(axis=0) / weights.sum()
        normal = linear.principal_axes(linear.gram(points[on] - centre, weights))[1][:, 0]
        offset = -linear.dot(normal, centre)
        again = rest & (np.abs(linear.times(points, normal) + offset) <= tolerances)
        if again.sum() < 10:
            break
        on = again
    return (normal, offset, on) if offset > 0 else (-normal, -offset, on)


def _bounds(points: np.ndarray, tolerances: np.ndarray, on: np.ndarray, normal: np.ndarray, offset: float) -> bool:
    """Return True if few points lie behind the plane within the rectangle of its own points, as the camera sees it."""
    slopes = linear.times(points, normal)
    through = slopes + offset < -3 * tolerances
    if not through.any():
        return True
    hits = points * np.where(slopes < 0, -offset / np.minimum(slopes, -1e-9), 0.0)[:, None]
    low, high = np.percentile(points[on], [5, 95], axis=0)
    inside = ((hits >= low - 0.05) & (hits <= high + 0.05)).all(axis=1)
    # maximum fraction of points measured behind a plane that bounds the room (unlike a sofa's front, a row of people)
    behind = 0.35
    return bool((through & inside).sum() <= behind * on.sum())


def _sides(points: np.ndarray, normal: np.ndarray) -> tuple[float, float]:
    """Return the longer and shorter side of the rectangle that holds nine tenths of the points along each."""
    first = np.cross(normal, (0.0, 1.0, 0.0) if abs(normal[1]) < 0.9 else (1.0, 0.0, 0.0))
    first /= math.hypot(*first)
    flat = np.stack([linear.times(points, first), linear.times(points, np.cross(normal, first))], axis=1)
    low, high = np.percentile(flat, [5, 95], axis=0)
    long, short = sorted((high - low).tolist(), reverse=True)
    return long, short
