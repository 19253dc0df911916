"""Skinning by dual quaternions, which keeps the volume of a twist (Kavan 2008; Qammaz, 3.1)."""

import numpy as np
from numba import njit

from toolkit.body.body import Body


@njit(cache=True)
def skin_dual(
    points: np.ndarray,
    skin_joints: np.ndarray,
    skin_weights: np.ndarray,
    rest_joints: np.ndarray,
    rotations: np.ndarray,
    origins: np.ndarray,
    out: np.ndarray,
) -> None:
    """Blend rigid motions as unit dual quaternions: arguments as `kinematics.skin`; fills `out` (V, 3)."""
    count = rotations.shape[0]
    real, dual, offset = np.empty((count, 4)), np.empty((count, 4)), np.empty(3)
    for j in range(count):
        for a in range(3):
            offset[a] = origins[j, a]
            for b in range(3):
                offset[a] -= rotations[j, a, b] * rest_joints[j, b]
        quaternion_of(rotations[j], real[j])
        _dual_part(real[j], offset, dual[j])
    r, d = np.empty(4), np.empty(4)
    for n in range(points.shape[0]):
        r[:] = 0.0
        d[:] = 0.0
        first = real[skin_joints[n, 0]]
        for s in range(skin_joints.shape[1]):
            j, weight = skin_joints[n, s], skin_weights[n, s]
            if first[0] * real[j, 0] + first[1] * real[j, 1] + first[2] * real[j, 2] + first[3] * real[j, 3] < 0.0:
                weight = -weight  # q and -q are one rotation; blend along the shorter arc
            for a in range(4):
                r[a] += weight * real[j, a]
                d[a] += weight * dual[j, a]
        length = np.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3])
        for a in range(4):
            r[a] /= length
            d[a] /= length
        _moved(points[n], r, d, out[n])


@njit(cache=True)
def quaternion_of(rotation: np.ndarray, out: np.ndarray) -> None:
    """Fill `out` (4,) with the unit quaternion w, x, y, z of a rotation (3, 3), by its largest component."""
    trace = rotation[0, 0] + rotation[1, 1] + rotation[2, 2]
    largest, most = -1, trace
    for a in range(3):
        if rotation[a, a] > most:
            largest, most = a, rotation[a, a]
    if largest < 0:
        root = np.sqrt(1.0 + trace)
        out[0] = 0.5 * root
        out[1] = 0.5 * (rotation[2, 1] - rotation[1, 2]) / root
        out[2] = 0.5 * (rotation[0, 2] - rotation[2, 0]) / root
        out[3] = 0.5 * (rotation[1, 0] - rotation[0, 1]) / root
        return
    a, b, c = largest, (largest + 1) % 3, (largest + 2) % 3
    root = np.sqrt(1.0 + rotation[a, a] - rotation[b, b] - rotation[c, c])
    out[0] = 0.5 * (rotation[c, b] - rotation[b, c]) / root
    out[1 + a] = 0.5 * root
    out[1 + b] = 0.5 * (rotation[b, a] + rotation[a, b]) / root
    out[1 + c] = 0.5 * (rotation[c, a] + rotation[a, c]) / root


@njit(cache=True)
def _dual_part(real: np.ndarray, offset: np.ndarray, out: np.ndarray) -> None:
    """Compute half the product of the pure quaternion `offset` (3,) and `real` (4,)."""
    w, x, y, z = real[0], real[1], real[2], real[3]
    t, u, v = offset[0], offset[1], offset[2]
    out[0] = -0.5 * (t * x + u * y + v * z)
    out[1] = 0.5 * (t * w + u * z - v * y)
    out[2] = 0.5 * (u * w + v * x - t * z)
    out[3] = 0.5 * (v * w + t * y - u * x)


@njit(cache=True)
def _moved(point: np.ndarray, r: np.ndarray, d: np.ndarray, out: np.ndarray) -> None:
    """Rotate a point (3,) by `r` and translate it by twice `d` times the conjugate of `r`."""
    w, x, y, z = r[0], r[1], r[2], r[3]
    cx = y * point[2] - z * point[1] + w * point[0]
    cy = z * point[0] - x * point[2] + w * point[1]
    cz = x * point[1] - y * point[0] + w * point[2]
    out[0] = point[0] + 2.0 * (y * cz - z * cy) + 2.0 * (w * d[1] - d[0] * x + y * d[3] - z * d[2])
    out[1] = point[1] + 2.0 * (z * cx - x * cz) + 2.0 * (w * d[2] - d[0] * y + z * d[1] - x * d[3])
    out[2] = point[2] + 2.0 * (x * cy - y * cx) + 2.0 * (w * d[3] - d[0] * z + x * d[2] - y * d[1])


def dual_skinning(body: Body, pose: np.ndarray) -> np.ndarray:
    """Return the mesh (V, 3) of a pose (P,) by dual quaternions (Kavan 2008; Qammaz, 3.1)."""
    placed, out = body.place(pose), np.empty_like(body.vertices)
    skin_dual(body.vertices, body.skin_joints, body.skin_weights, body.joints, placed.rotations, placed.origins, out)
    return out
