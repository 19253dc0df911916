"""Head and shoulders in a depth image, by comparisons of depth at places given in metres, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


@njit(cache=True)
def head_scores(
    depth: np.ndarray,
    candidates: np.ndarray,
    intrinsics: np.ndarray,
    up: np.ndarray,
    inside: np.ndarray,
    around: np.ndarray,
    shoulders: np.ndarray,
    tolerances: np.ndarray,
    unmeasured: float,
    scores: np.ndarray,
) -> None:
    """Compute the similarity of each candidate pixel's surroundings to those of a head's centre.

    A position is given in metres to the right and upwards in the plane through the pixel's point that faces the camera;
    upwards is the projection of the vertical onto that plane.

    Parameters
    ----------
    depth : float32 (H, W), metres along z, 0 = no measurement
    candidates : bool (H, W)
    intrinsics : (4,); up : (3,), the vertical in the camera frame, of length 1
    inside : (A, 2), places on the head; around : (B, 2), places beside and above it; shoulders : (C, 2), places on the
        chest and shoulders
    tolerances : (4,), metres: depth of a head, depth by which its surroundings lie behind it at the least, depth
        between head and shoulders, radius of the sphere that a head is flatter than
    unmeasured : value of an unmeasured place beside the head, 0 to 1
    scores : float32 (H, W); becomes 0 for what is no head, else the mean of three shares in 0 to 1: of the places
        around that lie behind the head or were not measured, of the shoulders' places at the head's depth, and of the
        roundness that a sphere would have
    """
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            scores[v, u] = 0.0
            if not candidates[v, u]:
                continue
            place = _placed(depth, u, v, intrinsics, up)
            if not place.fits:
                continue
            roundness = _roundness(depth, place, inside, tolerances[0], tolerances[3])
            if roundness < 0.0:
                continue
            free = _space(depth, place, around, tolerances[1], unmeasured)
            if free < 0.0:
                continue
            below = _support(depth, place, shoulders, tolerances[2])
            if below < 0.0:
                continue
            scores[v, u] = (free + below + roundness) / 3.0


class _Place(NamedTuple):
    """A candidate pixel, its depth, and a metre to the right and one upwards in pixels; `fits` where there is an up."""

    fits: bool
    u: int
    v: int
    z: float
    right_u: float
    right_v: float
    up_u: float
    up_v: float


@njit(cache=True)
def _placed(depth: np.ndarray, u: int, v: int, intrinsics: np.ndarray, up: np.ndarray) -> _Place:
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    z = depth[v, u]
    a, b = (u - cx) / fx, (v - cy) / fy
    along = (a * up[0] + b * up[1] + up[2]) / (a * a + b * b + 1.0)
    x, y = up[0] - along * a, up[1] - along * b
    length = np.sqrt(x * x + y * y)
    shortest = 0.2  # length of the vertical in the image plane; if shorter, the head is seen from above
    if length < shortest:
        return _Place(False, u, v, z, 0.0, 0.0, 0.0, 0.0)
    x, y = x / length * fx / z, y / length * fy / z
    return _Place(True, u, v, z, -y / fy * fx, x / fx * fy, x, y)


@njit(cache=True)
def _behind(depth: np.ndarray, place: _Place, across: float, upwards: float) -> float:
    """Return the depth of the surface at a position behind the candidate, metres; NaN without a measurement."""
    u = int(np.rint(place.u + across * place.right_u + upwards * place.up_u))
    v = int(np.rint(place.v + across * place.right_v + upwards * place.up_v))
    if u < 0 or v < 0 or u >= depth.shape[1] or v >= depth.shape[0] or depth[v, u] == 0.0:
        return np.nan
    return depth[v, u] - place.z


@njit(cache=True)
def _roundness(depth: np.ndarray, place: _Place, inside: np.ndarray, deep: float, radius: float) -> float:
    """Return the roundness relative to a sphere, 0 to 1; negative if under two thirds of the places are on a head."""
    on, total, count = 0, 0.0, 0
    for k in range(inside.shape[0]):
        d = _behind(depth, place, inside[k, 0], inside[k, 1])
        if abs(d) <= deep:
            on += 1
            off = inside[k, 0] * inside[k, 0] + inside[k, 1] * inside[k, 1]
            if off > 0.0:
                total += d / (radius - np.sqrt(max(radius * radius - off, 0.0)))
                count += 1
    if 3 * on < 2 * inside.shape[0] or count == 0:
        return -1.0
    return min(max(total / count, 0.0), 1.0)


@njit(cache=True)
def _space(depth: np.ndarray, place: _Place, around: np.ndarray, behind: float, unmeasured: float) -> float:
    """Return the fraction of the places around that are free; negative if a third is not, or one side is occupied."""
    free, contradicted, left, right = 0.0, 0, 0.0, 0.0
    beside = 0.1  # metres from the middle of a head beyond which a position counts as right or left of it
    for k in range(around.shape[0]):
        d = _behind(depth, place, around[k, 0], around[k, 1])
        gain = 0.0
        if np.isnan(d):
            gain = unmeasured
        elif d >= behind:
            gain = 1.0
        else:
            contradicted += 1
        free += gain
        if around[k, 0] > beside:
            right = max(right, gain)
        elif around[k, 0] < -beside:
            left = max(left, gain)
    if 3 * contradicted > around.shape[0] or min(left, right) < 0.5:
        return -1.0
    return free / around.shape[0]


@njit(cache=True)
def _support(depth: np.ndarray, place: _Place, shoulders: np.ndarray, reach: float) -> float:
    """Return the fraction of measured shoulder places at the head's depth; negative if too few are measured or fit."""
    seen, below = 0, 0
    for k in range(shoulders.shape[0]):
        d = _behind(depth, place, shoulders[k, 0], shoulders[k, 1])
        if not np.isnan(d):
            seen += 1
            if abs(d) <= reach:
                below += 1
    if 2 * seen < shoulders.shape[0] or 3 * below < 2 * seen:
        return -1.0
    return below / seen


