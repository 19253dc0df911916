"""OpenSim storage files of orientations: `DataType=Quaternion` before `endheader`.

Cells are separated by tabs and hold `w,x,y,z`; columns have names of limbs (`femur_r_imu`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.inertial.readers.base import SensorOptions, head_of, read_text
from toolkit.inertial.stream import Sensors, checked_stream
from toolkit.io.errors import InertialError


def matches(path: Path) -> bool:
    """Return True for the suffix or header of an orientation storage file."""
    return path.suffix.lower() == ".sto" or "DataType=Quaternion" in head_of(path)


def read(path: Path, options: SensorOptions) -> Sensors:
    """Return one stream per column."""
    lines = read_text(path).splitlines()
    end = next((i for i, line in enumerate(lines) if line.strip().lower() == "endheader"), None)
    if end is None:
        raise InertialError(f"{path} has no line endheader; is it an OpenSim storage file?")
    if not any(line.replace(" ", "").lower() == "datatype=quaternion" for line in lines[:end]):
        raise InertialError(f"{path} has no DataType=Quaternion; export orientations, not coordinates")
    rows = [line.split("\t") for line in lines[end + 1 :] if line.strip()]
    if len(rows) < 3 or rows[0][0].strip() != "time":
        raise InertialError(f"{path} has no table with the column time and at least two rows below its header")
    names = [name.strip() for name in rows[0][1:]]
    cells = np.full((len(rows) - 1, len(names), 4), np.nan)
    times = np.full(len(rows) - 1, np.nan)
    for i, row in enumerate(rows[1:]):
        try:
            times[i] = float(row[0])
        except ValueError:
            raise InertialError(f"row {i} of {path} has the time {row[0]!r}; expected seconds") from None
        for k, cell in enumerate(row[1 : len(names) + 1]):
            parts = cell.split(",")
            if len(parts) != 4:
                raise InertialError(f"row {i} of {path} has the cell {cell!r} for {names[k]}; expected w,x,y,z")
            try:
                cells[i, k] = [float(part) for part in parts]
            except ValueError:
                continue  # a cell without numbers stays NaN
    streams = [checked_stream(name, times, rotations=cells[:, k]) for k, name in enumerate(names)]
    return Sensors(tuple(streams))
