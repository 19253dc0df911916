"""Limbs as chains of balls against a depth image: cost of a limb, and its fit, compiled.

All quantities but the image are in the frame of the joint that carries the limb. The cost of a limb is the unexplained
distance of the measured samples plus the intrusion of its balls into free space, which is the space in front of
measured points and the rays without a measurement.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from toolkit.kernels.fit.twists import bounded_step
from toolkit.kernels.image.raster import NEAREST
from toolkit.kernels.kinematics import carry, forward_kinematics, world_axes


class Chain(NamedTuple):
    """One limb of one body; its first joint carries it.

    parents : int64 (J,), -1 for the first; rest : float64 (J, 3), relative to the first, metres
    dof_joint, dof_axis : int64 (3 + D,), the first three belong to the first joint and stay 0
    limits : float64 (D, 2), radians
    ball_joint : int64 (B,), rising; ball_offset : float64 (B, 3), from that joint in the rest pose
    radii : float64 (B,), metres
    """

    parents: np.ndarray
    rest: np.ndarray
    dof_joint: np.ndarray
    dof_axis: np.ndarray
    limits: np.ndarray
    ball_joint: np.ndarray
    ball_offset: np.ndarray
    radii: np.ndarray


class Measured(NamedTuple):
    """Measurements and weights of the comparison.

    rotation : float64 (3, 3) and origin : float64 (3,), from the carrying joint's frame to the camera's
    evidence : float32 (H, W), metres, 0 in the background, NaN in unobserved pixels; intrinsics : float64 (4,)
    samples : float64 (M, 3), points that the limb may explain, in the carrying joint's frame
    share : weight of a sample; free_space : weight of the mean intrusion of the balls
    tolerance : maximum distance of an explained sample, metres
    cap : metres, the most that a sample or an intrusion counts
    """

    rotation: np.ndarray
    origin: np.ndarray
    evidence: np.ndarray
    intrinsics: np.ndarray
    samples: np.ndarray
    share: float
    free_space: float
    tolerance: float
    cap: float


@njit(cache=True)
def _intrusion(ball: np.ndarray, radius: float, measured: Measured) -> float:
    """Return the intrusion of a ball into free space, metres, at most the cap; 0 in unobserved pixels."""
    r, o, intrinsics, depth = measured.rotation, measured.origin, measured.intrinsics, measured.evidence
    z = r[2, 0] * ball[0] + r[2, 1] * ball[1] + r[2, 2] * ball[2] + o[2]
    if z <= NEAREST:
        return measured.cap
    x = r[0, 0] * ball[0] + r[0, 1] * ball[1] + r[0, 2] * ball[2] + o[0]
    y = r[1, 0] * ball[0] + r[1, 1] * ball[1] + r[1, 2] * ball[2] + o[1]
    u = int(np.rint(intrinsics[0] * x / z + intrinsics[2]))
    v = int(np.rint(intrinsics[1] * y / z + intrinsics[3]))
    if u < 0 or v < 0 or u >= depth.shape[1] or v >= depth.shape[0]:
        return 0.0
    if np.isnan(depth[v, u]):
        return 0.0
    if depth[v, u] == 0.0:
        return measured.cap
    return min(max(depth[v, u] - z - radius, 0.0), measured.cap)


@njit(cache=True)
def _nearest_ball(point: np.ndarray, balls: np.ndarray, radii: np.ndarray, cap: float) -> tuple[int, float]:
    """Return the ball whose surface is nearest to a point and the signed distance to it; (-1, cap) beyond the cap."""
    best, nearest = -1, cap
    for b in range(radii.shape[0]):
        reach = nearest + radii[b]
        dx, dy, dz = point[0] - balls[b, 0], point[1] - balls[b, 1], point[2] - balls[b, 2]
        squared = dx * dx + dy * dy + dz * dz
        if reach > 0.0 and squared < reach * reach:
            best, nearest = b, np.sqrt(squared) - radii[b]
    return best, nearest


@njit(cache=True)
def _cost(balls: np.ndarray, radii: np.ndarray, measured: Measured) -> float:
    """Return the cost of one limb, metres."""
    unexplained = intrusion = 0.0
    for n in range(measured.samples.shape[0]):
        gap = _nearest_ball(measured.samples[n], balls, radii, measured.cap)[1]
        unexplained += max(gap - measured.tolerance, 0.0)
    for b in range(radii.shape[0]):
        intrusion += _intrusion(balls[b], radii[b], measured)
    return measured.share * unexplained + measured.free_space * intrusion / radii.shape[0]


@njit(cache=True)
def _place(
    pose: np.ndarray,
    chain: Chain,
    vectors: np.ndarray,
    rotations: np.ndarray,
    origins: np.ndarray,
    balls: np.ndarray,
) -> None:
    """Compute joints and balls (B, 3) of `pose` (6 + D,), whose first six entries are 0."""
    forward_kinematics(pose, chain.parents, chain.rest, chain.dof_joint, chain.dof_axis, vectors, rotations, origins)
    carry(chain.ball_joint, chain.ball_offset, rotations, origins, balls)


@njit(cache=True)
def place_balls(angles: np.ndarray, chain: Chain, balls: np.ndarray) -> None:
    """Compute the balls of each limb of `angles` (C, D): fills `balls` (C, B, 3)."""
    joints = chain.parents.shape[0]
    vectors, origins, rotations = np.empty((joints, 3)), np.empty((joints, 3)), np.empty((joints, 3, 3))
    pose = np.zeros(6 + angles.shape[1])
    for c in range(angles.shape[0]):
        for k in range(angles.shape[1]):
            pose[6 + k] = angles[c, k]
        _place(pose, chain, vectors, rotations, origins, balls[c])


@njit(cache=True)
def limb_costs(balls: np.ndarray, radii: np.ndarray, measured: Measured, costs: np.ndarray) -> None:
    """Compute the cost of each limb of `balls` (C, B, 3), metres: fills `costs` (C,)."""
    for c in range(balls.shape[0]):
        costs[c] = _cost(balls[c], radii, measured)


@njit(cache=True)
def fit_limbs(
    angles: np.ndarray,
    chain: Chain,
    measured: Measured,
    sigma: float,
    damping: float,
    iterations: int,
    costs: np.ndarray,
) -> None:
    """Fit each limb of `angles` (C, D), in place and within its limits; fills `costs` (C,) with the final cost.

    Damped Gauss-Newton on the signed distance of each sample to the nearest ball, with Geman-McClure weights of scale
    `sigma` (metres), and on the intrusion of each ball along its ray.
    """
    joints, size, count = chain.parents.shape[0], angles.shape[1], chain.radii.shape[0]
    vectors, origins, rotations = np.empty((joints, 3)), np.empty((joints, 3)), np.empty((joints, 3, 3))
    axes = np.empty((chain.dof_joint.shape[0], 3))
    balls = np.empty((count, 3))
    camera = np.zeros(3)
    for a in range(3):
        for b in range(3):
            camera[a] -= measured.rotation[b, a] * measured.origin[b]
    pose = np.zeros(6 + size)
    matrix, vector = np.empty((size, size)), np.empty(size)
    row, step, damp = np.empty(size), np.empty(size), np.full(size, damping)
    towards = np.empty(3)
    observed = measured.samples.shape[0]
    for c in range(angles.shape[0]):
        for k in range(size):
            pose[6 + k] = angles[c, k]
        _place(pose, chain, vectors, rotations, origins, balls)
        for _ in range(iterations):
            world_axes(chain.parents, vectors, rotations, chain.dof_joint, chain.dof_axis, axes)
            matrix[:] = 0.0
            vector[:] = 0.0
            for n in range(observed + count):
                if n < observed:
                    b, residual = _nearest_ball(measured.samples[n], balls, chain.radii, measured.cap)
                    if b < 0:
                        continue
                    for a in range(3):
                        towards[a] = balls[b, a] - measured.samples[n, a]
                    weight = measured.share / (1.0 + (residual / sigma) ** 2) ** 2
                else:
                    b = n - observed
                    residual = -_intrusion(balls[b], chain.radii[b], measured)
                    # A ball beside the silhouette intrudes at all depths and gives no gradient along its ray.
                    if residual == 0.0 or residual == -measured.cap:
                        continue
                    for a in range(3):
                        towards[a] = balls[b, a] - camera[a]
                    weight = measured.free_space / count
                length = np.sqrt(towards[0] ** 2 + towards[1] ** 2 + towards[2] ** 2)
                for k in range(size):
                    j = chain.dof_joint[3 + k]
                    row[k] = 0.0
                    if j <= chain.ball_joint[b]:
                        px, py, pz = (
                            balls[b, 0] - origins[j, 0],
                            balls[b, 1] - origins[j, 1],
                            balls[b, 2] - origins[j, 2],
                        )
                        ax, ay, az = axes[3 + k, 0], axes[3 + k, 1], axes[3 + k, 2]
                        row[k] = (
                            towards[0] * (ay * pz - az * py)
                            + towards[1] * (az * px - ax * pz)
                            + towards[2] * (ax * py - ay * px)
                        ) / max(length, 1e-9)
                for k in range(size):
                    vector[k] += weight * row[k] * residual
                    for m in range(size):
                        matrix[k, m] += weight * row[k] * row[m]
            bounded_step(matrix, vector, angles[c], chain.limits, damp, step)
            for k in range(size):
                angles[c, k] += step[k]
                pose[6 + k] = angles[c, k]
            _place(pose, chain, vectors, rotations, origins, balls)
        costs[c] = _cost(balls, chain.radii, measured)
