"""Concatenation of motions, as performed by one person."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.simulation.person import facing_of, turned

JOIN = 12
"""Number of eased frames between two motions (0.4 s at 30 Hz)."""


def joined(parts: Sequence[np.ndarray]) -> tuple[np.ndarray, list[int]]:
    """Return the poses of parts (T, P) in sequence, each rotated and moved to the end of the part before.

    `JOIN` eased frames connect two parts.

    Returns
    -------
    poses : float64 (sum of T + JOIN joins, P)
    starts : first frame of each part
    """
    pieces, starts, frames = [parts[0]], [0], len(parts[0])
    floor = np.array([1.0, 0.0, 1.0])
    for part in parts[1:]:
        last = pieces[-1][-1]
        part = turned(part, facing_of(last) - facing_of(part[0]), part[0, :3] * floor, last[:3] * floor)
        pieces += [_eased(last, part[0]), part]
        starts.append(frames + JOIN)
        frames += JOIN + len(part)
    return np.concatenate(pieces), starts


def _eased(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return `JOIN` poses strictly between two: float64 (JOIN, P)."""
    from scipy.spatial.transform import Rotation

    place = np.arange(1, JOIN + 1)[:, None] / (JOIN + 1.0)
    ease = place * place * (3.0 - 2.0 * place)
    poses = before + ease * (after - before)
    first, last = (Rotation.from_rotvec(pose[skeleton.ROOT_ROTATION]) for pose in (before, after))
    turn = (last * first.inv()).as_rotvec()
    poses[:, skeleton.ROOT_ROTATION] = (Rotation.from_rotvec(ease * turn) * first).as_rotvec()
    return poses