@njit(cache=True)
def mark_near(points: np.ndarray, place: np.ndarray, radius: float, near: np.ndarray) -> None:
    """Mark in `near` (H, W) the pixels whose `points` (H, W, 3) are nearer than `radius` to `place` (3,), metres."""
    for v in range(near.shape[0]):
        for u in range(near.shape[1]):
            dx, dy, dz = points[v, u, 0] - place[0], points[v, u, 1] - place[1], points[v, u, 2] - place[2]
            near[v, u] = dx * dx + dy * dy + dz * dz < radius * radius


@njit(cache=True)
def run_widths(
    points: np.ndarray,
    depth: np.ndarray,
    mask: np.ndarray,
    head: np.ndarray,
    lowest: float,
    highest: float,
    gap: float,
    step: float,
    widths: np.ndarray,
) -> int:
    """Measure the width of a surface, `mask` (H, W), in the rows of the image from `lowest` to `highest` above `head`.

    In each row it is the run that is nearest below the head: a run ends where the next pixel of the surface is more
    than `gap` aside, or more than `step` nearer or farther. `points` (H, W, 3) are in the level frame, `depth` (H, W)
    is along the view. Fills `widths` (H,) in the order of the rows and returns the number of rows with the surface.
    """
    count = 0
    for v in range(depth.shape[0]):
        nearest, begin, last_x, last_z, holds, found = np.inf, 0.0, 0.0, depth[v, 0], False, False
        for u in range(depth.shape[1]):
            above = points[v, u, 1] - head[1]
            if not mask[v, u] or above <= lowest or above >= highest:
                continue
            x, z = points[v, u, 0] - head[0], depth[v, u]
            if not found or x - last_x > gap or abs(z - last_z) > step:
                begin, holds = x, False
            found, last_x, last_z = True, x, z
            if abs(x) < nearest:
                nearest, holds = abs(x), True
            if holds:
                widths[count] = x - begin
        count += int(found)
    return count
