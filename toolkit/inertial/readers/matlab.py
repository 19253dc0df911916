"""MATLAB files of two data sets of raw data: acceleration in g, angular velocity in deg/s, sensor frame.

UTD-MHAD, `*_inertial.mat`: `d_iner` (N, 6), 50 samples a second, no times; right wrist in actions 1 to 21, right thigh
in 22 to 27. CZU-MHAD, `*_sensor.mat`: `sensor`, ten cells (N, 7) whose last column is the time of day in seconds, and
as text the files `pi00` to `pi09` with the same seven numbers a row.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from toolkit.inertial.readers.base import DEGREE, SensorOptions, read_text
from toolkit.inertial.stream import FREE, GRAVITY, Sensors, SensorStream, checked_stream
from toolkit.io.errors import InertialError
from toolkit.io.matlab import Variable, read_matlab

CZU_LIMBS = (
    "chest", "pelvis", "left_upper_arm", "left_forearm", "right_upper_arm", "right_forearm",
    "left_thigh", "left_shin", "right_thigh", "right_shin",
)  # fmt: skip
"""Parts of the body of the sensors 00 to 09: chest, abdomen, then elbow and wrist, knee and ankle; a sensor at a joint
is assigned to the bone above it."""
_ACTION = re.compile(r"^a(\d+)_s\d+_t\d+")
_PI = re.compile(r"^pi0?(\d)(\.\w+)?$", re.IGNORECASE)


def matches(path: Path) -> bool:
    """Return True for the name of a MATLAB file or a text of CZU-MHAD."""
    return path.suffix.lower() == ".mat" or bool(_PI.match(path.name))


def read(path: Path, options: SensorOptions) -> Sensors:
    """Return the sensors of a file of either data set."""
    if found := _PI.match(path.name):
        return Sensors((_czu_stream(path, int(found.group(1)), _numbers(path), options),))
    stored = read_matlab(path, InertialError)
    if "d_iner" in stored:
        return Sensors((_utd_stream(path, stored["d_iner"], options),))
    if "sensor" in stored:
        cells = [np.asarray(cell, np.float64) for cell in stored["sensor"]]
        if len(cells) > len(CZU_LIMBS):
            raise InertialError(f"sensor in {path} has {len(cells)} cells; CZU-MHAD has {len(CZU_LIMBS)}")
        return Sensors(tuple(_czu_stream(path, k, cell, options) for k, cell in enumerate(cells)))
    there = ", ".join(stored) or "nothing"
    raise InertialError(f"{path} holds neither d_iner (UTD-MHAD) nor sensor (CZU-MHAD) but {there}")


def _numbers(path: Path) -> np.ndarray:
    rows = [re.split(r"[,\s]+", line.strip()) for line in read_text(path).splitlines() if line.strip()]
    try:
        return np.array([[float(word) for word in row] for row in rows])
    except ValueError as error:
        raise InertialError(f"{path} is no table of seven numbers a row ({error}); copy it again") from error


def _utd_stream(path: Path, values: Variable, options: SensorOptions) -> SensorStream:
    if isinstance(values, list) or values.ndim != 2 or values.shape[1] != 6 or len(values) < 2:
        found = "cells" if isinstance(values, list) else f"shape {values.shape}"
        raise InertialError(f"d_iner in {path} has {found}; expected (N, 6) with at least 2 rows")
    action = _ACTION.match(path.stem)
    first_thigh_action = 22
    limb = "right_thigh" if action and int(action.group(1)) >= first_thigh_action else "right_forearm"
    utd_rate = 50.0
    times = np.arange(len(values)) / (options.rate or utd_rate)
    return _raw(options.sensor or limb, times, values.astype(np.float64))


def _czu_stream(path: Path, number: int, values: np.ndarray, options: SensorOptions) -> SensorStream:
    if values.ndim != 2 or values.shape[1] != 7 or len(values) < 2:
        raise InertialError(f"sensor {number} in {path} has shape {values.shape}; expected (N, 7) with at least 2 rows")
    day = 86400.0
    times = values[:, 6] + day * np.concatenate([[0], np.cumsum(np.diff(values[:, 6]) < -0.5 * day)])
    return _raw(options.sensor or CZU_LIMBS[number], times, values)


def _raw(name: str, times: np.ndarray, values: np.ndarray) -> SensorStream:
    acceleration, gyro = values[:, :3] * GRAVITY, values[:, 3:6] * DEGREE
    return checked_stream(name, times, gyro=gyro, acceleration=acceleration, origin=FREE)
