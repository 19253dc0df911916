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
from pathlib import Path

import numpy as np

from toolkit.inertial.stream import FREE, GRAVITY, Sensors, SensorStream, checked_stream
from toolkit.io.errors import InertialError, UsageError
from toolkit.io.matlab import read_matlab
from toolkit.io.yaml_reader import as_numbers, read_table, read_text

DEGREE = np.pi / 180.0
CSV_COLUMNS = ("sensor", "time_s", "qw", "qx", "qy", "qz", "gx", "gy", "gz", "ax", "ay", "az")
UNITS = {
    "gyro": {"rad/s": 1.0, "deg/s": DEGREE},
    "acceleration": {"m/s2": 1.0, "g": GRAVITY},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
}
HINT = "export the recording again"


def read_file(path: str | Path, *, columns: str | None = None, units: str | None = None) -> Sensors:
    """Read the sensors of one file, with the file's names.

    Parameters
    ----------
    columns : columns of a CSV file as ours=theirs pairs such as `time_s=t,qw=Q0`
    units : its units such as `gyro=deg/s,acceleration=g,time=ms`; default rad/s, m/s2 and s

    Raises
    ------
    InertialError
        The file is missing, damaged or of an unknown format.
    UsageError
        The options have another form.
    """
    path = Path(path)
    if not path.is_file():
        raise InertialError(f"there is no file {path}; name a file that a sensor's software exported")
    suffix = ".csv" if columns is not None else path.suffix.lower()
    if suffix == ".npz":
        return Sensors.load(path)
    if suffix == ".mat":
        return Sensors((_utd_stream(path),))
    if suffix == ".sto":
        return Sensors(tuple(_sto_streams(path)))
    if suffix == ".csv":
        return Sensors(tuple(_csv_streams(path, columns, units)))
    raise InertialError(
        f"{path} has no known sensor format; there are: npz, mat, sto, csv. "
        "A CSV of any other kind is read with --columns"
    )


def read_files(paths: Sequence[str | Path], *, columns: str | None = None, units: str | None = None) -> Sensors:
    """Read all sensors of several files of one recording, on one clock; see `read_file`.

    Raises
    ------
    UsageError
        No file is named.
    InertialError
        Two sensors have the same name.
    """
    if not paths:
        raise UsageError("no sensor file is named; give at least one")
    parts = [read_file(path, columns=columns, units=units) for path in paths]
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
    for i, row in enumerate(rows[1:]):
        for name, cell in zip(names, row[1:], strict=False):
            if cell.count(",") != 3:
                raise InertialError(f"row {i} of {path} has the cell {cell!r} for {name}; expected w,x,y,z")
    table = as_numbers([",".join(row).split(",") for row in rows[1:]], 1 + 4 * len(names))
    return [
        checked_stream(name, table[:, 0], rotations=table[:, 1 + 4 * k : 5 + 4 * k]) for k, name in enumerate(names)
    ]


def _csv_streams(path: Path, columns: str | None, units: str | None) -> list[SensorStream]:
    rows = read_table(path, InertialError, HINT)
    theirs = {name: name for name in CSV_COLUMNS} | pairs_of(columns, "--columns")
    if unknown := sorted(set(theirs) - set(CSV_COLUMNS)):
        raise UsageError(f"--columns names {', '.join(unknown)}; ours are: {', '.join(CSV_COLUMNS)}")
    factors = factors_of(units)
    head = [name.strip() for name in rows[0]] if rows else []
    if theirs["time_s"] not in head:
        raise InertialError(
            f"{path} has no column {theirs['time_s']}; it has: {', '.join(head) or 'no row'}. "
            "Name the one that holds the time with --columns time_s=..."
        )
    named = [{name.strip(): cell.strip() for name, cell in row.items()} for row in rows]
    numbers = CSV_COLUMNS[1:]
    table = as_numbers([[row.get(theirs[name], "") for name in numbers] for row in named], len(numbers))
    values = {
        "rotations": table[:, 1:5],
        "gyro": table[:, 5:8] * factors["gyro"],
        "acceleration": table[:, 8:] * factors["acceleration"],
    }
    times = table[:, 0] * factors["time"]
    owners = np.array([row.get(theirs["sensor"], path.stem) for row in named])
    streams = []
    for name in dict.fromkeys(owners.tolist()):
        own = {key: array[owners == name] for key, array in values.items()}
        known = {key: array for key, array in own.items() if np.isfinite(array).any()}
        streams.append(checked_stream(name, times[owners == name], **known))
    return streams


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
