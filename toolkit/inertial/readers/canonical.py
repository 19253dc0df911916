"""The canonical `sensors.npz`."""

from __future__ import annotations

from pathlib import Path

from toolkit.inertial.readers.common import SensorOptions
from toolkit.inertial.stream import Sensors


def matches(path: Path) -> bool:
    """Whether it is an NPZ file by its name."""
    return path.suffix.lower() == ".npz"


def read(path: Path, options: SensorOptions) -> Sensors:
    """See `Sensors.load`."""
    return Sensors.load(path)
