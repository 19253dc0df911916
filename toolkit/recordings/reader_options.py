"""Reader options for facts that the files of a recording do not contain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.errors import UsageError
from toolkit.sensing.conversion import unit_in_metres

FLAGS = {"intrinsics": ("--intrinsics", 4), "size": ("--size", 2), "up_camera": ("--up", 3)}
"""Option of several numbers -> its name on the command line, and how many there are."""
SETTINGS = {
    "segment": "settings={'sensing.segment': ...}",
    "subject": "settings={'sensing.subject': ...}",
    "online": "settings={'passes': 1}",
}
"""Command-line option of another stage -> its Python equivalent, for error messages."""


@dataclass(frozen=True)
class ReaderOptions:
    """Options for reading a recording.

    Attributes
    ----------
    format : a key of `readers.READERS`, such as "npz", "ros", "mkv" or "png"; None = detected from the path
    mirrored : flip the images of a mirrored source; None = decided by the reader
    radial : pixels hold the distance to the camera's centre instead of the depth along z
    depth_unit : "mm", "m" or the metres per unit, such as 0.0002; None = "mm", for clouds "m"
    intrinsics : fx, fy, cx, cy in pixels, a mapping with these names, a camera matrix (3, 3), or the path of a JSON
        file that holds them
    size : width and height in pixels, for raw files and for clouds without a pixel grid
    frame_rate : frame rate of a source without timestamps, Hz; None = that of the format, or 30
    up_camera : the vertical in the camera frame
    background : path of a 16-bit PNG with the depth of the empty scene
    skeleton : file of a reference skeleton, or the folder that contains it
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
        """Return options by name; paths become text and lists tuples, for JSON.

        Raises
        ------
        UsageError
            A name or a value is invalid.
        """
        names = [f.name for f in fields(cls)]
        unknown = sorted(set(options) - set(names))
        if unknown:
            instead = f"give {SETTINGS[unknown[0]]}" if unknown[0] in SETTINGS else f"there are: {', '.join(names)}"
            raise UsageError(f"unknown reader option {unknown[0]!r}; {instead}")
        plain: dict[str, Any] = {k: _numbers(k, v) if k in FLAGS else v for k, v in options.items()}
        plain = {k: str(v) if isinstance(v, Path) else v for k, v in plain.items()}
        if plain.get("frame_rate") is not None:
            plain["frame_rate"] = _rate(plain["frame_rate"])
        made = cls(**plain)
        if made.depth_unit is not None:
            unit = unit_in_metres(made.depth_unit)
            made = made if made.depth_unit in ("mm", "m") else replace(made, depth_unit=unit)
        if made.axes not in ("camera", "graphics"):
            raise UsageError(f"--axes is {made.axes!r}; give camera or graphics")
        if made.rotate not in (0, 90, 180, 270):
            raise UsageError(f"--rotate is {made.rotate!r}; give 90, 180 or 270")
        return made

    def given(self) -> dict[str, Any]:
        """Return the options that differ from their defaults."""
        default = asdict(ReaderOptions())
        return {k: v for k, v in asdict(self).items() if v != default[k]}


def _rate(value: Any) -> float:
    try:
        rate = float(value)
    except (TypeError, ValueError):
        rate = float("nan")
    largest_rate = 1000.0  # Hz, of a depth camera
    if not 0 < rate <= largest_rate:
        raise UsageError(f"--frame-rate is {value!r}; give frames a second, above 0 and up to {largest_rate:g}")
    return rate


def _camera_numbers(value: Any) -> Any:
    """Return fx, fy, cx, cy of a mapping with these names or of a camera matrix (3, 3); any other value unchanged."""
    if isinstance(value, Mapping):
        missing = [name for name in ("fx", "fy", "cx", "cy") if name not in value]
        if missing:
            raise UsageError(f"intrinsics have no {', '.join(missing)}; give fx, fy, cx, cy in pixels")
        return [value[name] for name in ("fx", "fy", "cx", "cy")]
    if not isinstance(value, (str, Path)) and np.shape(value) == (3, 3):
        matrix = np.asarray(value)
        return [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]
    return value


def _numbers(name: str, value: Any) -> Any:
    """Parse numbers from a list, an array or a text such as `320,240`; other text is a path."""
    if value is None:
        return None
    value = _camera_numbers(value) if name == "intrinsics" else value
    flag, length = FLAGS[name]
    try:
        numbers = tuple(float(part) for part in (value.split(",") if isinstance(value, str) else value))
    except (TypeError, ValueError):
        if name == "intrinsics" and isinstance(value, (str, Path)):
            return value
        numbers = ()
    if len(numbers) != length or not np.isfinite(numbers).all():
        raise UsageError(f"{flag} is {value!r}; give {length} numbers")
    largest_side = 20_000  # pixels, of an image
    if name == "size" and not all(0 < n <= largest_side and n == int(n) for n in numbers):
        raise UsageError(f"--size is {value!r}; give width and height in pixels")
    return tuple(int(n) for n in numbers) if name == "size" else numbers
