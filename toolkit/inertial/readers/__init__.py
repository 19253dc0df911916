"""Readers of sensor files, one per format, selected by the file's content."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from toolkit.inertial.readers import matlab, sto, table
from toolkit.inertial.readers.base import SensorOptions
from toolkit.inertial.stream import Sensors
from toolkit.io.errors import InertialError, UsageError

Reader = Callable[[Path, SensorOptions], Sensors]

READERS: dict[str, tuple[Callable[[Path], bool], Reader]] = {
    "npz": (lambda path: path.suffix.lower() == ".npz", lambda path, options: Sensors.load(path)),
    "matlab": (matlab.matches, matlab.read),
    "sto": (sto.matches, sto.read),
    "csv": (table.matches, table.read),
}
"""Test and reader of each format, in the order of the tests."""


def read_file(path: str | Path, options: SensorOptions | None = None) -> Sensors:
    """Read the sensors of one file, with the file's names.

    Raises
    ------
    InertialError
        The file is missing, damaged or of an unknown format.
    """
    options, path = options or SensorOptions(), Path(path)
    if not path.is_file():
        raise InertialError(f"there is no file {path}; name a file that a sensor's software exported")
    if options.columns is not None:
        return table.read(path, options)
    for matches, read in READERS.values():
        if matches(path):
            return read(path, options)
    raise InertialError(
        f"{path} has no known sensor format; there are: {', '.join(READERS)}. "
        "A CSV of any other kind is read with --columns"
    )


def read_files(paths: Sequence[str | Path], options: SensorOptions | None = None) -> Sensors:
    """Read all sensors of several files of one recording, on one clock.

    Raises
    ------
    UsageError
        No file is named.
    InertialError
        Two sensors have the same name.
    """
    if not paths:
        raise UsageError("no sensor file is named; give at least one")
    parts = [read_file(path, options) for path in paths]
    devices = {limb: device for part in parts for limb, device in part.devices.items()}
    source = {"files": [Path(path).name for path in paths], "devices": devices}
    return Sensors(tuple(stream for part in parts for stream in part), source)
