"""Centre of a cloud, at the torso of the person (Baak 2013, 5.3.4)."""

from __future__ import annotations

import numpy as np

from toolkit.io.errors import SegmentationError
from toolkit.kernels.cloud import torso

HALF_WIDTH, HALF_HEIGHT = 0.35, 0.5
"""Horizontal and vertical half axes of the ellipsoid for an adult, metres. It reaches from the chest to the thighs; a
smaller one would slide along the torso."""
TOLERANCE = 1e-3
"""Step of the mean shift below which it ends, metres."""
MAX_STEPS = 30


def cloud_centre(points: np.ndarray, start: np.ndarray | None = None, scale: float = 1.0) -> np.ndarray:
    """Return the centre of a person's cloud by mean shift with an upright ellipsoid: float64 (3,), metres, level frame.

    The centre moves to the mean of the points within the ellipsoid until it stops; an outstretched arm lies outside and
    has no effect. The search begins at `start` (3,), usually the previous centre. Without it, or without points near
    it, it begins at the median of the cloud, which limbs change little.

    Parameters
    ----------
    points : float32 (N, 3), metres, level frame (y up)
    start : (3,), metres, or None
    scale : size of the person against an adult, multiplies the half axes

    Raises
    ------
    SegmentationError
        The cloud is empty.
    """
    if len(points) == 0:
        raise SegmentationError("the cloud has no points, so it has no centre; skip frames without a person")
    width, height = scale * HALF_WIDTH, scale * HALF_HEIGHT
    inverse_axes = 1.0 / np.array([width, height, width])
    if start is not None:
        centre = np.array(start, dtype=np.float64)
        if torso.mean_shift(points, centre, inverse_axes, TOLERANCE, MAX_STEPS) > 0:
            return centre
    centre = np.median(points, axis=0).astype(np.float64)
    torso.mean_shift(points, centre, inverse_axes, TOLERANCE, MAX_STEPS)
    return centre
