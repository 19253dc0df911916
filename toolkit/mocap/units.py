"""Length units of motion capture files."""

from __future__ import annotations

import numpy as np

from toolkit.io.errors import MocapError

CMU_UNIT = 0.0254 / 0.45
"""Metres per file unit of the CMU and HDM05 skeletons: inches, scaled by 1 / 0.45 (0.056444 m)."""


GUESSES: tuple[float, ...] = (1.0, CMU_UNIT, 0.0254, 0.01, 0.001)
"""Candidate units: metres, CMU units, inches, centimetres, millimetres. Only sizes of 35 to 41 fit two: CMU units, and
inches of a child."""


def rest_size(points: np.ndarray) -> float:
    """Return the largest extent of a rest pose (N, 3) along an axis: about the height, in T-pose and A-pose alike."""
    return float(np.ptp(points, axis=0).max()) if len(points) else 0.0


def metres_per_unit(size: float, unit: float | None, name: str) -> float:
    """Return the metres of one file unit of a skeleton of `size` file units.

    A given `unit` is returned as it is. Otherwise the first of `GUESSES` with a skeleton of 0.9 to 2.3 m is returned:
    0.9 to 2.3 units are metres, 16 to 40.7 CMU units, 40.8 to 90 inches, 90 to 230 centimetres, 900 to 2,300
    millimetres.

    Raises
    ------
    MocapError
        No guess fits, or the given unit makes the skeleton smaller than 0.4 m or larger than 3 m.
    """
    person = (0.9, 2.3)  # metres, size range of a skeleton whose unit is guessed
    if unit is None:
        for guess in GUESSES:
            if person[0] <= size * guess <= person[1]:
                return guess
        raise MocapError(
            f"{name}: the skeleton is {size:.4g} file units tall, which fits no usual unit; "
            "give `unit`, the metres of one file unit (0.01 for centimetres)"
        )
    plausible = (0.4, 3.0)  # metres, size range of a skeleton with a given unit; outside, the unit is wrong
    if not (unit > 0 and plausible[0] <= size * unit <= plausible[1]):
        raise MocapError(
            f"{name}: with unit={unit:g} the skeleton is {size * unit:.4g} m tall; "
            "give the metres of one file unit (0.01 for centimetres) or leave it out"
        )
    return unit
