"""MATLAB files of UTD-MHAD: acceleration in g, angular velocity in deg/s, sensor frame.

`*_inertial.mat` holds `d_iner` (N, 6), 50 samples a second, no times; right wrist in actions 1 to 21, right thigh in 22
to 27.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from toolkit.inertial.readers.base import DEGREE, SensorOptions
from toolkit.inertial.stream import FREE, GRAVITY, Sensors, SensorStream, checked_stream
from toolkit.io.errors import InertialError
from toolkit.io.matlab import read_matlab

_ACTION = re.compile(r"^a(\d+)_s\d+_t\d+")


def matches(path: Path) -> bool:
    """Return True for the name of a MATLAB file."""
    return path.suffix.lower() == ".mat"


def read(path: Path, options: SensorOptions) -> Sensors:
    """Return the sensor of a file."""
    stored = read_matlab(path, InertialError)
    if "d_iner" not in stored:
        raise InertialError(f"{path} holds no d_iner (UTD-MHAD) but {', '.join(stored) or 'nothing'}")
    return Sensors((_utd_stream(path, stored["d_iner"], options),))


def _utd_stream(path: Path, values: np.ndarray, options: SensorOptions) -> SensorStream:
    if values.ndim != 2 or values.shape[1] != 6 or len(values) < 2:
        raise InertialError(f"d_iner in {path} has shape {values.shape}; expected (N, 6) with at least 2 rows")
    action = _ACTION.match(path.stem)
    first_thigh_action = 22
    limb = "right_thigh" if action and int(action.group(1)) >= first_thigh_action else "right_forearm"
    utd_rate = 50.0
    times = np.arange(len(values)) / (options.rate or utd_rate)
    acceleration, gyro = values[:, :3] * GRAVITY, values[:, 3:6] * DEGREE
    return checked_stream(options.sensor or limb, times, gyro=gyro, acceleration=acceleration, origin=FREE)
