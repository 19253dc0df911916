"""Forward kinematics, linear blend skinning and their analytic Jacobians, compiled.

Rotations are exponential coordinates; `rotations[j]` and `origins[j]` place joint j's frame, which is aligned with the
body frame in the rest pose, so a point p of joint j moves to `rotations[j] @ (p - rest[j]) + origins[j]`.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def _series(x: float, y: float, z: float, first: float, second: float, out: np.ndarray) -> None:
    """Write `I + first [w]x + second [w]x^2` of w = (x, y, z) into `out` (3, 3)."""
    out[0, 0] = 1.0 - second * (y * y + z * z)
    out[1, 1] = 1.0 - second * (x * x + z * z)
    out[2, 2] = 1.0 - second * (x * x + y * y)
    out[0, 1] = second * x * y - first * z
    out[1, 0] = second * x * y + first * z
    out[0, 2] = second * x * z + first * y
    out[2, 0] = second * x * z - first * y
    out[1, 2] = second * y * z - first * x
    out[2, 1] = second * y * z + first * x


@njit(cache=True)
def rotation_from_vector(x: float, y: float, z: float, out: np.ndarray) -> None:
    """Write `exp([x, y, z])` into `out` (3, 3) by Rodrigues' formula."""
    t2 = x * x + y * y + z * z
    if t2 < 1e-12:
        a, b = 1.0 - t2 / 6.0, 0.5 - t2 / 24.0
    else:
        t = np.sqrt(t2)
        a, b = np.sin(t) / t, (1.0 - np.cos(t)) / t2
    _series(x, y, z, a, b, out)


@njit(cache=True)
def left_jacobian(x: float, y: float, z: float, out: np.ndarray) -> None:
    """Write the left Jacobian of the exponential map into `out` (3, 3): d exp(w) = [out dw]x exp(w)."""
    t2 = x * x + y * y + z * z
    if t2 < 1e-8:
        b, c = 0.5 - t2 / 24.0, 1.0 / 6.0 - t2 / 120.0
    else:
        t = np.sqrt(t2)
        b, c = (1.0 - np.cos(t)) / t2, (t - np.sin(t)) / (t2 * t)
    _series(x, y, z, b, c, out)


@njit(cache=True)
def local_vectors(pose: np.ndarray, dof_joint: np.ndarray, dof_axis: np.ndarray, out: np.ndarray) -> None:
    """Scatter `pose[3:]` to one rotation vector per joint, `out` (J, 3)."""
    out[:] = 0.0
    for d in range(dof_joint.shape[0]):
        out[dof_joint[d], dof_axis[d]] = pose[3 + d]


@njit(cache=True)
def forward_kinematics(
    pose: np.ndarray,
    parents: np.ndarray,
    rest: np.ndarray,
    dof_joint: np.ndarray,
    dof_axis: np.ndarray,
    vectors: np.ndarray,
    rotations: np.ndarray,
    origins: np.ndarray,
) -> None:
    """Place every joint: fills `vectors` (J, 3), `rotations` (J, 3, 3) and `origins` (J, 3)."""
    local_vectors(pose, dof_joint, dof_axis, vectors)
    local = np.empty((3, 3))
    for j in range(parents.shape[0]):
        p = parents[j]
        if p < 0:
            rotation_from_vector(vectors[j, 0], vectors[j, 1], vectors[j, 2], rotations[j])
            for a in range(3):
                origins[j, a] = pose[a]
            continue
        rotation_from_vector(vectors[j, 0], vectors[j, 1], vectors[j, 2], local)
        for a in range(3):
            origins[j, a] = origins[p, a]
            for b in range(3):
                origins[j, a] += rotations[p, a, b] * (rest[j, b] - rest[p, b])
                total = 0.0
                for c in range(3):
                    total += rotations[p, a, c] * local[c, b]
                rotations[j, a, b] = total


