"""Cost of many poses of a body for one frame: placing, drawing, scoring (Qammaz, Eq. 2 to 6), compiled.

A position is a pose whose root turns relative to a reference orientation: `R_root = reference exp(position[3:6])`. So
the neighbourhood of any orientation is a box, and no rotation vector comes near its wrap at pi.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from toolkit.kernels.image.raster import NEAREST, project, rasterise
from toolkit.kernels.kinematics import forward_kinematics, skin


class Figure(NamedTuple):
    """A body as it is drawn: its balls, its triangles, or both; either may be empty.

    parents, dof_joint, dof_axis : int64 (J,), (D,), (D,), see `kinematics`; rest : float64 (J, 3), metres
    ball_joint : int64 (B,); ball_offset : float64 (B, 3), from that joint; ball_radius : float64 (B,), metres
    vertices : float64 (V, 3), rest; skin_joints, skin_weights : int64, float64 (V, S); faces : int64 (F, 3)
    """

    parents: np.ndarray
    dof_joint: np.ndarray
    dof_axis: np.ndarray
    rest: np.ndarray
    ball_joint: np.ndarray
    ball_offset: np.ndarray
    ball_radius: np.ndarray
    vertices: np.ndarray
    skin_joints: np.ndarray
    skin_weights: np.ndarray
    faces: np.ndarray


class View(NamedTuple):
    """The frame as a small image, and the transform of positions to it.

    from_level : R_camera_level, float64 (3, 3), of the root's place
    reference : R_camera_reference, float64 (3, 3), of the root's orientation
    intrinsics : float64 (4,), pixels; pixels need not be square
    depth : float64 (h, w), metres; 0 in free pixels (background), NaN in unobserved ones
    clamp : T, metres, maximum cost of a pixel; weight : w_D / N_P, 0 ignores the image
    """

    from_level: np.ndarray
    reference: np.ndarray
    intrinsics: np.ndarray
    depth: np.ndarray
    clamp: float
    weight: float


class Targets(NamedTuple):
    """Detected joints, camera frame.

    joint : int64 (K,), joint that carries each ball; offset : float64 (K, 3), from it in the rest pose, metres
    slopes : float64 (K, 2), x/z and y/z of the ray through it; distance : metres at which slopes are compared
    points : float64 (K, 3), metres
    weights_2d, weights_3d : float64 (K,), of the distances in the image (Eq. 4) and in space (Eq. 5)
    """

    joint: np.ndarray
    offset: np.ndarray
    slopes: np.ndarray
    distance: float
    points: np.ndarray
    weights_2d: np.ndarray
    weights_3d: np.ndarray


class Buffers(NamedTuple):
    """Working memory; see `buffers_for`."""

    vectors: np.ndarray
    turned: np.ndarray
    moved: np.ndarray
    rotations: np.ndarray
    origins: np.ndarray
    vertices: np.ndarray
    projected: np.ndarray
    triangle: np.ndarray
    inverse: np.ndarray
    columns: np.ndarray


def buffers_for(figure: Figure, shape: tuple[int, int]) -> Buffers:
    """Return working memory for a figure and an image of (h, w) pixels."""
    joints, count = len(figure.parents), len(figure.vertices)
    return Buffers(
        np.empty((joints, 3)), np.empty((joints, 3, 3)), np.empty((joints, 3)), np.empty((joints, 3, 3)),
        np.empty((joints, 3)), np.empty((count, 3)), np.empty((count, 3)),
        np.empty(shape, dtype=np.int32), np.empty(shape), np.empty(shape[1]),
    )  # fmt: skip


@njit(cache=True)
def place(position: np.ndarray, figure: Figure, view: View, buffers: Buffers) -> None:
    """Fill `rotations` and `origins` of the buffers with the joints of a position (P,), camera frame."""
    turned, moved = buffers.turned, buffers.moved
    rotations, origins = buffers.rotations, buffers.origins
    forward_kinematics(
        position, figure.parents, figure.rest, figure.dof_joint, figure.dof_axis, buffers.vectors, turned, moved
    )
    turn, level = view.reference, view.from_level
    x, y, z = moved[0, 0], moved[0, 1], moved[0, 2]
    for j in range(rotations.shape[0]):
        dx, dy, dz = moved[j, 0] - x, moved[j, 1] - y, moved[j, 2] - z
        for a in range(3):
            origins[j, a] = level[a, 0] * x + level[a, 1] * y + level[a, 2] * z
            origins[j, a] += turn[a, 0] * dx + turn[a, 1] * dy + turn[a, 2] * dz
            for b in range(3):
                rotations[j, a, b] = (
                    turn[a, 0] * turned[j, 0, b] + turn[a, 1] * turned[j, 1, b] + turn[a, 2] * turned[j, 2, b]
                )


@njit(cache=True)
def _draw_balls(figure: Figure, view: View, buffers: Buffers) -> None:
    """Draw balls where the pixels' rays meet them first: raise `inverse` of the buffers to 1/z."""
    rotations, origins, inverse = buffers.rotations, buffers.origins, buffers.inverse
    fx, fy, cx, cy = view.intrinsics[0], view.intrinsics[1], view.intrinsics[2], view.intrinsics[3]
    per_u, per_v = 1.0 / fx, 1.0 / fy
    height, width = inverse.shape
    for n in range(figure.ball_joint.shape[0]):
        j, radius = figure.ball_joint[n], figure.ball_radius[n]
        ox, oy, oz = figure.ball_offset[n, 0], figure.ball_offset[n, 1], figure.ball_offset[n, 2]
        x = origins[j, 0] + rotations[j, 0, 0] * ox + rotations[j, 0, 1] * oy + rotations[j, 0, 2] * oz
        y = origins[j, 1] + rotations[j, 1, 0] * ox + rotations[j, 1, 1] * oy + rotations[j, 1, 2] * oz
        z = origins[j, 2] + rotations[j, 2, 0] * ox + rotations[j, 2, 1] * oy + rotations[j, 2, 2] * oz
        if z <= radius + NEAREST:
            continue
        depth2 = z * z - radius * radius
        # Slopes of the planes through the camera's axes that touch the ball.
        wide, high = radius * np.sqrt(x * x + depth2), radius * np.sqrt(y * y + depth2)
        u0 = max(0, int(np.ceil(fx * (x * z - wide) / depth2 + cx)))
        u1 = min(width - 1, int(np.floor(fx * (x * z + wide) / depth2 + cx)))
        v0 = max(0, int(np.ceil(fy * (y * z - high) / depth2 + cy)))
        v1 = min(height - 1, int(np.floor(fy * (y * z + high) / depth2 + cy)))
        power = x * x + y * y + depth2
        share = 1.0 / power
        for v in range(v0, v1 + 1):
            dy = (v - cy) * per_v
            along, square = y * dy + z, (dy * dy + 1.0) * power
            for u in range(u0, u1 + 1):
                dx = (u - cx) * per_u
                dot = x * dx + along
                inside = dot * dot - (dx * dx * power + square)
                w = (dot + np.sqrt(max(inside, 0.0))) * share if inside > 0.0 else 0.0
                inverse[v, u] = max(inverse[v, u], w)


