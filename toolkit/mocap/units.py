"""Length units of motion capture files."""

from __future__ import annotations

import numpy as np

from toolkit.io.errors import MocapError

CMU_UNIT = 0.0254 / 0.45
"""Metres per file unit of the CMU and HDM05 skeletons: inches, scaled by 1 / 0.45 (0.056444 m)."""


def rest_size(points: np.ndarray) -> float:
    """Return the largest extent of a rest pose (N, 3) along an axis: about the height, in T-pose and A-pose alike."""
    return float(np.ptp(points, axis=0).max()) if len(points) else 0.0


def metres_per_unit(size: float, name: str) -> float:
    """Return the metres of one file unit of a skeleton of `size` file units, by the first unit that fits.

    The skeleton is 0.9 to 2.3 m tall then: 0.9 to 2.3 units are metres, 16 to 40.7 CMU units, 40.8 to 90 inches, 90 to
    230 centimetres, 900 to 2,300 millimetres.

    Raises
    ------
    MocapError
        No unit fits.
    """
    # Metres, CMU units, inches, centimetres, millimetres. Only sizes of 35 to 41 fit two: CMU units, and inches of a
    # child.
    for guess in (1.0, CMU_UNIT, 0.0254, 0.01, 0.001):
        if is_person(size * guess):
            return guess
    raise MocapError(
        f"{name}: the skeleton is {size:.4g} file units tall, which fits no usual unit; scale it to metres"
    )


def is_person(metres: float) -> bool:
    """Return True for the size of a child or an adult, 0.9 to 2.3 m."""
    return 0.9 <= metres <= 2.3
