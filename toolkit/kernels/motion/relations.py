"""Compiled relational quantities of a motion or of one of its frames (thesis 2.2).

A program has one row per quantity: an operation, up to five points, a window of velocities and a sign.
`toolkit.retrieval.features.relational` builds it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

PLANE, NPLANE, VPLANE, VNPLANE, SPEED, SLOWER, ANGLE, INCLINE, HEIGHT, TALL, WIDE, YAW = range(12)
"""Operations: d - e along the normal of the plane through a, b, c or along the direction from a to b, and the same of
their velocities; the speed of a, or the lower one of a and b; the angle of a to b with c to d, or with the vertical;
the height of a over the lowest point; extents upwards and in the ground plane; the yaw rate of the root."""


@njit(cache=True)
def quantities(
    joints: np.ndarray, axes: np.ndarray, frame: int, rate: float, program: np.ndarray, out: np.ndarray
) -> None:
    """Compute every quantity of a program in one frame of a motion.

    Parameters
    ----------
    joints, axes : float64 (T, N, 3) and (T, 3), points and the root's x axis in neighbouring frames; y is up
    frame : number of the frame
    rate : frames per second
    program : int64 (Q, 8): operation, points a to e, window of the velocity in frames, and a factor of 1 or -1, or 0
        for the absolute value. For `HEIGHT` b has the excluded points as bits, for `WIDE` a the included ones
    out : float64 (Q,), filled
    """
    here = joints[frame]
    normal, first, second = np.empty(3), np.empty(3), np.empty(3)
    for row in range(program.shape[0]):
        op, a, b, c, d, e, window, sign = program[row]
        if op == PLANE or op == VPLANE:
            _normal(here, a, b, c, normal)
        elif op == NPLANE or op == VNPLANE:
            _direction(here, a, b, normal)
        value = 0.0
        if op == PLANE or op == NPLANE:
            value = _along(normal, here[d], here[e])
        elif op == VPLANE or op == VNPLANE:
            _velocity(joints, frame, d, window, rate, first)
            _velocity(joints, frame, e, window, rate, second)
            value = _along(normal, first, second)
        elif op == SPEED or op == SLOWER:
            _velocity(joints, frame, a, window, rate, first)
            value = _length(first)
            if op == SLOWER:
                _velocity(joints, frame, b, window, rate, second)
                value = min(value, _length(second))
        elif op == ANGLE:
            _direction(here, a, b, first)
            _direction(here, c, d, second)
            value = _degrees(first[0] * second[0] + first[1] * second[1] + first[2] * second[2])
        elif op == INCLINE:
            _direction(here, a, b, first)
            value = _degrees(first[1])
        elif op == HEIGHT:
            value = here[a, 1] - _extreme(here, b, -1.0)
        elif op == TALL:
            value = _extreme(here, 0, 1.0) - _extreme(here, 0, -1.0)
        elif op == WIDE:
            value = _ground_extent(here, a)
        elif op == YAW and frame + 1 < axes.shape[0]:
            x, z, next_x, next_z = axes[frame, 0], axes[frame, 2], axes[frame + 1, 0], axes[frame + 1, 2]
            value = abs(math.degrees(math.atan2(x * next_z - z * next_x, x * next_x + z * next_z))) * rate
        out[row] = abs(value) if sign == 0 else sign * value


@njit(cache=True)
def quantities_of_all(joints: np.ndarray, axes: np.ndarray, rate: float, program: np.ndarray, out: np.ndarray) -> None:
    """Compute every quantity of a program in all frames of a motion; `out` is float64 (T, Q), see `quantities`."""
    for frame in range(joints.shape[0]):
        quantities(joints, axes, frame, rate, program, out[frame])


@njit(cache=True)
def _velocity(joints: np.ndarray, frame: int, joint: int, window: int, rate: float, out: np.ndarray) -> None:
    """Average forward differences over a window around a frame, mirrored at both ends; the last one is repeated."""
    count = joints.shape[0]
    out[:] = 0.0
    if count == 1:
        return
    for place in range(frame - (window - 1) // 2, frame + window // 2 + 1):
        at = place
        while at < 0 or at >= count:
            at = -1 - at if at < 0 else 2 * count - 1 - at
        at = min(at, count - 2)
        for c in range(3):
            out[c] += joints[at + 1, joint, c] - joints[at, joint, c]
    for c in range(3):
        out[c] *= rate / window


@njit(cache=True)
def _normal(here: np.ndarray, a: int, b: int, c: int, out: np.ndarray) -> None:
    u0, u1, u2 = here[a, 0] - here[c, 0], here[a, 1] - here[c, 1], here[a, 2] - here[c, 2]
    v0, v1, v2 = here[b, 0] - here[c, 0], here[b, 1] - here[c, 1], here[b, 2] - here[c, 2]
    out[0], out[1], out[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    _normalise(out)


@njit(cache=True)
def _direction(here: np.ndarray, a: int, b: int, out: np.ndarray) -> None:
    for c in range(3):
        out[c] = here[b, c] - here[a, c]
    _normalise(out)


@njit(cache=True)
def _normalise(vector: np.ndarray) -> None:
    """Scale a vector to length 1; a zero vector stays zero."""
    length = _length(vector)
    if length > 0.0:
        for c in range(3):
            vector[c] /= length


@njit(cache=True)
def _length(u: np.ndarray) -> float:
    return math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])


@njit(cache=True)
def _along(normal: np.ndarray, u: np.ndarray, v: np.ndarray) -> float:
    return normal[0] * (u[0] - v[0]) + normal[1] * (u[1] - v[1]) + normal[2] * (u[2] - v[2])


@njit(cache=True)
def _degrees(cosine: float) -> float:
    return math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))


@njit(cache=True)
def _extreme(here: np.ndarray, without: int, sign: float) -> float:
    """Return the highest (`sign` 1) or lowest (-1) y of the points outside the bits of `without`."""
    best = -np.inf
    for n in range(here.shape[0]):
        if not (without >> n) & 1:
            best = max(best, sign * here[n, 1])
    return sign * best


@njit(cache=True)
def _ground_extent(here: np.ndarray, meant: int) -> float:
    """Return the largest distance in the ground plane between two of the points in the bits of `meant`."""
    best = 0.0
    for a in range(here.shape[0]):
        for b in range(a):
            if (meant >> a) & 1 and (meant >> b) & 1:
                x, z = here[a, 0] - here[b, 0], here[a, 2] - here[b, 2]
                best = max(best, x * x + z * z)
    return math.sqrt(best)
