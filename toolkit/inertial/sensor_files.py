"""Readers of sensor files, by suffix: OpenSim storage, UTD-MHAD, CSV, and the canonical file (`Sensors.load`).

- `.sto`: orientations of OpenSim, `DataType=Quaternion` before `endheader`; cells are separated by tabs and hold
  `w,x,y,z`; columns have names of limbs (`femur_r_imu`).
- `.mat`: UTD-MHAD, `d_iner` (N, 6), acceleration in g and angular velocity in deg/s, 50 samples a second, no times;
  right wrist in actions 1 to 21, right thigh in 22 to 27.
- `.csv`: a table with the columns `CSV_COLUMNS`, or with others that `columns` names, as in `time_s=t,qw=Q0,qx=Q1`.
  Without `sensor` all rows belong to one sensor of the file's name. Units are rad/s, m/s2 and s unless `units` gives
  deg/s, g, ms or us. Orientations are right-handed, sensor to world.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.inertial.stream import FREE, GRAVITY, Sensors, SensorStream, checked_stream
from toolkit.io.errors import InertialError, UsageError
from toolkit.io.matlab import read_matlab
from toolkit.io.yaml_reader import read_table, read_text

DEGREE = np.pi / 180.0
CSV_COLUMNS = ("sensor", "time_s", "qw", "qx", "qy", "qz", "gx", "gy", "gz", "ax", "ay", "az")
UNITS = {
    "gyro": {"rad/s": 1.0, "deg/s": DEGREE},
    "acceleration": {"m/s2": 1.0, "g": GRAVITY},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
}
HINT = "export the recording again"


@dataclass(frozen=True)
class SensorOptions:
    """Options of a CSV file.

    Attributes
    ----------
    columns : ours=theirs pairs such as `time_s=t,qw=Q0`
    units : `gyro=deg/s,acceleration=g,time=ms`; default rad/s, m/s2 and s
    """

    columns: str | None = None
    units: str | None = None


def read_file(path: str | Path, options: SensorOptions | None = None) -> Sensors:
    """Read the sensors of one file, with the file's names.

    Raises
    ------
    InertialError
        The file is missing, damaged or of an unknown format.
    UsageError
        The options have another form.
    """
    options, path = options or SensorOptions(), Path(path)
    if not path.is_file():
        raise InertialError(f"there is no file {path}; name a file that a sensor's software exported")
    suffix = ".csv" if options.columns is not None else path.suffix.lower()
    if suffix == ".npz":
        return Sensors.load(path)
    if suffix == ".mat":
        return Sensors((_utd_stream(path),))
    if suffix == ".sto":
        return Sensors(tuple(_sto_streams(path)))
    if suffix == ".csv":
        return Sensors(tuple(_csv_streams(path, options)))
    raise InertialError(
        f"{path} has no known sensor format; there are: npz, mat, sto, csv. "
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


def _utd_stream(path: Path) -> SensorStream:
    stored = read_matlab(path, InertialError)
    if "d_iner" not in stored:
        raise InertialError(f"{path} holds no d_iner (UTD-MHAD) but {', '.join(stored) or 'nothing'}")
    values = stored["d_iner"]
    if values.ndim != 2 or values.shape[1] != 6 or len(values) < 2:
        raise InertialError(f"d_iner in {path} has shape {values.shape}; expected (N, 6) with at least 2 rows")
    action = re.match(r"^a(\d+)_s\d+_t\d+", path.stem)
    first_thigh_action = 22
    limb = "right_thigh" if action and int(action.group(1)) >= first_thigh_action else "right_forearm"
    rate = 50.0
    acceleration, gyro = values[:, :3] * GRAVITY, values[:, 3:6] * DEGREE
    return checked_stream(limb, np.arange(len(values)) / rate, gyro=gyro, acceleration=acceleration, origin=FREE)


def _sto_streams(path: Path) -> list[SensorStream]:
    lines = read_text(path, InertialError, HINT, errors="replace").splitlines()
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
    for i, row in enumerate(rows[1:]):
        for k, cell in enumerate(row[1 : len(names) + 1]):
            parts = cell.split(",")
            if len(parts) != 4:
                raise InertialError(f"row {i} of {path} has the cell {cell!r} for {names[k]}; expected w,x,y,z")
            cells[i, k] = [_number(part) for part in parts]
    times = np.array([_number(row[0]) for row in rows[1:]])
    return [checked_stream(name, times, rotations=cells[:, k]) for k, name in enumerate(names)]


def _csv_streams(path: Path, options: SensorOptions) -> list[SensorStream]:
    rows = read_table(path, InertialError, HINT)
    theirs = {name: name for name in CSV_COLUMNS} | pairs_of(options.columns, "--columns")
    if unknown := sorted(set(theirs) - set(CSV_COLUMNS)):
        raise UsageError(f"--columns names {', '.join(unknown)}; ours are: {', '.join(CSV_COLUMNS)}")
    factors = factors_of(options.units)
    head = [name.strip() for name in rows[0]] if rows else []
    if theirs["time_s"] not in head:
        raise InertialError(
            f"{path} has no column {theirs['time_s']}; it has: {', '.join(head) or 'no row'}. "
            "Name the one that holds the time with --columns time_s=..."
        )
    table = [{name.strip(): cell.strip() for name, cell in row.items()} for row in rows]

    def numbers(*ours: str) -> np.ndarray:
        return np.array([[_number(row.get(theirs[name], "")) for name in ours] for row in table])

    values = {
        "rotations": numbers("qw", "qx", "qy", "qz"),
        "gyro": numbers("gx", "gy", "gz") * factors["gyro"],
        "acceleration": numbers("ax", "ay", "az") * factors["acceleration"],
    }
    times = numbers("time_s")[:, 0] * factors["time"]
    owners = np.array([row.get(theirs["sensor"], path.stem) for row in table])
    streams = []
    for name in dict.fromkeys(owners.tolist()):
        own = {key: array[owners == name] for key, array in values.items()}
        known = {key: array for key, array in own.items() if np.isfinite(array).any()}
        streams.append(checked_stream(name, times[owners == name], **known))
    return streams


def _number(text: str) -> float:
    """Return the number of a cell, NaN for an empty one and for one without a number."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def pairs_of(text: str | None, option: str) -> dict[str, str]:
    """Return `a=b,c=d` as a dictionary.

    Raises
    ------
    UsageError
        The text has another form.
    """
    if not text:
        return {}
    parts = [part.partition("=") for part in text.split(",")]
    if any(not (mark and key.strip() and value.strip()) for key, mark, value in parts):
        raise UsageError(f"{option} is {text!r}; write pairs such as time_s=t,qw=Q0")
    return {key.strip(): value.strip() for key, _, value in parts}


def factors_of(text: str | None) -> dict[str, float]:
    """Return the factor to the canonical unit for each quantity."""
    chosen = pairs_of(text, "--units")
    for key, unit in chosen.items():
        if key not in UNITS or unit not in UNITS[key]:
            known = "; ".join(f"{name}: {', '.join(units)}" for name, units in UNITS.items())
            raise UsageError(f"--units has no {key}={unit}; there are {known}")
    return {key: units[chosen.get(key, next(iter(units)))] for key, units in UNITS.items()}
