"""Unobserved pixels of a frame."""

from __future__ import annotations

import math

import numpy as np

from toolkit.kernels.image import components


def hole_sizes(whole_mm: np.ndarray) -> np.ndarray:
    """Return the size, in pixels, of the hole that each pixel lies in: int32 (H, W), 0 where there is a measurement.

    Parameters
    ----------
    whole_mm : uint16 (H, W), all that was measured, millimetres, 0 = no measurement
    """
    sizes = np.empty(whole_mm.shape, dtype=np.int32)
    components.hole_sizes(np.ascontiguousarray(whole_mm), sizes)
    return sizes


def unobserved_pixels(whole_mm: np.ndarray, depth: np.ndarray, holes: np.ndarray | None) -> np.ndarray | None:
    """Return the unobserved pixels for one person.

    A hole in the measurement may be hair or a dark sleeve. A hole with more pixels than the person is free space.

    Parameters
    ----------
    whole_mm : uint16 (H, W), the whole frame, millimetres, 0 = no measurement
    depth : float32 (H, W), depth of the person, metres, 0 elsewhere
    holes : int32 (H, W), from `hole_sizes`; None where the recording holds segmented people, unmeasured pixels are
        background

    Returns
    -------
    bool (H, W), or None if there is no such pixel. A surface that is not this person occludes a person whose farthest
    measured point lies behind it.
    """
    own = depth > 0
    measured = depth[own]
    if not len(measured):
        return None
    samples = 500  # pixels of a person that are sampled for that quantile
    spread = np.sort(measured[:: max(1, len(measured) // samples)])
    # As `np.quantile` has it, which takes ten times as long.
    farthest_quantile = 0.95  # quantile of a person's depth that counts as the farthest
    farthest = np.interp(farthest_quantile * (len(spread) - 1), np.arange(len(spread)), spread)
    thickness = 0.1  # metres behind the farthest measured point of a person that the rest of the body may reach
    mask = (whole_mm > 0) & (whole_mm < math.ceil(1000 * (farthest + thickness)))
    if holes is not None:
        mask |= (holes > 0) & (holes <= len(measured))
    mask &= ~own
    return mask if mask.any() else None
