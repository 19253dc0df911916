"""Cost of particles for a depth image, and resampling, compiled (Lopez-Mendez 2011, 2.1).

The paper draws the whole model for each particle. Here a trunk is drawn for each particle of the first layer. For an
arm a few trunks are kept as *bases*, and each particle draws its arms over one of them as balls: its cost is that of
the base plus the change in the pixels of its balls. The sum equals the cost of the whole picture.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from toolkit.kernels.fit.placing import draw as draw_mesh
from toolkit.kernels.image.raster import NEAREST
from toolkit.kernels.kinematics import carry, forward_kinematics, skin


class Tile(NamedTuple):
    """Image window of a layer, and its weights.

    seen : float32 (H, W), metres, 0 where no person is, NaN where nothing was observed
    intrinsics : float64 (4,)
    window : int64 (4,), rows v0 to v1 and columns u0 to u1, ends excluded, within the image
    pixels : measured pixels in the window, at least 1; costs are per measured pixel
    cap : metres, the largest difference of depths that counts (`d_max`)
    depth, silhouette : weights of the two terms (`lambda_1`, `lambda_2`)
    """

    seen: np.ndarray
    intrinsics: np.ndarray
    window: np.ndarray
    pixels: int
    cap: float
    depth: float
    silhouette: float


class Rig(NamedTuple):
    """Drawn part of a body, and its ball model.

    parents, rest, dof_joint, dof_axis : those of the kinematic chain, as in `kinematics.forward_kinematics`
    vertices, skin_joints, skin_weights, faces : drawn part of the mesh, int64 faces
    ball_joint, ball_offset, radii : balls (B,) of the upper body, see `fitting.balls`
    from_level : float64 (3, 3), R_camera_level
    """

    parents: np.ndarray
    rest: np.ndarray
    dof_joint: np.ndarray
    dof_axis: np.ndarray
    vertices: np.ndarray
    skin_joints: np.ndarray
    skin_weights: np.ndarray
    faces: np.ndarray
    ball_joint: np.ndarray
    ball_offset: np.ndarray
    radii: np.ndarray
    from_level: np.ndarray


@njit(cache=True)
def pixel_cost(drawn: float, seen: float, tile: Tile) -> float:
    """Return the cost of one pixel: both terms of Eq. 3 (`c_d` and `c_f`), not yet per measured pixel.

    The squared depth difference is at most 1, at the cap, and 1 for a measured pixel without model; the silhouette term
    counts pixels in exactly one silhouette. Unobserved pixels have no cost.
    """
    if np.isnan(seen):
        return 0.0
    if seen > 0.0:
        if drawn <= 0.0:
            return tile.depth + tile.silhouette
        gap = min(abs(drawn - seen) / tile.cap, 1.0)
        return tile.depth * gap * gap
    return tile.silhouette if drawn > 0.0 else 0.0


@njit(cache=True)
def picture_cost(drawn: np.ndarray, tile: Tile) -> float:
    """Return the cost of a drawn picture (H, W), metres, 0 in the background, within the tile's window."""
    total = 0.0
    for v in range(tile.window[0], tile.window[1]):
        for u in range(tile.window[2], tile.window[3]):
            total += pixel_cost(drawn[v, u], tile.seen[v, u], tile)
    return total / tile.pixels


@njit(cache=True)
def _turn(rotation: np.ndarray, points: np.ndarray) -> None:
    """Turn `points` (N, 3) by `rotation` (3, 3), in place."""
    for n in range(points.shape[0]):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        for a in range(3):
            points[n, a] = rotation[a, 0] * x + rotation[a, 1] * y + rotation[a, 2] * z


@njit(cache=True)
def place_balls(poses: np.ndarray, rig: Rig, balls: np.ndarray) -> None:
    """Fill `balls` (N, B, 3), camera frame, with those of every pose (N, P), level frame."""
    joints = rig.parents.shape[0]
    vectors, origins, rotations = np.empty((joints, 3)), np.empty((joints, 3)), np.empty((joints, 3, 3))
    for n in range(poses.shape[0]):
        forward_kinematics(poses[n], rig.parents, rig.rest, rig.dof_joint, rig.dof_axis, vectors, rotations, origins)
        carry(rig.ball_joint, rig.ball_offset, rotations, origins, balls[n])
        _turn(rig.from_level, balls[n])


@njit(cache=True)
def draw(pose: np.ndarray, rig: Rig, intrinsics: np.ndarray, depth: np.ndarray) -> None:
    """Draw the rig's mesh in a pose (P,) into `depth` (H, W), metres, 0 where nothing is."""
    joints = rig.parents.shape[0]
    vectors, origins, rotations = np.empty((joints, 3)), np.empty((joints, 3)), np.empty((joints, 3, 3))
    forward_kinematics(pose, rig.parents, rig.rest, rig.dof_joint, rig.dof_axis, vectors, rotations, origins)
    points = np.empty_like(rig.vertices)
    skin(rig.vertices, rig.skin_joints, rig.skin_weights, rig.rest, rotations, origins, points)
    _turn(rig.from_level, points)
    part, _, own = draw_mesh(points, rig.faces, intrinsics, depth.shape[0], depth.shape[1])
    left, top = int(np.rint(intrinsics[2] - own[2])), int(np.rint(intrinsics[3] - own[3]))
    depth[:] = 0.0
    depth[top : top + part.shape[0], left : left + part.shape[1]] = part


