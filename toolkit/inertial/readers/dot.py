"""CSV of Xsens / Movella DOT, one file per sensor: `sep=,`, lines such as `DeviceTag:,1`, then the table.

`SampleTimeFine` counts microseconds in 32 bits and wraps after 71.6 minutes. The gyroscope is in deg/s. The first row
may be all zeros, lines may end in commas. Accelerations without gravity (`FreeAcc`, world frame) get it back only where
an orientation says which way is up.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from toolkit.body.rotations import quaternions as quat
from toolkit.inertial.readers.base import DEGREE, Columns, SensorOptions, head_of, read_text, unwrapped
from toolkit.inertial.stream import GRAVITY, Sensors, checked_stream
from toolkit.io.errors import InertialError

HEADER = "PacketCounter"


def matches(path: Path) -> bool:
    """Whether the file begins as DOT's or its header does."""
    head = head_of(path)
    return head.startswith(("sep=", "DeviceTag")) or any(
        line.startswith(f"{HEADER},SampleTimeFine") for line in head.splitlines()
    )


def read(path: Path, options: SensorOptions) -> Sensors:
    """The sensor of one file, named by its tag."""
    rows = list(csv.reader(read_text(path).splitlines()))
    start = next((i for i, row in enumerate(rows) if row and row[0].strip() == HEADER), None)
    if start is None:
        raise InertialError(f"{path} has no header that begins with {HEADER}; export it from the DOT app again")
    said = {row[0].strip().rstrip(":"): row[1].strip() for row in rows[:start] if len(row) > 1}
    table = Columns(path, rows[start], [row for row in rows[start + 1 :] if any(cell.strip() for cell in row)])
    times = unwrapped(table.numbers("SampleTimeFine")[:, 0], (1 << 32,)) * 1e-6
    whole = table.numbers(*(name for name in table.names[2:] if name and name != "Status"))
    times[~(np.nan_to_num(whole) != 0.0).any(axis=1)] = np.nan  # rows of zeros say nothing
    rotations = _rotations(table)
    gyro = table.optional("Gyr_X", "Gyr_Y", "Gyr_Z")
    stream = checked_stream(
        options.sensor or said.get("DeviceTag") or path.stem,
        times,
        rotations=rotations,
        gyro=None if gyro is None else gyro * DEGREE,
        acceleration=_acceleration(table, rotations),
        magnetic=table.optional("Mag_X", "Mag_Y", "Mag_Z"),
    )
    return Sensors((stream,))


def _rotations(table: Columns) -> np.ndarray | None:
    if (found := table.optional("Quat_W", "Quat_X", "Quat_Y", "Quat_Z")) is not None:
        return found
    if (found := table.optional("Euler_X", "Euler_Y", "Euler_Z")) is not None:
        return quat.from_euler(np.nan_to_num(found) * DEGREE)
    return None


def _acceleration(table: Columns, rotations: np.ndarray | None) -> np.ndarray | None:
    if (found := table.optional("Acc_X", "Acc_Y", "Acc_Z")) is not None:
        return found
    free = table.optional("FreeAcc_X", "FreeAcc_Y", "FreeAcc_Z")
    if free is None or rotations is None:
        return None
    with np.errstate(invalid="ignore"):
        return quat.rotate(quat.conjugate(quat.normalised(rotations)), free + [0.0, 0.0, GRAVITY])