@njit(cache=True)
def world_axes(
    parents: np.ndarray,
    vectors: np.ndarray,
    rotations: np.ndarray,
    dof_joint: np.ndarray,
    dof_axis: np.ndarray,
    axes: np.ndarray,
) -> None:
    """Fill `axes` (D, 3) with the instantaneous rotation axis of every rotational pose entry.

    A change d of entry k turns everything below its joint by `d * axes[k]` about the joint's origin (thesis 6.2.2).
    """
    jacobian = np.empty((3, 3))
    previous = -1
    for k in range(dof_joint.shape[0]):
        j = dof_joint[k]
        if j != previous:
            left_jacobian(vectors[j, 0], vectors[j, 1], vectors[j, 2], jacobian)
            previous = j
        p = parents[j]
        for a in range(3):
            if p < 0:
                axes[k, a] = jacobian[a, dof_axis[k]]
            else:
                total = 0.0
                for b in range(3):
                    total += rotations[p, a, b] * jacobian[b, dof_axis[k]]
                axes[k, a] = total


@njit(cache=True)
def carry(joint: np.ndarray, offset: np.ndarray, rotations: np.ndarray, origins: np.ndarray, out: np.ndarray) -> None:
    """Place points that joints carry into `out` (N, 3): point n rests at `offset[n]` from joint `joint[n]`."""
    for n in range(joint.shape[0]):
        j = joint[n]
        for a in range(3):
            out[n, a] = origins[j, a]
            for k in range(3):
                out[n, a] += rotations[j, a, k] * offset[n, k]


@njit(cache=True)
def skin(
    points: np.ndarray,
    skin_joints: np.ndarray,
    skin_weights: np.ndarray,
    rest: np.ndarray,
    rotations: np.ndarray,
    origins: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fill `out` (V, 3) with rest `points` (V, 3) after linear blend skinning, up to S joints per point."""
    for v in range(points.shape[0]):
        x = y = z = 0.0
        for s in range(skin_joints.shape[1]):
            w = skin_weights[v, s]
            if w == 0.0:
                continue
            j = skin_joints[v, s]
            dx = points[v, 0] - rest[j, 0]
            dy = points[v, 1] - rest[j, 1]
            dz = points[v, 2] - rest[j, 2]
            r = rotations[j]
            x += w * (r[0, 0] * dx + r[0, 1] * dy + r[0, 2] * dz + origins[j, 0])
            y += w * (r[1, 0] * dx + r[1, 1] * dy + r[1, 2] * dz + origins[j, 1])
            z += w * (r[2, 0] * dx + r[2, 1] * dy + r[2, 2] * dz + origins[j, 2])
        out[v, 0] = x
        out[v, 1] = y
        out[v, 2] = z


@njit(cache=True)
def key_points(
    poses: np.ndarray,
    parents: np.ndarray,
    rest: np.ndarray,
    dof_joint: np.ndarray,
    dof_axis: np.ndarray,
    points: np.ndarray,
    skin_joints: np.ndarray,
    skin_weights: np.ndarray,
    mixed: np.ndarray,
    joints_out: np.ndarray,
    points_out: np.ndarray,
    mixed_out: np.ndarray,
) -> None:
    """Compute joint centres (N, J, 3), skinned points (N, V, 3) and weighted sums of them (N, R, 3) of many poses
    (N, P).

    `mixed` (R, K) are the weights of the sums: of the joints, then of the first points.
    """
    count = parents.shape[0]
    vectors = np.empty((count, 3))
    rotations = np.empty((count, 3, 3))
    for n in range(poses.shape[0]):
        forward_kinematics(poses[n], parents, rest, dof_joint, dof_axis, vectors, rotations, joints_out[n])
        skin(points, skin_joints, skin_weights, rest, rotations, joints_out[n], points_out[n])
        mixed_out[n] = 0.0
        for r in range(mixed.shape[0]):
            for k in range(mixed.shape[1]):
                if mixed[r, k] != 0.0:
                    source = joints_out[n, k] if k < count else points_out[n, k - count]
                    for a in range(3):
                        mixed_out[n, r, a] += mixed[r, k] * source[a]