@njit(cache=True)
def trunk_costs(poses: np.ndarray, rig: Rig, tile: Tile, costs: np.ndarray) -> None:
    """Fill `costs` (N,) with those of the rig's mesh in every pose (N, P)."""
    depth = np.empty(tile.seen.shape)
    for n in range(poses.shape[0]):
        draw(poses[n], rig, tile.intrinsics, depth)
        costs[n] = picture_cost(depth, tile)


@njit(cache=True)
def draw_bases(poses: np.ndarray, rig: Rig, tile: Tile, bases: np.ndarray) -> None:
    """Draw the rig's mesh in each of `poses` (K, P) into `bases` (K, H, W), metres."""
    for k in range(poses.shape[0]):
        draw(poses[k], rig, tile.intrinsics, bases[k])


@njit(cache=True)
def _slopes(across: float, along: float, radius: float) -> tuple[float, float]:
    """Return the minimum and maximum slope of the rays that meet a ball along one image axis."""
    square = along * along - radius * radius
    root = radius * np.sqrt(across * across + square)
    return (across * along - root) / square, (across * along + root) / square


@njit(cache=True)
def ball_depth(ball: np.ndarray, radius: float, x: float, y: float) -> float:
    """Return the depth at which the ray (x, y, 1) first meets a ball, camera frame, metres; 0 where it misses."""
    a = x * x + y * y + 1.0
    b = x * ball[0] + y * ball[1] + ball[2]
    c = ball[0] * ball[0] + ball[1] * ball[1] + ball[2] * ball[2] - radius * radius
    inside = b * b - a * c
    return (b - np.sqrt(inside)) / a if inside > 0.0 else 0.0


@njit(cache=True)
def overlay_costs(
    balls: np.ndarray, radii: np.ndarray, base_of: np.ndarray, bases: np.ndarray, tile: Tile, costs: np.ndarray
) -> None:
    """Fill `costs` (N,) with those of the balls (N, B, 3), camera frame, each particle's over its base.

    `base_of` (N,) is the index of a particle's base in `bases` (K, H, W). Balls nearer than `NEAREST` are not drawn.
    """
    height, width = tile.seen.shape
    fx, fy, cx, cy = tile.intrinsics[0], tile.intrinsics[1], tile.intrinsics[2], tile.intrinsics[3]
    v0, v1, u0, u1 = tile.window[0], tile.window[1], tile.window[2], tile.window[3]
    below = np.empty(bases.shape[0])
    for k in range(bases.shape[0]):
        below[k] = picture_cost(bases[k], tile)
    stamps = np.full((height, width), -1, dtype=np.int64)
    drawn = np.empty((height, width))
    for n in range(balls.shape[0]):
        base, change = bases[base_of[n]], 0.0
        for b in range(radii.shape[0]):
            x, y, z = balls[n, b, 0], balls[n, b, 1], balls[n, b, 2]
            if z - radii[b] <= NEAREST:
                continue
            left, right = _slopes(x, z, radii[b])
            upper, lower = _slopes(y, z, radii[b])
            first, last = max(u0, int(np.ceil(fx * left + cx))), min(u1 - 1, int(np.floor(fx * right + cx)))
            for v in range(max(v0, int(np.ceil(fy * upper + cy))), min(v1 - 1, int(np.floor(fy * lower + cy))) + 1):
                for u in range(first, last + 1):
                    depth = ball_depth(balls[n, b], radii[b], (u - cx) / fx, (v - cy) / fy)
                    if depth <= 0.0:
                        continue
                    before = drawn[v, u] if stamps[v, u] == n else base[v, u]
                    if before > 0.0 and before <= depth:
                        continue
                    seen = tile.seen[v, u]
                    change += pixel_cost(depth, seen, tile) - pixel_cost(before, seen, tile)
                    stamps[v, u] = n
                    drawn[v, u] = depth
        costs[n] = below[base_of[n]] + change / tile.pixels


@njit(cache=True)
def overlap_costs(balls: np.ndarray, radii: np.ndarray, pairs: np.ndarray, soft: float, costs: np.ndarray) -> None:
    """Compute the overlap of the balls (N, B, 3) of each particle (`c_p`): fills `costs` (N,).

    It is the sum over `pairs` (K, 2) of the squared overlap in units of the sum of both radii; the fraction `soft` of
    that sum is the distance at which balls start to overlap.
    """
    for n in range(balls.shape[0]):
        total = 0.0
        for k in range(pairs.shape[0]):
            i, j = pairs[k, 0], pairs[k, 1]
            dx, dy, dz = (
                balls[n, i, 0] - balls[n, j, 0],
                balls[n, i, 1] - balls[n, j, 1],
                balls[n, i, 2] - balls[n, j, 2],
            )
            overlap = soft - np.sqrt(dx * dx + dy * dy + dz * dz) / (radii[i] + radii[j])
            if overlap > 0.0:
                total += overlap * overlap
        costs[n] = total


@njit(cache=True)
def systematic(weights: np.ndarray, shift: float, chosen: np.ndarray) -> None:
    """Resample systematically: fills `chosen` (M,) with rows of `weights` (N,), which sum to 1, rising.

    `shift` in [0, 1) is the one random number. A row of weight w is chosen floor(M w) or ceil(M w) times.
    """
    count = chosen.shape[0]
    row = 0
    reached = weights[0]
    for k in range(count):
        while reached * count <= k + shift and row < weights.shape[0] - 1:
            row += 1
            reached += weights[row]
        chosen[k] = row
