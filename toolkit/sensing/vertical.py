"""The vertical in the camera frame, and how it is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Vertical:
    """Where up is.

    Attributes
    ----------
    up_camera : float64 (3,), camera frame, length 1
    source : "option" (a person who opened the recording said so), "file" (the recording says so), "floor" (a floor is
        seen) or "assumed" (from walls and people, else the image's own vertical)
    height : metres of the camera above the floor, None where no floor is seen
    """

    up_camera: np.ndarray
    source: str
    height: float | None = None
