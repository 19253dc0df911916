"""What a camera sees, frame by frame: the `Stream` protocol, of which a `Recording` is one that ends."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

import numpy as np

from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D


class Frame(NamedTuple):
    """One frame of a stream.

    Attributes
    ----------
    depth_mm : uint16 (H, W), millimetres along z, 0 = no measurement
    timestamp : seconds
    joints : of everybody whom a detector found in the image, in pixels of `depth_mm`, lens distortion included
    color : uint8 (H', W', 3), RGB of the same view, or None where there is none or no person asked for it
    """

    depth_mm: np.ndarray
    timestamp: float
    joints: tuple[Joints2D, ...] = ()
    color: np.ndarray | None = None


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

    def stream(self, start: int = 0, *, color: bool = False) -> Iterator[Frame]:
        """Frames from number `start` on, one at a time, with their colour if asked for."""
        ...