@njit(cache=True)
def draw(figure: Figure, view: View, buffers: Buffers) -> None:
    """Draw the placed figure: `inverse` of the buffers becomes 1/z, 0 in the background."""
    buffers.inverse[:] = 0.0
    if figure.faces.shape[0]:
        skin(
            figure.vertices, figure.skin_joints, figure.skin_weights, figure.rest, buffers.rotations, buffers.origins,
            buffers.vertices,
        )  # fmt: skip
        project(buffers.vertices, view.intrinsics, buffers.projected)
        rasterise(buffers.projected, figure.faces, buffers.inverse, buffers.triangle)
    _draw_balls(figure, view, buffers)


@njit(cache=True, error_model="numpy")
def depth_cost(depth: np.ndarray, inverse: np.ndarray, clamp: float, columns: np.ndarray) -> float:
    """Return the sum of Qammaz, Eq. 3, metres; a pixel of only the person or only the figure costs the clamp.

    `columns` (w,) is working memory: sums that do not wait for each other, in a fixed order.
    """
    columns[:] = 0.0
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            seen, w = depth[v, u], inverse[v, u]
            gap = min(abs(seen - 1.0 / w), clamp)  # 1 / 0 is infinite: a person's pixel without the figure
            free = clamp if seen == 0.0 and w > 0.0 else 0.0
            columns[u] += gap if seen > 0.0 else free
    total = 0.0
    for u in range(columns.shape[0]):
        total += columns[u]
    return total


