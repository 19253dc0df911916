"""Poses by the names of their entries."""

import numpy as np

from toolkit.body import skeleton


def entry(name: str) -> int:
    """Return the index of an entry of a pose."""
    return skeleton.POSE_NAMES.index(name)


def pose_at(place: tuple[float, float, float] = (0.0, 0.0, 0.0), **entries: float) -> np.ndarray:
    """Return a pose (P,) at a place, metres, with some entries changed."""
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[skeleton.ROOT_POSITION] = place
    for name, value in entries.items():
        pose[entry(name)] += value
    return pose
