"""Motions one after the other, as one person would perform them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.simulation.person import facing_of, turned

JOIN = 12
"""Frames between two motions (0.4 s at 30 Hz), eased."""


def joined(parts: Sequence[np.ndarray]) -> tuple[np.ndarray, list[int]]:
    """Poses of parts (T, P) one after the other, each turned and moved over the floor to where the one before ended.

    Between two parts lie `JOIN` frames that ease from pose to pose.

    Returns
    -------
    poses : float64 (sum of T + JOIN joins, P)
    starts : the frame in which each part begins
    """
    pieces, starts, frames = [parts[0]], [0], len(parts[0])
    for part in parts[1:]:
        last = pieces[-1][-1]
        part = _continuing(last, part)
        pieces += [_eased(last, part[0]), part]
        starts.append(frames + JOIN)
        frames += JOIN + len(part)
    return np.concatenate(pieces), starts


def _continuing(last: np.ndarray, part: np.ndarray) -> np.ndarray:
    """A part (T, P) turned about the vertical and moved over the floor so that it begins where `last` (P,) stands."""
    floor = np.array([1.0, 0.0, 1.0])
    return turned(part, facing_of(last) - facing_of(part[0]), part[0, :3] * floor, last[:3] * floor)


def _eased(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """`JOIN` poses strictly between two: float64 (JOIN, P)."""
    from scipy.spatial.transform import Rotation

    place = np.arange(1, JOIN + 1)[:, None] / (JOIN + 1.0)
    ease = place * place * (3.0 - 2.0 * place)
    poses = before + ease * (after - before)
    first, last = (Rotation.from_rotvec(pose[skeleton.ROOT_ROTATION]) for pose in (before, after))
    turn = (last * first.inv()).as_rotvec()
    poses[:, skeleton.ROOT_ROTATION] = (Rotation.from_rotvec(ease * turn) * first).as_rotvec()
    return poses
