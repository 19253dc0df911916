"""One frame of a camera, the input of a tracker."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.sensing.joints2d import Joints2D


class Frame(NamedTuple):
    """Frame of a stream.

    Attributes
    ----------
    depth_mm : uint16 (H, W), millimetres along z, 0 = no measurement
    timestamp : seconds
    joints : detected joints of all people in the image, in pixels of `depth_mm`, lens distortion included
    color : uint8 (H', W', 3), RGB of the same view, or None if missing or not requested
    """

    depth_mm: np.ndarray
    timestamp: float
    joints: tuple[Joints2D, ...] = ()
    color: np.ndarray | None = None
