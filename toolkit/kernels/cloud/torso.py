"""Mean shift and moments over the points of a cloud, compiled (Baak 2013, 5.3.4)."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def mean_shift(
    points: np.ndarray, centre: np.ndarray, inverse_axes: np.ndarray, tolerance: float, max_steps: int
) -> int:
    """Move `centre` (3,) to the mean of the points within an ellipsoid about it until it moves less than `tolerance`.

    `points` (N, 3) and `centre` in metres, `inverse_axes` (3,) the reciprocals of the half axes. Writes `centre`;
    returns the number of points in the last ellipsoid, 0 if it was empty (then `centre` stays where it was).
    """
    inside = 0
    for _ in range(max_steps):
        cx, cy, cz = centre[0], centre[1], centre[2]
        x = y = z = 0.0
        inside = 0
        for i in range(points.shape[0]):
            dx = points[i, 0] - cx
            dy = points[i, 1] - cy
            dz = points[i, 2] - cz
            a = dx * inverse_axes[0]
            b = dy * inverse_axes[1]
            c = dz * inverse_axes[2]
            if a * a + b * b + c * c <= 1.0:
                x += dx
                y += dy
                z += dz
                inside += 1
        if inside == 0:
            return 0
        x /= inside
        y /= inside
        z /= inside
        centre[0] += x
        centre[1] += y
        centre[2] += z
        if x * x + y * y + z * z < tolerance * tolerance:
            break
    return inside


@njit(cache=True)
def ball_moments(
    points: np.ndarray, centre: np.ndarray, radius: float, mean: np.ndarray, covariance: np.ndarray
) -> int:
    """Return the number of points within `radius` of `centre`; fill their mean (3,) and covariance (3, 3).

    Sums are taken about the centre, so that they keep their digits far from the origin.
    """
    count = 0
    mean[:] = 0.0
    covariance[:] = 0.0
    difference = np.empty(3)
    for i in range(points.shape[0]):
        for a in range(3):
            difference[a] = points[i, a] - centre[a]
        if difference[0] ** 2 + difference[1] ** 2 + difference[2] ** 2 >= radius * radius:
            continue
        count += 1
        for a in range(3):
            mean[a] += difference[a]
            for b in range(a + 1):
                covariance[a, b] += difference[a] * difference[b]
    if count == 0:
        return 0
    for a in range(3):
        mean[a] /= count
    for a in range(3):
        for b in range(a + 1):
            covariance[a, b] = covariance[a, b] / count - mean[a] * mean[b]
            covariance[b, a] = covariance[a, b]
    for a in range(3):
        mean[a] += centre[a]
    return count
