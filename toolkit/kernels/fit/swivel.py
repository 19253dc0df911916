"""Inverse kinematics of an arm, swing and twist, compiled (Lopez-Mendez 2011, 2.2).

A target for the hand leaves an arm one degree of freedom: the swivel about the line from the shoulder to the hand. The
distance determines the elbow, the direction the swing of the shoulder. The swivel nearest to a given arm is the
reference, so no body axis is preferred.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from toolkit.kernels.kinematics import rotation_from_vector


class ArmBones(NamedTuple):
    """One arm of one body.

    upper : float64 (3,), elbow from shoulder in the rest pose, metres
    shoulder_limits : float64 (3, 2), of the shoulder's rotation vector, radians
    elbow_limits : float64 (2,), of the elbow, a hinge about y
    """

    upper: np.ndarray
    shoulder_limits: np.ndarray
    elbow_limits: np.ndarray


@njit(cache=True)
def rotation_vector(rotation: np.ndarray, out: np.ndarray) -> None:
    """Write the rotation vector of `rotation` (3, 3), no longer than pi, into `out` (3,)."""
    # By the largest of the four parts of the unit quaternion, which is well conditioned at each angle.
    m = rotation
    parts = np.empty((4, 4))
    parts[0, 0] = 1.0 + m[0, 0] + m[1, 1] + m[2, 2]
    parts[1, 1] = 1.0 + m[0, 0] - m[1, 1] - m[2, 2]
    parts[2, 2] = 1.0 - m[0, 0] + m[1, 1] - m[2, 2]
    parts[3, 3] = 1.0 - m[0, 0] - m[1, 1] + m[2, 2]
    parts[0, 1] = parts[1, 0] = m[2, 1] - m[1, 2]
    parts[0, 2] = parts[2, 0] = m[0, 2] - m[2, 0]
    parts[0, 3] = parts[3, 0] = m[1, 0] - m[0, 1]
    parts[1, 2] = parts[2, 1] = m[0, 1] + m[1, 0]
    parts[1, 3] = parts[3, 1] = m[0, 2] + m[2, 0]
    parts[2, 3] = parts[3, 2] = m[1, 2] + m[2, 1]
    largest = 0
    for k in range(1, 4):
        if parts[k, k] > parts[largest, largest]:
            largest = k
    w, x, y, z = parts[largest, 0], parts[largest, 1], parts[largest, 2], parts[largest, 3]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    scale = 2.0 * np.arctan2(sine, w) / sine if sine > 0.0 else 0.0
    out[0], out[1], out[2] = scale * x, scale * y, scale * z


@njit(cache=True)
def _multiply(first: np.ndarray, second: np.ndarray, out: np.ndarray) -> None:
    for a in range(3):
        for b in range(3):
            out[a, b] = first[a, 0] * second[0, b] + first[a, 1] * second[1, b] + first[a, 2] * second[2, b]


@njit(cache=True)
def elbow_for(bones: ArmBones, fore: np.ndarray, distance: float, before: float) -> float:
    """Return the elbow angle at which the hand is nearest to `distance` metres from the shoulder.

    `fore` (3,) is the hand from the elbow, in the elbow's frame. Of two angles the one nearer to `before` is taken.
    """
    u = bones.upper
    low, high = bones.elbow_limits[0], bones.elbow_limits[1]
    # |u + R_y(e) f|^2 = |u|^2 + |f|^2 + 2 (a cos e + b sin e + u_y f_y)
    a = u[0] * fore[0] + u[2] * fore[2]
    b = u[0] * fore[2] - u[2] * fore[0]
    size = np.sqrt(a * a + b * b)
    if size == 0.0:
        return min(max(before, low), high)
    squares = u[0] * u[0] + u[1] * u[1] + u[2] * u[2] + fore[0] * fore[0] + fore[1] * fore[1] + fore[2] * fore[2]
    wanted = 0.5 * (distance * distance - squares) - u[1] * fore[1]
    phase = np.arctan2(b, a)
    bend = np.arccos(min(max(wanted / size, -1.0), 1.0))
    best = np.inf
    found = before
    for sign in (-1.0, 1.0):
        angle = phase + sign * bend
        angle -= 2.0 * np.pi * np.rint((angle - 0.5 * (low + high)) / (2.0 * np.pi))
        inside = min(max(angle, low), high)
        # An angle that is moved to a limit misses the distance by as much.
        reached = a * np.cos(inside) + b * np.sin(inside)
        cost = 1e3 * abs(reached - min(max(wanted, -size), size)) + 1e-6 * abs(inside - before)
        if cost < best:
            best = cost
            found = inside
    return found


@njit(cache=True)
def solve_arm(bones: ArmBones, fore: np.ndarray, target: np.ndarray, swivel: float, arm: np.ndarray) -> float:
    """Move the hand to `target` (3,), metres from the shoulder, in the frame that carries the shoulder.

    `arm` (4,) holds the shoulder's rotation vector and the elbow's angle: the arm before, and after it the answer,
    whose swivel is `swivel` radians from the one nearest to the arm before. `fore` as in `elbow_for`. Returns the
    distance in metres by which the hand misses, infinity (and leaves the arm) where the shoulder would leave its
    limits. A target at the shoulder itself has no direction: the swing is left as it is.
    """
    distance = np.sqrt(target[0] ** 2 + target[1] ** 2 + target[2] ** 2)
    angle = elbow_for(bones, fore, distance, arm[3])
    cosine, sine = np.cos(angle), np.sin(angle)
    hand = np.empty(3)
    hand[0] = bones.upper[0] + cosine * fore[0] + sine * fore[2]
    hand[1] = bones.upper[1] + fore[1]
    hand[2] = bones.upper[2] - sine * fore[0] + cosine * fore[2]
    length = np.sqrt(hand[0] ** 2 + hand[1] ** 2 + hand[2] ** 2)
    rotation, swing, turned = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    rotation_from_vector(arm[0], arm[1], arm[2], rotation)
    if distance > 1e-9 and length > 1e-9:
        start, end, axis = np.empty(3), np.empty(3), np.empty(3)
        for a in range(3):
            end[a] = target[a] / distance
            start[a] = (rotation[a, 0] * hand[0] + rotation[a, 1] * hand[1] + rotation[a, 2] * hand[2]) / length
        _swing(start, end, axis)
        rotation_from_vector(axis[0], axis[1], axis[2], swing)
        _multiply(swing, rotation, turned)
        rotation_from_vector(swivel * end[0], swivel * end[1], swivel * end[2], swing)
        _multiply(swing, turned, rotation)
    vector = np.empty(3)
    rotation_vector(rotation, vector)
    if not _within(vector, bones.shoulder_limits):
        # The same rotation with the opposite axis.
        turn = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
        if turn == 0.0:
            return np.inf
        for a in range(3):
            vector[a] *= 1.0 - 2.0 * np.pi / turn
        if not _within(vector, bones.shoulder_limits):
            return np.inf
    arm[0], arm[1], arm[2], arm[3] = vector[0], vector[1], vector[2], angle
    return abs(distance - length)


@njit(cache=True)
def _within(vector: np.ndarray, limits: np.ndarray) -> bool:
    for a in range(3):
        if vector[a] < limits[a, 0] or vector[a] > limits[a, 1]:
            return False
    return True


@njit(cache=True)
def _swing(start: np.ndarray, end: np.ndarray, out: np.ndarray) -> None:
    """Return the smallest rotation vector (3,) from the unit vector `start` to `end`."""
    out[0] = start[1] * end[2] - start[2] * end[1]
    out[1] = start[2] * end[0] - start[0] * end[2]
    out[2] = start[0] * end[1] - start[1] * end[0]
    sine = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    cosine = start[0] * end[0] + start[1] * end[1] + start[2] * end[2]
    if sine > 1e-12:
        factor = np.arctan2(sine, cosine) / sine
        for a in range(3):
            out[a] *= factor
    elif cosine < 0.0:
        # Opposite vectors: any perpendicular axis is valid, here one across the smallest coordinate.
        smallest = 0
        for a in range(1, 3):
            if abs(start[a]) < abs(start[smallest]):
                smallest = a
        for a in range(3):
            out[a] = -start[smallest] * start[a]
        out[smallest] += 1.0
        factor = np.pi / np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
        for a in range(3):
            out[a] *= factor
    else:
        for a in range(3):
            out[a] = 0.0
