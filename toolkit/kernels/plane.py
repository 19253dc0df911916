"""The plane with the most points near it, by random sampling (Fischler 1981), compiled.

Open3D's search for planes answers differently from call to call with one seed and the same points, which is why it is
not used.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels import linear


def largest_plane(
    points: np.ndarray, tolerance: float, trials: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The plane through three of the points that most of them are near, fitted to these by least squares.

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
    members = np.zeros(len(rows), dtype=np.bool_)
    _widest_support(rows, rng.integers(len(rows), size=(trials, 3)), tolerance, members)
    found = np.flatnonzero(members)
    if len(found) < 3:
        return np.zeros(4), found
    mean, covariance = linear.moments(rows[found])
    normal = linear.principal_axes(covariance)[1][:, 0]
    return np.append(normal, -linear.dot(normal, mean)), found


@njit(cache=True)
def _widest_support(points: np.ndarray, triples: np.ndarray, tolerance: float, members: np.ndarray) -> None:
    """Mark in `members` (N,) the points within `tolerance` of the plane, of those through `triples` (T, 3), that has
    the most of them; the first of equals.
    """
    best = 0
    chosen = np.zeros(4)
    plane = np.empty(4)
    for t in range(triples.shape[0]):
        if not _plane_through(points, triples[t], plane):
            continue
        near = 0
        for n in range(points.shape[0]):
            height = plane[0] * points[n, 0] + plane[1] * points[n, 1] + plane[2] * points[n, 2] + plane[3]
            near += abs(height) < tolerance
        if near > best:
            best = near
            chosen[:] = plane
    if best == 0:
        return
    for n in range(points.shape[0]):
        height = chosen[0] * points[n, 0] + chosen[1] * points[n, 1] + chosen[2] * points[n, 2] + chosen[3]
        members[n] = abs(height) < tolerance


@njit(cache=True)
def _plane_through(points: np.ndarray, triple: np.ndarray, plane: np.ndarray) -> bool:
    """The plane (4,) through three points; False where they lie on a line."""
    a, b, c = points[triple[0]], points[triple[1]], points[triple[2]]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = np.sqrt(x * x + y * y + z * z)
    if length < 1e-12:
        return False
    plane[0], plane[1], plane[2] = x / length, y / length, z / length
    plane[3] = -(plane[0] * a[0] + plane[1] * a[1] + plane[2] * a[2])
    return True
