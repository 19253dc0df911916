"""Connection of frames: between two frames of a film no person moves faster than a sprinter."""

from __future__ import annotations

import numpy as np

FASTEST = 12.4
"""Metres a second: the top speed of the fastest 100 m run (Berlin 2009)."""
SHIFT = 0.5
"""Metres by which the middle of what is visible of a person changes where something begins or ceases to cover them."""
HELD = 1.0
"""Seconds between two frames after which the first says nothing of the pose in the second."""


def connected(before: np.ndarray, after: np.ndarray, seconds: float) -> bool:
    """Return True if a person can have moved between two places (3,), metres, of two frames so many seconds apart."""
    return bool(seconds <= HELD and np.sqrt(((after - before) ** 2).sum()) <= SHIFT + FASTEST * seconds)
