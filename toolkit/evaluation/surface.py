"""How well a fitted body explains a depth image: figures that need no reference."""

from __future__ import annotations

import numpy as np


def silhouette_overlap(measured: np.ndarray, rendered: np.ndarray) -> float:
    """Intersection over union of the two silhouettes, in [0, 1]; NaN where neither shows anything.

    Parameters
    ----------
    measured, rendered : float32 (H, W), metres along z, 0 = nothing
    """
    first, second = measured > 0, rendered > 0
    union = int((first | second).sum())
    return float((first & second).sum() / union) if union else float("nan")


def depth_residual(measured: np.ndarray, rendered: np.ndarray) -> float:
    """Median absolute difference of depth where both have a surface, metres; NaN where they do not meet."""
    both = (measured > 0) & (rendered > 0)
    if not both.any():
        return float("nan")
    return float(np.median(np.abs(measured[both].astype(np.float64) - rendered[both])))
