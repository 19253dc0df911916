"""A body placed before a camera and drawn into a small z-buffer, each in one call, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels.image.raster import project, rasterise
from toolkit.kernels.kinematics import forward_kinematics, world_axes


@njit(cache=True)
def place(
    pose: np.ndarray,
    parents: np.ndarray,
    rest: np.ndarray,
    dof_joint: np.ndarray,
    dof_axis: np.ndarray,
    turn: np.ndarray,
    points: np.ndarray,
    normals: np.ndarray,
    skin_joints: np.ndarray,
    skin_weights: np.ndarray,
    rotations: np.ndarray,
    origins: np.ndarray,
    axes: np.ndarray,
    points_out: np.ndarray,
    normals_out: np.ndarray,
) -> None:
    """Place and skin a body in one pose (linear blend skinning), turned by `turn` (3, 3), R_camera_level.

    Rotate placed joints and axes by `turn` (3, 3), R_camera_level.
    """
    joints = parents.shape[0]
    vectors, level, centres = np.empty((joints, 3)), np.empty((joints, 3, 3)), np.empty((joints, 3))
    level_axes = np.empty(axes.shape)
    forward_kinematics(pose, parents, rest, dof_joint, dof_axis, vectors, level, centres)
    world_axes(parents, vectors, level, dof_joint, dof_axis, level_axes)
    to_camera(turn, level, centres, level_axes, rotations, origins, axes)
    skin_surface(points, normals, skin_joints, skin_weights, rest, rotations, origins, points_out, normals_out)


@njit(cache=True)
def to_camera(
    turn: np.ndarray,
    rotations: np.ndarray,
    origins: np.ndarray,
    axes: np.ndarray,
    rotations_camera: np.ndarray,
    origins_camera: np.ndarray,
    axes_camera: np.ndarray,
) -> None:
    """Turn placed joints and axes by `turn` (3, 3), R_camera_level."""
    for j in range(origins.shape[0]):
        for a in range(3):
            total = 0.0
            for c in range(3):
                total += turn[a, c] * origins[j, c]
                value = 0.0
                for b in range(3):
                    value += turn[a, b] * rotations[j, b, c]
                rotations_camera[j, a, c] = value
            origins_camera[j, a] = total
    for k in range(axes.shape[0]):
        for a in range(3):
            axes_camera[k, a] = turn[a, 0] * axes[k, 0] + turn[a, 1] * axes[k, 1] + turn[a, 2] * axes[k, 2]


@njit(cache=True)
def skin_surface(
    points: np.ndarray,
    normals: np.ndarray,
    skin_joints: np.ndarray,
    skin_weights: np.ndarray,
    rest: np.ndarray,
    rotations: np.ndarray,
    origins: np.ndarray,
    points_out: np.ndarray,
    normals_out: np.ndarray,
) -> None:
    """Skin rest `points` and `normals` (V, 3) by one blended motion per vertex (linear blend skinning).

    Fills `points_out` and the unit `normals_out` (V, 3).
    """
    offsets = np.empty(origins.shape)  # of the motion x -> R x + offset of each joint
    for j in range(origins.shape[0]):
        for a in range(3):
            offsets[j, a] = origins[j, a]
            for b in range(3):
                offsets[j, a] -= rotations[j, a, b] * rest[j, b]
    for v in range(points.shape[0]):
        r00 = r01 = r02 = r10 = r11 = r12 = r20 = r21 = r22 = t0 = t1 = t2 = 0.0
        for s in range(skin_joints.shape[1]):
            w = skin_weights[v, s]
            if w == 0.0:
                continue
            j = skin_joints[v, s]
            r, t = rotations[j], offsets[j]
            r00 += w * r[0, 0]
            r01 += w * r[0, 1]
            r02 += w * r[0, 2]
            r10 += w * r[1, 0]
            r11 += w * r[1, 1]
            r12 += w * r[1, 2]
            r20 += w * r[2, 0]
            r21 += w * r[2, 1]
            r22 += w * r[2, 2]
            t0 += w * t[0]
            t1 += w * t[1]
            t2 += w * t[2]
        x, y, z = points[v, 0], points[v, 1], points[v, 2]
        points_out[v, 0] = r00 * x + r01 * y + r02 * z + t0
        points_out[v, 1] = r10 * x + r11 * y + r12 * z + t1
        points_out[v, 2] = r20 * x + r21 * y + r22 * z + t2
        x, y, z = normals[v, 0], normals[v, 1], normals[v, 2]
        nx, ny, nz = r00 * x + r01 * y + r02 * z, r10 * x + r11 * y + r12 * z, r20 * x + r21 * y + r22 * z
        inverse = 1.0 / max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
        normals_out[v, 0] = nx * inverse
        normals_out[v, 1] = ny * inverse
        normals_out[v, 2] = nz * inverse


@njit(cache=True)
def draw(
    points: np.ndarray, faces: np.ndarray, intrinsics: np.ndarray, height: int, width: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw a mesh: return the part of an image of `height` times `width` pixels that contains it.

    Returns
    -------
    depth float64 (h, w), metres, 0 where nothing is; triangle int32 (h, w), -1 there; and the intrinsics (4,) of that
    part.
    """
    projected = np.empty(points.shape)
    project(points, intrinsics, projected)
    left, right, top, bottom = float(width), -1.0, float(height), -1.0
    for n in range(points.shape[0]):
        if projected[n, 2] > 0.0:
            left, right = min(left, np.floor(projected[n, 0])), max(right, np.ceil(projected[n, 0]))
            top, bottom = min(top, np.floor(projected[n, 1])), max(bottom, np.ceil(projected[n, 1]))
    left, right, top, bottom = max(left, 0.0), min(right, width - 1.0), max(top, 0.0), min(bottom, height - 1.0)
    part = intrinsics.copy()
    part[2] -= left
    part[3] -= top
    for n in range(points.shape[0]):
        projected[n, 0] -= left
        projected[n, 1] -= top
    shape = (int(max(bottom - top + 1.0, 0.0)), int(max(right - left + 1.0, 0.0)))
    depth, triangle = np.empty(shape), np.empty(shape, dtype=np.int32)
    rasterise(projected, faces, depth, triangle)
    for v in range(shape[0]):
        for u in range(shape[1]):
            if depth[v, u] > 0.0:
                depth[v, u] = 1.0 / depth[v, u]
    return depth, triangle, part
