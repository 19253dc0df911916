"""Which pixels of a frame say nothing about a person."""

from __future__ import annotations

import math

import numpy as np

THICKNESS = 0.1
"""Metres behind the farthest measured point of a person that the rest of the body may reach."""
FARTHEST = 0.95
"""Share of a person's pixels that are nearer than what counts as the farthest."""
SAMPLES = 500
"""Pixels of a person that tell how far away the farthest are."""


def hole_sizes(whole_mm: np.ndarray) -> np.ndarray:
    """How many pixels the hole of a pixel without measurement has: int32 (H, W), 0 where something was measured.

    Parameters
    ----------
    whole_mm : uint16 (H, W), all that was measured, millimetres, 0 = no measurement
    """
    import cv2

    _, labels, figures, _ = cv2.connectedComponentsWithStats((whole_mm == 0).astype(np.uint8), connectivity=4)
    sizes = figures[:, cv2.CC_STAT_AREA].copy()
    sizes[0] = 0
    return np.asarray(sizes[labels], dtype=np.int32)


def unobserved_pixels(whole_mm: np.ndarray, depth: np.ndarray, holes: np.ndarray | None) -> np.ndarray | None:
    """Pixels that say nothing about a person.

    A hole in what was measured may be hair or a dark sleeve. One with more pixels than all that was measured of the
    person is none of them: there is space, out of range.

    Parameters
    ----------
    whole_mm : uint16 (H, W), all that was measured, millimetres, 0 = no measurement
    depth : float32 (H, W), the person's own depth, metres, 0 elsewhere
    holes : int32 (H, W), as `hole_sizes` has them; None where the recording is cut out: unmeasured pixels are
        background

    Returns
    -------
    bool (H, W), or None if there is no such pixel. Something that is not this person hides what is behind it; it does
    so for a person whose farthest measured point lies behind it.
    """
    own = depth > 0
    measured = depth[own]
    if not len(measured):
        return None
    spread = np.sort(measured[:: max(1, len(measured) // SAMPLES)])
    # As `np.quantile` has it, which takes ten times as long.
    farthest = np.interp(FARTHEST * (len(spread) - 1), np.arange(len(spread)), spread)
    mask = (whole_mm > 0) & (whole_mm < math.ceil(1000 * (farthest + THICKNESS)))
    if holes is not None:
        mask |= (holes > 0) & (holes <= len(measured))
    mask &= ~own
    return mask if mask.any() else None
