"""Unit quaternions `w, x, y, z` as arrays (..., 4); `q` and `-q` are the same rotation.

A quaternion rotates local coordinates into world coordinates. `multiply(a, b)` applies `b` first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


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
