"""Rotation matrices from Euler angles, compiled: motion files hold many short series of them."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def euler_matrices(axes: np.ndarray, intrinsic: bool, angles: np.ndarray) -> np.ndarray:
    """Rotations float64 (N, 3, 3) from angles (N, K), radians, about the coordinate axes (K,), numbers 0 to 2.

    With `intrinsic` each axis is turned by the rotations before it, else all stay fixed. The angles are joined as unit
    quaternions, in the order of operations of SciPy's `Rotation.from_euler`, whose bits these are.
    """
    out = np.empty((angles.shape[0], 3, 3))
    total, one = np.empty(4), np.empty(4)
    for n in range(angles.shape[0]):
        for k in range(axes.size):
            one[:] = 0.0
            one[axes[k]] = np.sin(angles[n, k] / 2.0)
            one[3] = np.cos(angles[n, k] / 2.0)
            if k == 0:
                total[:] = one
            elif intrinsic:
                _compose(total, one, total)
            else:
                _compose(one, total, total)
        _matrix(total, out[n])
    return out


@njit(cache=True)
def _compose(p: np.ndarray, q: np.ndarray, out: np.ndarray) -> None:
    """Product of quaternions (x, y, z, w); `out` may be one of them."""
    x = p[3] * q[0] + q[3] * p[0] + (p[1] * q[2] - p[2] * q[1])
    y = p[3] * q[1] + q[3] * p[1] + (p[2] * q[0] - p[0] * q[2])
    z = p[3] * q[2] + q[3] * p[2] + (p[0] * q[1] - p[1] * q[0])
    w = p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2]
    out[0], out[1], out[2], out[3] = x, y, z, w


@njit(cache=True)
def _matrix(quaternion: np.ndarray, out: np.ndarray) -> None:
    """Rotation matrix (3, 3) of a unit quaternion (x, y, z, w)."""
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
