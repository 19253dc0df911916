"""Unit quaternions `w, x, y, z` as arrays (..., 4); `q` and `-q` are the same rotation.

A quaternion rotates local coordinates into world coordinates. `multiply(a, b)` applies `b` first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

IDENTITY: np.ndarray = np.array([1.0, 0.0, 0.0, 0.0])


def multiply(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the Hamilton product `first second`, float64 (..., 4)."""
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    aw, ax, ay, az = (first[..., k] for k in range(4))
    bw, bx, by, bz = (second[..., k] for k in range(4))
    out = np.empty(np.broadcast_shapes(first.shape, second.shape))
    out[..., 0] = aw * bw - ax * bx - ay * by - az * bz
    out[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    out[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    out[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return out


def conjugate(q: np.ndarray) -> np.ndarray:
    """Return the inverse rotation."""
    return np.asarray(q, np.float64) * (1.0, -1.0, -1.0, -1.0)


def normalised(q: np.ndarray) -> np.ndarray:
    """Return `q` with norm 1; a zero quaternion becomes NaN."""
    q = np.asarray(q, np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return q / np.linalg.norm(q, axis=-1, keepdims=True)


def exponential(vectors: ArrayLike) -> np.ndarray:
    """Return the quaternions (..., 4) of rotation vectors (..., 3), radians."""
    vectors = np.asarray(vectors, np.float64)
    half = 0.5 * np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * vectors * np.sinc(half / np.pi)], axis=-1)


def logarithm(q: np.ndarray) -> np.ndarray:
    """Return rotation vectors (..., 3) no longer than pi (thesis, Eq. 7.10, after `q` was made positive)."""
    q = np.asarray(q, np.float64)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    return q[..., 1:] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)


def angle(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the angle between two orientations in radians, 0 to pi (`d_quat`, thesis, Eq. 7.2).

    Computed from the chord, which is more accurate than the arc cosine of the equation.
    """
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    near, far = ((first - second) ** 2).sum(axis=-1), ((first + second) ** 2).sum(axis=-1)
    return 4.0 * np.arcsin(np.clip(0.5 * np.sqrt(np.minimum(near, far)), 0.0, 1.0))


def rotate(q: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return the vectors (..., 3) rotated by `q`."""
    q, v = np.asarray(q, np.float64), np.asarray(vectors, np.float64)
    twice = 2.0 * np.cross(q[..., 1:], v)
    return v + q[..., :1] * twice + np.cross(q[..., 1:], twice)


def matrices(q: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (..., 3, 3)."""
    return np.stack([rotate(q, axis) for axis in np.eye(3)], axis=-1)


def from_matrices(rotations: np.ndarray) -> np.ndarray:
    """Return the quaternions (..., 4) of rotation matrices (..., 3, 3), the real part not negative."""
    from scipy.spatial.transform import Rotation

    rotations = np.asarray(rotations, np.float64)
    q = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat()[:, [3, 0, 1, 2]]
    return np.where(q[:, :1] < 0.0, -q, q).reshape(*rotations.shape[:-2], 4)


def between(start: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """Return the smallest rotation (4,) of a unit vector (3,) onto another one.

    Opposite vectors are rotated about an arbitrary perpendicular axis.
    """
    start, stop = np.asarray(start, np.float64), np.asarray(stop, np.float64)
    if (cosine := float((start * stop).sum())) < -1.0 + 1e-9:
        axis = np.cross(start, np.eye(3)[np.abs(start).argmin()])
        return np.concatenate([[0.0], axis / np.linalg.norm(axis)])
    return normalised(np.concatenate([[1.0 + cosine], np.cross(start, stop)]))


def continuous(q: np.ndarray) -> np.ndarray:
    """Return a sequence (N, 4) without sign flips between neighbours."""
    q = np.asarray(q, np.float64)
    flips = (q[1:] * q[:-1]).sum(axis=-1) < 0.0
    signs = np.concatenate([[1.0], np.where(flips, -1.0, 1.0)]).cumprod()
    return q * signs[: len(q), None]


def interpolate(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Interpolate on the shorter arc from `first` to `second`, both (N, 4), by `share` (N,) in [0, 1]."""
    turn = logarithm(multiply(conjugate(first), second))
    return multiply(first, exponential(turn * np.asarray(share)[..., None]))


def mean(q: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the weighted chordal mean (4,) of orientations (N, 4): the first eigenvector of the sum of `w q q'`."""
    q = np.asarray(q, np.float64)
    return np.linalg.eigh(np.einsum("n,ni,nj->ij", weights, q, q))[1][:, -1]


def angular_velocity(q: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the rate of turn (N - 1, 3) between neighbours of (N, 4), rad/s, turning frame (thesis, Eq. A.14)."""
    return logarithm(multiply(conjugate(q[:-1]), q[1:])) / np.diff(times)[:, None]
