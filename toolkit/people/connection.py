"""Connection of frames: between two frames of a film no person moves faster than a sprinter."""

from __future__ import annotations

import numpy as np

FASTEST = 12.4
"""Top speed of the fastest 100 m run (Berlin 2009), m/s."""
VISIBILITY_SHIFT = 0.5
"""Metres by which the middle of a person's visible part moves when an occlusion begins or ends."""
HELD = 1.0
"""Seconds between two frames after which the first has no information about the pose in the second."""


def connected(before: np.ndarray, after: np.ndarray, seconds: float) -> bool:
    """Return True if a person can have moved between two places (3,), metres, of two frames `seconds` apart."""
    return bool(seconds <= HELD and np.sqrt(((after - before) ** 2).sum()) <= VISIBILITY_SHIFT + FASTEST * seconds)
