"""Planes through a cloud by random triples of its points (Fischler 1981), compiled.

Open3D's plane search is not deterministic for a fixed seed, so it is not used.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels import linear


def largest_plane(
    points: np.ndarray, tolerance: float, trials: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return the plane through three of the points with most inliers, refined by least squares.

    Parameters
    ----------
    points : (N, 3), metres, N at least 3
    tolerance : metres from the plane within which a point is near
    trials : planes that are tried

    Returns
    -------
    plane : float64 (4,), unit normal and offset: `plane[:3] @ p + plane[3]` is 0 for points p on it; zeros where all
        points that were tried lie on lines
    members : int64 (M,), rising, the points near it before the fit
    """
    rows = np.ascontiguousarray(points, dtype=np.float64)
    triples = rng.integers(len(rows), size=(trials, 3))
    plane = np.zeros(4)
    if best_plane(rows, np.full(len(rows), tolerance), np.ones(len(rows)), triples, plane) == 0.0:
        return np.zeros(4), np.empty(0, dtype=np.int64)
    members = np.flatnonzero(np.abs(linear.times(rows, plane[:3]) + plane[3]) <= tolerance)
    mean, covariance = linear.moments(rows[members])
    normal = linear.principal_axes(covariance)[1][:, 0]
    return np.append(normal, -linear.dot(normal, mean)), members


@njit(cache=True)
def best_plane(
    points: np.ndarray, tolerances: np.ndarray, weights: np.ndarray, triples: np.ndarray, plane: np.ndarray
) -> float:
    """Return the plane through three points with the largest weight of inliers (RANSAC without local optimisation).

    Parameters
    ----------
    points : float64 (N, 3), metres
    tolerances : float64 (N,), metres within which a point lies on a plane
    weights : float64 (N,), weight of a point on the plane
    triples : int64 (K, 3), rows of `points`; degenerate ones are skipped
    plane : float64 (4,); becomes the normal of length 1 and the offset d of `n . p + d = 0`

    Returns
    -------
    The weight of the points on it, 0 where no triple spans a plane. The first triple wins a tie.
    """
    best = 0.0
    x, y, z = points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy()
    heaviest = weights.max() * (1.0 + 1e-9)  # more than the rounding of the sum
    for k in range(triples.shape[0]):
        a, b, c = triples[k, 0], triples[k, 1], triples[k, 2]
        ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        wx, wy, wz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if length < 1e-6:
            continue
        nx, ny, nz = nx / length, ny / length, nz / length
        d = -(nx * points[a, 0] + ny * points[a, 1] + nz * points[a, 2])
        count = 0
        for i in range(x.size):  # vectorised, unlike the sum of the weights, which has a fixed order
            count += abs(nx * x[i] + ny * y[i] + nz * z[i] + d) <= tolerances[i]
        if count * heaviest < best:
            continue
        total = 0.0
        for i in range(x.size):
            if abs(nx * x[i] + ny * y[i] + nz * z[i] + d) <= tolerances[i]:
                total += weights[i]
        if total > best:
            best = total
            plane[0], plane[1], plane[2], plane[3] = nx, ny, nz, d
    return best
