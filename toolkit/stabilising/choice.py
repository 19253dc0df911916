"""One way through a gap out of several: the cheapest path from frame to frame."""

from __future__ import annotations

import numpy as np


def cheapest_path(costs: np.ndarray, angles: np.ndarray, stiffness: float) -> np.ndarray:
    """Which way to take in each frame, so that costs and steps between frames are least in sum (dynamic programming).

    Parameters
    ----------
    costs : float64 (C, D), metres, of each of C ways in each of D frames; infinite where a way is not open
    angles : float64 (C, D, A), radians
    stiffness : metres that a step of one radian, squared, costs

    Returns
    -------
    int64 (D,), the first of equals
    """
    total = costs[:, 0].copy()
    came_from = np.zeros(costs.shape, dtype=np.int64)
    for frame in range(1, costs.shape[1]):
        step = angles[:, None, frame - 1] - angles[None, :, frame]
        through = total[:, None] + stiffness * (step**2).sum(axis=2)
        came_from[:, frame] = through.argmin(axis=0)
        total = through.min(axis=0) + costs[:, frame]
    path = np.empty(costs.shape[1], dtype=np.int64)
    path[-1] = total.argmin()
    for frame in range(costs.shape[1] - 1, 0, -1):
        path[frame - 1] = came_from[path[frame], frame]
    return path
