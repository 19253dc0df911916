"""Rotations of many frames: Euler angles, swing and twist, hinges, continuous rotation vectors."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np

from toolkit.io.errors import MocapError

_ORDER = re.compile("[xyz]{1,3}|[XYZ]{1,3}")


def of_euler(order: str, angles: np.ndarray, *, degrees: bool, name: str) -> np.ndarray:
    """Return rotations (N, 3, 3) of Euler angles (N, len(order)), or one (3, 3) of (len(order),).

    Axes in small letters are fixed (extrinsic); axes in capitals rotate with the rotations before them (intrinsic).

    Raises
    ------
    MocapError
        An axis is unknown or repeated in a row, or an angle is larger than 1,000 full turns.
    """
    largest_turn = 1000.0  # full turns; a larger angle in a motion file is damaged
    if angles.size and np.abs(angles).max() > largest_turn * (360.0 if degrees else 2 * np.pi):
        raise MocapError(f"{name} turns by {np.abs(angles).max():g}, which is not a joint angle; repair or remove it")
    if not _ORDER.fullmatch(order) or any(first == second for first, second in pairwise(order)):
        raise MocapError(f"{name} turns about the axes {order!r}, which is not an Euler order; export it again")
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_euler(order, np.atleast_2d(angles), degrees=degrees).as_matrix()
    return turned.reshape(*angles.shape[:-1], 3, 3)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (..., 3) divided by their lengths; a zero vector stays zero."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)


def transposed(rotations: np.ndarray) -> np.ndarray:
    """Return the inverses of rotations (..., 3, 3)."""
    return np.swapaxes(rotations, -1, -2)


def apply(rotations: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return the vectors (..., 3) rotated by rotations (..., 3, 3)."""
    return (rotations @ vectors[..., None])[..., 0]


def matrices(vectors: np.ndarray) -> np.ndarray:
    """Convert rotation vectors (T, 3), radians, to matrices (T, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vectors).as_matrix()


def vectors_of(rotations: np.ndarray) -> np.ndarray:
    """Convert matrices (T, 3, 3) to rotation vectors (T, 3) no longer than pi."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotations).as_rotvec()


def swing(start: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """Return the smallest rotations (T, 3, 3) that turn unit vectors `start` to `stop`, both (T, 3) or (3,).

    Opposite vectors are turned about an arbitrary perpendicular axis.
    """
    start, stop = np.broadcast_arrays(np.atleast_2d(start), np.atleast_2d(stop))
    axis = np.cross(start, stop)
    cosine = (start * stop).sum(axis=-1)
    opposite = cosine < -1.0 + 1e-12
    # [a]x^2 = a a^T - |a|^2 I, so that R = cos I + [a]x + a a^T / (1 + cos)
    out = axis[:, :, None] * (axis / np.where(opposite, 1.0, 1.0 + cosine)[:, None])[:, None, :]
    out[:, [0, 1, 2], [0, 1, 2]] += cosine[:, None]
    out[:, [2, 0, 1], [1, 2, 0]] += axis
    out[:, [1, 2, 0], [2, 0, 1]] -= axis
    if opposite.any():
        helper = np.eye(3)[np.abs(start[opposite]).argmin(axis=1)]
        half = unit(np.cross(start[opposite], helper))
        out[opposite] = 2.0 * half[:, :, None] * half[:, None, :] - np.eye(3)
    return out


def without_twist(rotations: np.ndarray, axis: int) -> np.ndarray:
    """Return the swing S of each rotation R = S T, where T is a rotation about coordinate axis 0, 1 or 2.

    The swing's rotation vector is 0 along that axis.
    """
    return swing(np.eye(3)[axis], rotations[..., axis])


def hinge_angles(first: np.ndarray, second: np.ndarray, axis: int, cosines: np.ndarray, sign: float) -> np.ndarray:
    """Return the angles (T,) of a hinge at which two rest directions form the wanted angles.

    Solves `first . R(axis, angle) second = cosine`. Of the two solutions the one with the sign of `sign` (1 or -1) is
    returned, for `sign` 0 the one nearer to zero. An angle outside the hinge's range gives the nearest one in it.

    Parameters
    ----------
    first, second : (3,), unit vectors in the rest pose, before and behind the hinge
    axis : number of the hinge's coordinate axis
    cosines : (T,), cosines of the wanted angles
    """
    e = np.eye(3)[axis]
    fixed = (first @ e) * (second @ e)
    a, b = first @ second - fixed, first @ np.cross(e, second)
    middle, reach = np.arctan2(b, a), np.hypot(a, b)
    half = np.arccos(np.clip((cosines - fixed) / reach, -1.0, 1.0))
    if sign == 0.0:
        low, high = wrapped(middle - half), wrapped(middle + half)
        return np.where(np.abs(low) < np.abs(high), low, high)
    return wrapped(middle + sign * half)


def wrapped(angles: np.ndarray) -> np.ndarray:
    """Return the angles in (-pi, pi]."""
    return np.pi - np.mod(np.pi - angles, 2.0 * np.pi)


def unwrapped(vectors: np.ndarray) -> np.ndarray:
    """Return rotation vectors (T, 3) of the same rotations without jumps by a full turn, as far as within 2 pi.

    Each vector is `w` or `w - 2 pi w / |w|`, whichever is nearer to its predecessor. Where the second form approaches a
    full turn, whose axis is undefined, `w` is used.
    """
    angles = np.linalg.norm(vectors, axis=1)
    other = vectors * (1.0 - 2.0 * np.pi / np.where(angles > 1e-9, angles, 1.0))[:, None]
    flips = np.zeros(len(vectors), dtype=bool)
    flips[1:] = np.linalg.norm(np.diff(vectors, axis=0), axis=1) > np.pi
    turned = np.cumsum(flips) % 2 == 1
    out = np.where(turned[:, None], other, vectors)
    begins = np.flatnonzero(np.diff(turned.astype(np.int8), prepend=0))
    for start, stop in zip(begins[::2], [*begins[1::2], len(vectors)], strict=False):
        if angles[start:stop].min() < 0.5 * np.pi:
            out[start:stop] = vectors[start:stop]
    return out
