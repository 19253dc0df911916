"""Cutting one person out of a depth image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.errors import SegmentationError, SettingsError
from toolkit.kernels import depth as kernels
from toolkit.sensing.camera import Camera, level_rotation

if TYPE_CHECKING:
    from toolkit.sensing.cleaning import SensingSettings

MODES = "auto, segmented, background, empty-frames:N, range:NEAR,FAR, person, seed:U,V"
HOW_TO_SEGMENT = (
    "set segment to 'person', 'range:NEAR,FAR' (metres), 'seed:U,V' (a pixel of the person) or 'empty-frames:N', "
    "or give a background"
)
EMPTY_SHARE = 0.1  # of each frame is 0 where it is already segmented (recording format)
NEIGHBOUR_GAP = 0.04  # m: neighbouring pixels of one surface differ by less, on top of the quantisation
PART_GAP = 0.5  # m: what lies farther from the person is not a part of it (Baak 2013, 5.4.2)
SPECK_AREA = 0.002  # m^2: a third of a hand


@dataclass(frozen=True)
class SegmentationMode:
    """The setting `segment`, taken apart: a name and its numbers."""

    name: str
    numbers: tuple[float, ...] = ()

    @classmethod
    def parse(cls, text: str) -> SegmentationMode:
        """Read `name` or `name:number[,number]`.

        Raises
        ------
        SettingsError
            It is none of `MODES`.
        """
        name, _, tail = text.partition(":")
        counts = {"auto": 0, "segmented": 0, "background": 0, "person": 0, "empty-frames": 1, "range": 2, "seed": 2}
        try:
            numbers = tuple(float(part) for part in tail.split(",")) if tail else ()
        except ValueError:
            numbers = (float("nan"),)
        if counts.get(name) != len(numbers) or not all(np.isfinite(n) and n >= 0 for n in numbers):
            raise SettingsError(f"segment {text!r} is none of: {MODES}")
        if name == "range" and numbers[0] >= numbers[1]:
            raise SettingsError(f"segment {text!r} is no range; give metres, the nearer first")
        return cls(name, numbers)


@dataclass(frozen=True)
class PersonSize:
    """What a person measures in a depth image, generously: a crouching child to a tall adult with arms spread."""

    area: tuple[float, float] = (0.08, 2.0)  # m^2, seen head on
    largest_extent: float = 2.6  # m, in any direction
    smallest_height: float = 0.45  # m

    def fits(self, area: float, extent: np.ndarray) -> bool:
        """Whether something of `area` m^2 and `extent` (3,) metres along x, y, z of the level frame may be a person."""
        return bool(
            self.area[0] <= area <= self.area[1]
            and extent.max() <= self.largest_extent
            and max(extent[1], extent[0]) >= self.smallest_height
        )


PERSON = PersonSize()


class Segmenter:
    """Cuts the person out of the frames of one recording, in order.

    Parameters
    ----------
    camera : without lens distortion
    background : uint16 (H, W), millimetres, or None
    settings : `SensingSettings`
    up_camera : (3,), the vertical in the camera frame
    """

    def __init__(
        self, camera: Camera, background: np.ndarray | None, settings: SensingSettings, up_camera: np.ndarray
    ) -> None:
        self._camera, self._settings = camera, settings
        self._mode = SegmentationMode.parse(settings.segment)
        if self._mode.name == "auto" and background is not None:
            self._mode = SegmentationMode("background")
        if self._mode.name == "background" and background is None:
            raise SegmentationError(f"segment is 'background' and the recording has none; {HOW_TO_SEGMENT}")
        near, far = self._mode.numbers if self._mode.name == "range" else (settings.near, settings.far)
        self._near, self._far = int(1000 * near), min(int(1000 * far), 65535)
        used = background if self._mode.name == "background" else None
        self._background = np.zeros(camera.shape, dtype=np.uint16) if used is None else used
        self._rotation = level_rotation(up_camera)
        padded = (camera.height + 2, camera.width + 2)
        self._padded = np.zeros(padded, dtype=np.uint16)
        self._labels = np.zeros(padded, dtype=np.int32)
        self._parents = np.zeros(camera.height * camera.width + 2, dtype=np.int32)
        self._box = np.zeros(4, dtype=np.int64)

    def person(self, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """The person in one frame, uint16 (H, W), millimetres.

        Returns
        -------
        A padded depth image, uint16 (H + 2, W + 2), that is valid until the next call, and the window (v0, v1, u0, u1, ends
        excluded, padded indices) that holds the person, or None for a frame without one.
        """
        settings = self._settings
        quantisation = 1000 * settings.quantisation
        count = kernels.take_foreground(
            depth, self._background, 1000 * settings.background_margin, quantisation, self._near, self._far,
            self._padded, self._box,
        )  # fmt: skip
        if count == 0:
            return self._padded, None
        return self._padded, self._box
