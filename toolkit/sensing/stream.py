"""What a camera sees, frame by frame: the `Stream` protocol, of which a `Recording` is one that ends."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np

from toolkit.sensing.camera import Camera


class Frame(NamedTuple):
    """One frame of a stream.

    Attributes
    ----------
    depth_mm : uint16 (H, W), millimetres along z, 0 = no measurement
    timestamp : seconds
    """

    depth_mm: np.ndarray
    timestamp: float


class Stream(Protocol):
    """Frames of one camera in order, without a known end.

    Attributes
    ----------
    name : for people
    camera : intrinsics of every frame, lens distortion included
    background : uint16 (H, W), depth of the empty scene, or None
    """

    name: str
    camera: Camera
    background: np.ndarray | None

    @property
    def up_camera(self) -> np.ndarray:
        """The vertical in the camera frame, float64 (3,), of length 1."""
        ...

    def stream(self, start: int = 0) -> Iterator[Frame]:
        """Frames from number `start` on, one at a time."""
        ...
