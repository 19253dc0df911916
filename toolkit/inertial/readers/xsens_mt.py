"""Text files of Xsens MT Manager, one tab-separated file per sensor (OpenSense's example data).

Comment lines (`// Update Rate: 100.0Hz`) are followed by a header from `PacketCounter` on. Time is the packet counter
over the rate, because time columns are often empty; the counter wraps at 16 bits, and packets get lost. The matrix is
stored by columns (`Mat[1][1] Mat[2][1] Mat[3][1] Mat[1][2] ...`) and rotates the sensor into the world, z up.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from toolkit.body.rotations import quaternions as quat
from toolkit.inertial.readers.base import DEGREE, Columns, SensorOptions, head_of, read_text, unwrapped
from toolkit.inertial.stream import Sensors, checked_stream
from toolkit.io.errors import InertialError

_RATE = re.compile(r"Update Rate\s*:?\s*([0-9]+(?:\.[0-9]*)?)\s*Hz", re.IGNORECASE)
_FRAME = re.compile(r"Coordinate system\s*:?\s*(\w+)", re.IGNORECASE)
_DEVICE = re.compile(r"[_-]([0-9A-Fa-f]{8})$")
_MATRIX = tuple(f"Mat[{row}][{column}]" for column in (1, 2, 3) for row in (1, 2, 3))
_QUATERNIONS = (("Quat_q0", "Quat_q1", "Quat_q2", "Quat_q3"), ("Quat_w", "Quat_x", "Quat_y", "Quat_z"))
UPRIGHT = ("ENU", "NWU")
"""World frames with z up."""


def matches(path: Path) -> bool:
    """Return True if comment lines or the tab-separated header begin the file."""
    lines = [line for line in head_of(path).splitlines() if line.strip() and not line.startswith("//")]
    return bool(lines) and lines[0].startswith("PacketCounter\t")


def read(path: Path, options: SensorOptions) -> Sensors:
    """Return the sensor of one file; its id is the last part of the file's name."""
    text = read_text(path)
    lines = [line for line in text.splitlines() if line.strip()]
    comments = "\n".join(line for line in lines if line.startswith("//"))
    rows = [line.split("\t") for line in lines if not line.startswith("//")]
    if not rows or rows[0][0].strip() != "PacketCounter":
        raise InertialError(f"{path} has no header that begins with PacketCounter; export it with MT Manager")
    table = Columns(path, rows[0], rows[1:])
    frame = found.group(1).upper() if (found := _FRAME.search(comments)) else "ENU"
    if frame not in (*UPRIGHT, "NED"):
        raise InertialError(f"{path} is in the frame {frame}; export it in ENU, NWU or NED")
    device = found.group(1).upper() if (found := _DEVICE.search(path.stem)) else path.stem
    stream = checked_stream(
        options.sensor or device,
        unwrapped(table.numbers("PacketCounter")[:, 0]) / _rate(path, comments, options),
        rotations=_rotations(table),
        gyro=table.optional("Gyr_X", "Gyr_Y", "Gyr_Z"),
        acceleration=table.optional("Acc_X", "Acc_Y", "Acc_Z"),
        magnetic=table.optional("Mag_X", "Mag_Y", "Mag_Z"),
    )
    return Sensors((stream,), np.array([0.0, 0.0, 1.0 if frame in UPRIGHT else -1.0]))


def _rate(path: Path, comments: str, options: SensorOptions) -> float:
    if found := _RATE.search(comments):
        return float(found.group(1))
    if options.rate:
        return options.rate
    raise InertialError(f"{path} has no comment line with its Update Rate; give it with --rate in samples a second")


def _rotations(table: Columns) -> np.ndarray | None:
    for names in _QUATERNIONS:
        if (found := table.optional(*names)) is not None:
            return found
    if (found := table.optional(*_MATRIX)) is not None:
        matrices = np.swapaxes(found.reshape(-1, 3, 3), 1, 2)
        fine = np.isfinite(matrices).all(axis=(1, 2)) & (np.abs(np.linalg.det(np.nan_to_num(matrices)) - 1.0) < 0.1)
        rotations = np.full((len(table), 4), np.nan)
        rotations[fine] = quat.from_matrices(matrices[fine])
        return rotations
    if (found := table.optional("Roll", "Pitch", "Yaw")) is not None:
        return quat.from_euler(found * DEGREE)
    return None
