"""Angles of an occluded limb, interpolated between the expected motion and both ends of the gap.

Deviations from the expected motion are an Ornstein-Uhlenbeck process. They equal the deviations at the ends of the gap
and decay with the class's correlation time: short gaps follow their ends, long gaps follow the class.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class End(NamedTuple):
    """Deviation of the limb from the expected motion at one end of a gap, (A,) radians, and its variance (A,)."""

    offset: np.ndarray
    variance: np.ndarray


class Bridge(NamedTuple):
    """Angles over a gap, float64 (D, A) radians, and their variance (D, A)."""

    mean: np.ndarray
    variance: np.ndarray


def bridge(
    expected: np.ndarray, spread: np.ndarray, memory: float, seconds: np.ndarray, length: float,
    start: End | None, end: End | None,
) -> Bridge:  # fmt: skip
    """Return the angles of a limb in the frames of a gap.

    With both ends the mean is `mu + [sinh((D - u) / l) o_a + sinh(u / l) o_b] / sinh(D / l)` and the variance
    `2 s^2 sinh(u / l) sinh((D - u) / l) / sinh(D / l)`, plus that of the ends; an open end drops its term.

    Parameters
    ----------
    expected, spread : (D, A), mean and standard deviation of the expected motion, radians
    memory : `l`, correlation time, seconds
    seconds : (D,), `u`, from the last frame before the gap to each of its frames
    length : `D`, seconds from the last frame before the gap to the first one after it
    start, end : deviations there; None for an open end
    """
    u = np.asarray(seconds, dtype=np.float64)[:, None]
    if start is not None and end is not None:
        near, far = _shares(u, length, memory)
        free = 1.0 - near**2 - far**2 - 2.0 * near * far * np.exp(-length / memory)
    else:
        near = np.exp(-u / memory) if start is not None else np.zeros_like(u)
        far = np.exp(-(length - u) / memory) if end is not None else np.zeros_like(u)
        free = 1.0 - near**2 - far**2
    mean, variance = expected.astype(np.float64), spread**2 * np.clip(free, 0.0, 1.0)
    for share, known in ((near, start), (far, end)):
        if known is not None:
            mean = mean + share * known.offset
            variance = variance + share**2 * known.variance
    return Bridge(mean, variance)


def _shares(u: np.ndarray, length: float, memory: float) -> tuple[np.ndarray, np.ndarray]:
    """Return `sinh((D - u) / l) / sinh(D / l)` and `sinh(u / l) / sinh(D / l)` without overflow."""
    total = -np.expm1(-2.0 * length / memory)
    near = np.exp(-u / memory) * -np.expm1(-2.0 * (length - u) / memory) / total
    far = np.exp(-(length - u) / memory) * -np.expm1(-2.0 * u / memory) / total
    return near, far
