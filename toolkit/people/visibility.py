"""Which pixels of a frame say nothing about a person."""

from __future__ import annotations

import numpy as np

from toolkit.kernels.image import depth as kernels

THICKNESS = 0.1
"""Metres behind the farthest measured point of a person that the rest of the body may reach."""

SAMPLES = 500
"""Pixels of a person that tell how far away the farthest are."""


def unobserved_pixels(whole_mm: np.ndarray, depth: np.ndarray, *, cut_out: bool) -> np.ndarray | None:
    """Pixels that say nothing about a person.

    Parameters
    ----------
    whole_mm : uint16 (H, W), all that was measured, millimetres, 0 = no measurement
    depth : float32 (H, W), the person's own depth, metres, 0 elsewhere
    cut_out : the source says that nobody is where nothing was measured

    Returns
    -------
    bool (H, W), or None if there is no such pixel. Something that is not this person hides what is behind it; it does
    so for a person whose farthest measured point lies behind it.
    """
    farthest = kernels.depth_quantile(depth, SAMPLES, 0.95)
    if farthest == 0.0:
        return None
    mask = np.empty(depth.shape, dtype=np.bool_)
    hidden = kernels.hidden_pixels(whole_mm, depth, 1000 * (farthest + THICKNESS), not cut_out, mask)
    return mask if hidden else None
