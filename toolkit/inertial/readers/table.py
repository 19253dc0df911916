"""CSV tables: the canonical one, and any other with declared columns and units.

`columns` maps the canonical names to the table's, as in `time_s=t,qw=Q0,qx=Q1,qy=Q2,qz=Q3`; see `stream.CSV_COLUMNS`.
Without `sensor` all rows belong to one sensor; without `time_s` the option `rate` is required. Units are rad/s, m/s2
and s unless `units` gives deg/s, g, ms or us. Orientations are right-handed, sensor to world.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from toolkit.inertial.readers.base import DEGREE, Columns, SensorOptions, read_text
from toolkit.inertial.stream import CSV_COLUMNS, GRAVITY, Sensors, SensorStream, checked_stream
from toolkit.io.errors import InertialError, UsageError

UNITS = {
    "gyro": {"rad/s": 1.0, "deg/s": DEGREE},
    "acceleration": {"m/s2": 1.0, "g": GRAVITY},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
}
QUATERNION, GYRO, ACCELERATION = CSV_COLUMNS[2:6], CSV_COLUMNS[6:9], CSV_COLUMNS[9:12]


def matches(path: Path) -> bool:
    """Return True for the suffix of a CSV file; more specific readers are tested first."""
    return path.suffix.lower() == ".csv"


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


def read(path: Path, options: SensorOptions) -> Sensors:
    """Return all sensors of a table, in order of appearance."""
    lines = list(csv.reader(read_text(path).splitlines()))
    if not lines:
        raise InertialError(f"{path} is empty; export the recording again")
    table = Columns(path, lines[0], [row for row in lines[1:] if row])
    theirs = {name: name for name in CSV_COLUMNS} | pairs_of(options.columns, "--columns")
    if unknown := sorted(set(theirs) - set(CSV_COLUMNS)):
        raise UsageError(f"--columns names {', '.join(unknown)}; ours are: {', '.join(CSV_COLUMNS)}")
    factors = factors_of(options.units)
    names = table.texts(theirs["sensor"]) if table.has(theirs["sensor"]) else None
    default = options.sensor or path.stem
    owners = np.array(names if names is not None else [default] * len(table))
    columns = {
        "rotations": (QUATERNION, 1.0), "gyro": (GYRO, factors["gyro"]),
        "acceleration": (ACCELERATION, factors["acceleration"]),
    }  # fmt: skip
    values = {}
    for key, (ours, factor) in columns.items():
        found = table.optional(*(theirs[name] for name in ours))
        if found is not None:
            values[key] = found * factor
    times = _times(table, theirs["time_s"], factors["time"], options, owners)
    streams = [_stream(name, owners == name, times, values) for name in dict.fromkeys(owners.tolist())]
    return Sensors(tuple(streams))


def _times(table: Columns, name: str, factor: float, options: SensorOptions, owners: np.ndarray) -> np.ndarray:
    if table.has(name):
        return table.numbers(name)[:, 0] * factor
    if not options.rate:
        raise InertialError(
            f"{table.path} has no column {name}; it has: {', '.join(table.names)}. Name the one that holds the time "
            "with --columns time_s=..., or give --rate in samples a second"
        )
    times = np.empty(len(owners))
    for owner in set(owners.tolist()):
        rows = owners == owner
        times[rows] = np.arange(rows.sum()) / options.rate
    return times


def _stream(name: str, rows: np.ndarray, times: np.ndarray, values: dict[str, np.ndarray]) -> SensorStream:
    own = {key: array[rows] for key, array in values.items() if np.isfinite(array[rows]).any()}
    return checked_stream(str(name), times[rows], **own)
