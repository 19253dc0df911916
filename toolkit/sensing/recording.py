"""The `Recording` protocol, and the options of readers.

A recording is never mirrored: a person who faces the camera has the left hand at positive x. Frames are handed out
one at a time; a long recording is never read whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from toolkit.errors import UsageError
from toolkit.sensing.camera import Camera
from toolkit.sensing.conversion import unit_in_metres
from toolkit.sensing.joints2d import Joints2D
from toolkit.sensing.stream import Frame

LENGTHS = {"intrinsics": 4, "size": 2, "up_camera": 3}
FLAGS = {"intrinsics": "--intrinsics", "size": "--size", "up_camera": "--up"}
LARGEST_RATE = 1000.0  # frames a second: faster than any depth camera
LARGEST_SIDE = 20_000  # pixels: larger than any image


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


class Recording(Protocol):
    """A depth recording. Depth is uint16 (H, W), millimetres along z, 0 = no measurement.

    Attributes
    ----------
    name : stem of the file or name of the folder
    path : where it was read from
    camera : intrinsics of every frame, lens distortion included
    raw_camera : the same of the images as they lie in the file, before they are flipped or turned
    up_camera : float64 (3,), the vertical in the camera frame
    timestamps : float64 (T,), seconds
    background : uint16 (H, W), depth of the empty scene, or None
    joints : float32 (T, 20, 3), true joints, metres, camera frame, NaN = unknown, or None; of several people (or of
        no person) (N, T, 20, 3), NaN while absent
    reference_joints : the same, another system's estimate, or None
    image_joints : float32 (N, T, 20, 3), joints that a detector found in the images of up to N people in no order: u, v
        in pixels of the depth image and confidence, NaN = unknown; or None
    options : the reader options it was opened with, fit for JSON
    """

    name: str
    path: Path
    camera: Camera
    raw_camera: Camera
    timestamps: np.ndarray
    background: np.ndarray | None
    joints: np.ndarray | None
    reference_joints: np.ndarray | None
    image_joints: np.ndarray | None
    options: dict[str, Any]

    @property
    def up_camera(self) -> np.ndarray:
        """The vertical in the camera frame, float64 (3,), of length 1."""
        ...

    @property
    def vertical(self) -> Vertical:
        """The same with how it is known."""
        ...

    def __len__(self) -> int: ...

    def depth(self, i: int) -> np.ndarray:
        """Frame `i`: uint16 (H, W), millimetres."""
        ...

    def color(self, i: int) -> np.ndarray | None:
        """Colour of frame `i`, uint8 (H, W, 3), RGB registered to depth, or None."""
        ...

    def joints_2d(self, i: int) -> tuple[Joints2D, ...]:
        """Joints of everybody whom a detector found in the image of frame `i`."""
        ...

    def give_joints_2d(self, rows: np.ndarray) -> None:
        """Take joints (T, 20, 3) or (N, T, 20, 3) found in the images as they were before they were flipped or turned.

        They replace `image_joints`. A detector that saw mirrored images called the sides by each other's names.
        """
        ...

    def frames(self) -> Iterator[np.ndarray]:
        """All depth frames in order, one at a time."""
        ...

    def stream(self, start: int = 0, *, color: bool = False) -> Iterator[Frame]:
        """See `Stream.stream`."""
        ...


@dataclass(frozen=True)
class ReaderOptions:
    """How to read a recording, where its files do not say so themselves.

    Attributes
    ----------
    format : a name of `readers.READERS`, such as "npz", "ros", "mkv" or "png"; guessed from the path if None
    mirrored : the source shows the scene as a mirror does; its images are flipped. None leaves it to the reader
    radial : pixels hold the distance to the camera's centre instead of the depth along z
    depth_unit : "mm", "m" or the metres of one unit, such as 0.0002; None is "mm", for clouds "m"
    intrinsics : fx, fy, cx, cy in pixels, or the path of a JSON file that holds them
    size : width and height in pixels, for raw files and for clouds without a pixel grid
    frame_rate : frames per second of a source without timestamps; None is the format's own, or 30
    up_camera : the vertical in the camera frame
    background : path of a 16-bit PNG with the depth of the empty scene
    skeleton : a reference skeleton's file, or the folder that holds it
    axes : "camera" (x right, y down, z forward) or "graphics" (x right, y up, z backward), for clouds
    rotate : degrees by which the images are turned clockwise, 0, 90, 180 or 270, for a camera that stands on its side
    track : name of the depth topic of a file that holds several
    """

    format: str | None = None
    mirrored: bool | None = None
    radial: bool = False
    depth_unit: str | float | None = None
    intrinsics: str | tuple[float, ...] | None = None
    size: tuple[int, int] | None = None
    frame_rate: float | None = None
    up_camera: tuple[float, float, float] | None = None
    background: str | None = None
    skeleton: str | None = None
    axes: str = "camera"
    rotate: int = 0
    track: str | None = None

    @classmethod
    def from_mapping(cls, options: dict[str, Any]) -> ReaderOptions:
        """Options by name; paths become text and lists tuples, so that they can be written as JSON and read back.

        Raises
        ------
        UsageError
            A name or a value is not one of those above.
        """
        names = [f.name for f in fields(cls)]
        unknown = sorted(set(options) - set(names))
        if unknown:
            raise UsageError(f"unknown reader option {unknown[0]!r}; there are: {', '.join(names)}")
        plain = {
            k: _numbers(k, v) if k in ("intrinsics", "size", "up_camera") else _plain(v) for k, v in options.items()
        }
        made = cls(**plain)
        rate = made.frame_rate
        if rate is not None and not (isinstance(rate, (int, float)) and 0 < rate <= LARGEST_RATE):
            raise UsageError(
                f"--frame-rate {made.frame_rate} is not positive or above {LARGEST_RATE:g}; give frames a second"
            )
        if made.depth_unit is not None:
            unit_in_metres(made.depth_unit)
        if made.axes not in ("camera", "graphics"):
            raise UsageError(f"--axes is {made.axes!r}; give camera or graphics")
        if made.rotate not in (0, 90, 180, 270):
            raise UsageError(f"--rotate is {made.rotate!r}; give 90, 180 or 270")
        return made

    def given(self) -> dict[str, Any]:
        """The options that differ from their defaults."""
        default = asdict(ReaderOptions())
        return {k: v for k, v in asdict(self).items() if v != default[k]}


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    return value


def _numbers(name: str, value: Any) -> Any:
    """Numbers given as a list, an array or a text such as `320,240`; another text is a path."""
    if value is None:
        return None
    parts = value.split(",") if isinstance(value, str) else value
    try:
        numbers = tuple(float(part) for part in parts)
    except (TypeError, ValueError):
        if name == "intrinsics" and isinstance(value, (str, Path)):
            return str(value)
        raise UsageError(f"{FLAGS[name]} is {value!r}; give {LENGTHS[name]} numbers") from None
    if len(numbers) != LENGTHS[name] or not np.isfinite(numbers).all():
        raise UsageError(f"{FLAGS[name]} is {value!r}; give {LENGTHS[name]} numbers")
    if name == "size" and not all(0 < n <= LARGEST_SIDE and n == int(n) for n in numbers):
        raise UsageError(f"--size is {value!r}; give width and height in pixels")
    return tuple(int(n) for n in numbers) if name == "size" else numbers