@njit(cache=True)
def joint_cost(targets: Targets, buffers: Buffers) -> float:
    """Return the weighted distances of the placed joints from the detected ones (Qammaz, Eq. 4 to 6), metres."""
    rotations, origins = buffers.rotations, buffers.origins
    total = 0.0
    for k in range(targets.joint.shape[0]):
        j = targets.joint[k]
        ox, oy, oz = targets.offset[k, 0], targets.offset[k, 1], targets.offset[k, 2]
        x = origins[j, 0] + rotations[j, 0, 0] * ox + rotations[j, 0, 1] * oy + rotations[j, 0, 2] * oz
        y = origins[j, 1] + rotations[j, 1, 0] * ox + rotations[j, 1, 1] * oy + rotations[j, 1, 2] * oz
        z = origins[j, 2] + rotations[j, 2, 0] * ox + rotations[j, 2, 1] * oy + rotations[j, 2, 2] * oz
        if targets.weights_2d[k] > 0.0:
            front = max(z, NEAREST)
            du, dv = x / front - targets.slopes[k, 0], y / front - targets.slopes[k, 1]
            total += targets.weights_2d[k] * targets.distance * np.sqrt(du * du + dv * dv)
        if targets.weights_3d[k] > 0.0:
            dx, dy, dz = x - targets.points[k, 0], y - targets.points[k, 1], z - targets.points[k, 2]
            total += targets.weights_3d[k] * np.sqrt(dx * dx + dy * dy + dz * dz)
    return total


@njit(cache=True)
def discrepancies(
    positions: np.ndarray,
    figure: Figure,
    view: View,
    targets: Targets,
    buffers: Buffers,
    out: np.ndarray,
) -> None:
    """Compute the costs of `positions` (N, P) (Qammaz, Eq. 2): fills `out` (N,), metres."""
    for n in range(positions.shape[0]):
        place(positions[n], figure, view, buffers)
        out[n] = joint_cost(targets, buffers)
        if view.weight > 0.0:
            draw(figure, view, buffers)
            out[n] += view.weight * depth_cost(view.depth, buffers.inverse, view.clamp, buffers.columns)


@njit(cache=True)
def move(
    positions: np.ndarray,
    velocities: np.ndarray,
    own: np.ndarray,
    best: np.ndarray,
    chances: np.ndarray,
    pulls: np.ndarray,
    limits: np.ndarray,
) -> None:
    """Advance a swarm by one generation, in place (Qammaz, Eq. 7 and 8), within the limits.

    Parameters
    ----------
    positions, velocities, own : float64 (N, D), where each particle is, how it moves, and its own best position
    best : float64 (D,), the best position of all
    chances : float64 (2, N, D), r1 and r2 of Eq. 7
    pulls : float64 (3,), c1, c2 and the constriction w
    limits : float64 (D, 2)
    """
    for i in range(len(positions)):
        for k in range(len(best)):
            here = positions[i, k]
            pull = pulls[0] * chances[0, i, k] * (own[i, k] - here) + pulls[1] * chances[1, i, k] * (best[k] - here)
            speed = pulls[2] * (velocities[i, k] + pull)
            speed = min(max(speed, limits[k, 0] - here), limits[k, 1] - here)
            velocities[i, k] = speed
            positions[i, k] = min(max(here + speed, limits[k, 0]), limits[k, 1])
