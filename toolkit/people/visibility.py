"""Which pixels of a frame say nothing about a person."""

from __future__ import annotations

import numpy as np

from toolkit.kernels.image import depth as kernels

THICKNESS = 0.1
"""Metres behind the farthest measured point of a person that the rest of the body may reach."""

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


def unobserved_pixels(
    whole_mm: np.ndarray, depth: np.ndarray, holes: np.ndarray, *, cut_out: bool
) -> np.ndarray | None:
    """Pixels that say nothing about a person.

    A hole in what was measured may be hair or a dark sleeve. One with more pixels than all that was measured of the
    person is none of them: there is space, out of range.

    Parameters
    ----------
    whole_mm : uint16 (H, W), all that was measured, millimetres, 0 = no measurement
    depth : float32 (H, W), the person's own depth, metres, 0 elsewhere
    holes : int32 (H, W), as `hole_sizes` has them
    cut_out : the recording is cut out: unmeasured pixels are background

    Returns
    -------
    bool (H, W), or None if there is no such pixel. Something that is not this person hides what is behind it; it does
    so for a person whose farthest measured point lies behind it.
    """
    measured = kernels.depth_samples(depth, SAMPLES)
    if not len(measured):
        return None
    farthest = float(np.quantile(measured, 0.95))
    mask = np.empty(depth.shape, dtype=np.bool_)
    largest = 0 if cut_out else int(np.count_nonzero(depth))
    hidden = kernels.hidden_pixels(whole_mm, depth, 1000 * (farthest + THICKNESS), holes, largest, mask)
    return mask if hidden else None
