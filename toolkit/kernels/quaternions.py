"""Rotations of many poses as unit quaternions (x, y, z, w), compiled.

The operations run in the order of SciPy's `Rotation`, with equal bits. SciPy takes 30 times as long for one pose, and
0.2 s to be imported.
"""

from __future__ import annotations

import numpy as np
from numba import njit

SMALL = 1e-3
"""Angle below which series replace the quotients, radians."""


@njit(cache=True)
def of_vector(vector: np.ndarray, out: np.ndarray) -> None:
    """Write the quaternion of a rotation vector (3,) into `out` (4,)."""
    angle = np.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    if angle <= SMALL:
        square = angle * angle
        scale = 0.5 - square / 48.0 + square * square / 3840.0
    else:
        scale = np.sin(angle / 2.0) / angle
    out[0], out[1], out[2] = scale * vector[0], scale * vector[1], scale * vector[2]
    out[3] = np.cos(angle / 2.0)


@njit(cache=True)
def compose(p: np.ndarray, q: np.ndarray, out: np.ndarray) -> None:
    """Write the product of two quaternions into `out`, which may be one of them."""
    x = p[3] * q[0] + q[3] * p[0] + (p[1] * q[2] - p[2] * q[1])
    y = p[3] * q[1] + q[3] * p[1] + (p[2] * q[0] - p[0] * q[2])
    z = p[3] * q[2] + q[3] * p[2] + (p[0] * q[1] - p[1] * q[0])
    w = p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2]
    out[0], out[1], out[2], out[3] = x, y, z, w


@njit(cache=True)
def normalise(quaternion: np.ndarray) -> None:
    """Scale a quaternion to the length 1, in place."""
    x, y, z, w = quaternion
    length = np.sqrt(x * x + y * y + z * z + w * w)
    for k in range(4):
        quaternion[k] /= length


@njit(cache=True)
def matrix(quaternion: np.ndarray, out: np.ndarray) -> None:
    """Write the rotation matrix of a quaternion into `out` (3, 3)."""
    x, y, z, w = quaternion
    x2, y2, z2, w2 = x * x, y * y, z * z, w * w
    xy, zw, xz, yw, yz, xw = x * y, z * w, x * z, y * w, y * z, x * w
    out[0, 0] = x2 - y2 - z2 + w2
    out[1, 0] = 2.0 * (xy + zw)
    out[2, 0] = 2.0 * (xz - yw)
    out[0, 1] = 2.0 * (xy - zw)
    out[1, 1] = -x2 + y2 - z2 + w2
    out[2, 1] = 2.0 * (yz + xw)
    out[0, 2] = 2.0 * (xz + yw)
    out[1, 2] = 2.0 * (yz - xw)
    out[2, 2] = -x2 - y2 + z2 + w2


@njit(cache=True)
def to_vector(quaternion: np.ndarray, out: np.ndarray) -> None:
    """Write the rotation vector of a quaternion, no longer than pi, into `out` (3,)."""
    x, y, z, w = quaternion
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    angle = 2.0 * np.arctan2(np.sqrt(x * x + y * y + z * z), w)
    if angle <= SMALL:
        square = angle * angle
        scale = 2.0 + square / 12.0 + 7.0 * square * square / 2880.0
    else:
        scale = angle / np.sin(angle / 2.0)
    out[0], out[1], out[2] = scale * x, scale * y, scale * z


@njit(cache=True)
def turned_vectors(yaws: np.ndarray, vectors: np.ndarray, out: np.ndarray) -> None:
    """Write rotation vectors (N, 3), followed by rotations `yaws` (N,) about +y, into `out` (N, 3)."""
    turn, q = np.empty(4), np.empty(4)
    about_up = np.zeros(3)
    for n in range(vectors.shape[0]):
        about_up[1] = yaws[n]
        of_vector(about_up, turn)
        of_vector(vectors[n], q)
        compose(turn, q, q)
        normalise(q)
        to_vector(q, out[n])


@njit(cache=True)
def lateral_axes(poses: np.ndarray, chain: np.ndarray, out: np.ndarray) -> None:
    """Write the sum of the left axes of the first and of the last joint of a chain into `out` (N, 3).

    Parameters
    ----------
    poses : float64 (N, P)
    chain : int64 (J, 3), pose entries of each joint's rotation vector, the root first
    """
    total, one, vector, rotation = np.empty(4), np.empty(4), np.empty(3), np.empty((3, 3))
    for n in range(poses.shape[0]):
        for j in range(chain.shape[0]):
            for a in range(3):
                vector[a] = poses[n, chain[j, a]]
            of_vector(vector, one)
            if j == 0:
                total[:] = one
                matrix(total, rotation)
                out[n] = rotation[:, 0]
            else:
                compose(total, one, total)
                normalise(total)
        matrix(total, rotation)
        out[n] += rotation[:, 0]
