"""Stiffness and distance of the gaps between keyframes (thesis, Sections 3.4 and 4.1)."""

from __future__ import annotations

import math

from toolkit.io.errors import RetrievalError

_ROUNDING = 1e-9
"""Slack of the roundings in Eq. 4.5 and 4.6, so that 0.7 * 10 counts as 7."""


def admissible(distance: float, stiffness: float) -> tuple[int, int | None]:
    """Admissible distances in frames, Eq. 4.5 and 4.6: `ceil(sigma d)` to `floor(d / sigma)`, None for no upper
    bound."""
    if not 0.0 <= stiffness <= 1.0:
        raise RetrievalError(f"stiffness {stiffness} is outside 0 to 1; 1 allows no deformation, 0 any")
    if not (math.isfinite(distance) and distance >= 0):
        raise RetrievalError(f"keyframe distance {distance} is no number of frames; give 0 or more")
    minimum = math.ceil(stiffness * distance - _ROUNDING)
    return minimum, None if stiffness == 0.0 else math.floor(distance / stiffness + _ROUNDING)


def stiffness_of(bound: tuple[int, int | None]) -> float:
    """Stiffness of a gap from its least and greatest distance, Eq. 4.7; 0/0 counts as 1 for the bounds (0, 0)."""
    least, greatest = bound
    return 0.0 if greatest is None else 1.0 if greatest == 0 else math.sqrt(least / greatest)


def distance_of(bound: tuple[int, int | None]) -> float:
    """Distance of a gap in frames, Eq. 4.8; the least one where there is no upper bound.

    With the stiffness it gives back the bounds, except (0, n): there the product under the root loses n.
    """
    least, greatest = bound
    return float(least) if greatest is None else math.sqrt(least * greatest)
