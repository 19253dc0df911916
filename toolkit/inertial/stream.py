"""Sensor streams, and the canonical file of sensors.

`sensors.npz` holds `names` (S,), per sensor k `times_k`, `rotations_k`, `gyro_k`, `acceleration_k` (absent if not
measured) and `valid_k`, and for all `source` (JSON). Quaternions are `w, x, y, z`. The inertial world has z up.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from toolkit.io.archives import load_archive, save_archive
from toolkit.io.errors import InertialError
from toolkit.io.typed_values import TypedReader
from toolkit.io.yaml_reader import parse_json

GRAVITY = 9.80665
"""Standard gravity, m/s2; an accelerometer at rest measures it upwards."""


LONGEST_SENSOR_GAP = 0.1
"""Seconds, longest interpolated gap; a limb can rotate by 60 degrees in it."""

DEVICE, FREE = "device", "gyroscope and gravity, heading free"
"""Sources of an orientation: the device's own filter, or `fusion.py`."""


@dataclass(frozen=True, eq=False)
class SensorStream:
    """Measurements of one sensor over time.

    Attributes
    ----------
    name : part of the body of `sensor_limbs.PARTS`; before placement the device's id
    times : float64 (N,), seconds, strictly increasing
    rotations : N rotations or None, sensor to inertial world; the identity in invalid rows
    gyro : float64 (N, 3) or None, rad/s in the sensor's frame
    acceleration : float64 (N, 3) or None, m/s2 in the sensor's frame, gravity included
    valid : bool (N,), valid rows
    origin : source of the orientations
    """

    name: str
    times: np.ndarray
    rotations: Rotation | None = None
    gyro: np.ndarray | None = None
    acceleration: np.ndarray | None = None
    valid: np.ndarray = field(default_factory=lambda: np.ones(0, dtype=bool))
    origin: str = DEVICE

    def __len__(self) -> int:
        return len(self.times)

    @property
    def rate(self) -> float:
        """Samples a second, from the median interval."""
        return float(1.0 / np.median(np.diff(self.times)))

    @property
    def gaps(self) -> int:
        """Number of gaps longer than `LONGEST_SENSOR_GAP` between valid rows."""
        return int((np.diff(self.times[self.valid]) > LONGEST_SENSOR_GAP + 1e-9).sum())

    @property
    def longest_gap(self) -> float:
        """Longest time without a valid row, seconds."""
        return float(np.diff(self.times[self.valid]).max(initial=0.0))

    @cached_property
    def _slerp(self) -> Slerp:
        if self.rotations is None:
            raise InertialError(f"sensor {self.name} has no orientation; fuse its gyroscope and accelerometer first")
        return Slerp(self.times[self.valid], self.rotations[self.valid])

    def at(self, times: np.ndarray) -> tuple[Rotation, np.ndarray]:
        """Return M rotations at other times by spherical interpolation, and a bool (M,) mask of known ones."""
        own = self.times[self.valid]
        after = np.clip(np.searchsorted(own, times, side="right"), 1, len(own) - 1)
        known = (times >= own[0] - 1e-9) & (times <= own[-1] + 1e-9)
        known &= own[after] - own[after - 1] <= LONGEST_SENSOR_GAP + 1e-9
        return self._slerp(np.clip(times, own[0], own[-1])), known


def checked_stream(
    name: str,
    times: np.ndarray,
    *,
    rotations: np.ndarray | None = None,
    gyro: np.ndarray | None = None,
    acceleration: np.ndarray | None = None,
    valid: np.ndarray | None = None,
    origin: str = DEVICE,
) -> SensorStream:
    """Return a stream with invalid rows marked, duplicates removed, lengths and order checked.

    `rotations` are quaternions (N, 4). Rows that are False in `valid` (N,) are invalid beside those that are found so.

    Raises
    ------
    InertialError
        Times decrease, fewer than two rows are usable, or no quaternion has norm 1.
    """
    times = np.asarray(times, np.float64).ravel()
    keep = _kept_rows(name, times)
    present: dict[str, np.ndarray] = {}
    for key, values, width in (("rotations", rotations, 4), ("gyro", gyro, 3), ("acceleration", acceleration, 3)):
        if values is None:
            continue
        if np.shape(values) != (len(times), width):
            raise InertialError(
                f"sensor {name} has {key} of shape {np.shape(values)} for {len(times)} times; "
                f"expected ({len(times)}, {width})"
            )
        present[key] = np.asarray(values, np.float64)[keep]
    if not present.keys() & {"rotations", "gyro"}:
        raise InertialError(f"sensor {name} has neither orientations nor a gyroscope; name their columns")
    times = times[keep]
    valid = np.ones(len(times), dtype=bool) if valid is None else np.asarray(valid, dtype=bool)[keep]
    for key, values in present.items():
        fine = np.isfinite(values).all(axis=1)
        if key in ("rotations", "acceleration"):  # an accelerometer without any value is missing
            fine &= (values != 0.0).any(axis=1)
        valid &= fine
    norm_error = 0.05  # largest deviation of a quaternion's norm from 1
    if "rotations" in present:
        lengths = np.linalg.norm(present["rotations"], axis=1)
        with np.errstate(invalid="ignore"):
            unit = np.abs(lengths - 1.0) <= norm_error
        if not (unit & valid).any():
            typical = float(np.nanmedian(lengths)) if np.isfinite(lengths).any() else float("nan")
            raise InertialError(
                f"the quaternions of sensor {name} have length {typical:.3g} throughout, not 1; "
                "check which columns hold w, x, y and z"
            )
        valid &= unit
    if valid.sum() < 2:
        raise InertialError(f"sensor {name} has {int(valid.sum())} usable rows of {len(valid)}; at least 2 are needed")
    quaternions = present.pop("rotations", None)
    turns = None
    if quaternions is not None:
        turns = Rotation.from_quat(np.where(valid[:, None], quaternions, [1.0, 0.0, 0.0, 0.0]), scalar_first=True)
    finite = {key: np.where(np.isfinite(values), values, 0.0) for key, values in present.items()}
    return SensorStream(name, times, turns, valid=valid, origin=origin, **finite)


def _kept_rows(name: str, times: np.ndarray) -> np.ndarray:
    """Return the rows with distinct times; the first of equal ones is kept."""
    finite = np.flatnonzero(np.isfinite(times))
    steps = np.diff(times[finite])
    if (steps < 0).any():
        row = int(finite[1:][steps < 0][0])
        raise InertialError(
            f"the times of sensor {name} run backwards at row {row}, from {times[row - 1]:.6g} to {times[row]:.6g} s; "
            "cut the file there or repair its clock"
        )
    return finite[np.concatenate([[True], steps > 0])] if len(finite) else finite


@dataclass(frozen=True, eq=False)
class Sensors:
    """All sensors of one recording.

    Attributes
    ----------
    streams : one per sensor, names unique
    source : files, format and device of each part of the body, for reports
    """

    streams: tuple[SensorStream, ...]
    source: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.streams:
            raise InertialError("there is no sensor; name a file that holds one")
        names = [stream.name for stream in self.streams]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise InertialError(f"two sensors are both called {', '.join(twice)}; every part of the body carries one")

    def __iter__(self) -> Iterator[SensorStream]:
        return iter(self.streams)

    def __len__(self) -> int:
        return len(self.streams)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sensors, in order."""
        return tuple(stream.name for stream in self.streams)

    def named(self, name: str) -> SensorStream:
        """Return the sensor with a name of `names`."""
        return next(stream for stream in self.streams if stream.name == name)

    @property
    def devices(self) -> dict[str, str]:
        """Known device id of each part of the body."""
        return dict(self.source.get("devices", {}))

    def save(self, path: str | Path) -> None:
        """Write the canonical NPZ, atomically."""
        arrays: dict[str, Any] = {"names": np.array(self.names, dtype=np.str_)}
        for k, stream in enumerate(self.streams):
            arrays[f"times_{k}"], arrays[f"valid_{k}"] = stream.times, stream.valid
            turns = None if stream.rotations is None else stream.rotations.as_quat(scalar_first=True)
            columns = {"rotations": turns, "gyro": stream.gyro, "acceleration": stream.acceleration}
            arrays |= {f"{key}_{k}": values for key, values in columns.items() if values is not None}
        origins = {stream.name: stream.origin for stream in self.streams if stream.rotations is not None}
        arrays["source"] = np.array(json.dumps({**self.source, "orientation": origins}))
        save_archive(path, arrays)

    @classmethod
    def load(cls, path: str | Path) -> Sensors:
        """Read the canonical NPZ; its rows are checked.

        Raises
        ------
        InertialError
            The file is missing, damaged or another file.
        """
        arrays = load_archive(path, InertialError, "write it with `depthmocap inertial read`")
        try:
            where = f"the source of {path}"
            source = parse_json(str(arrays.get("source", "{}")), where, InertialError, "write it again")
            reader = TypedReader(InertialError, "write it again", loose=True, source=where)
            origins = reader.read(source, _Source, "").orientation
            names = [str(name) for name in arrays["names"]]
            streams = [_stored_stream(name, k, arrays, origins.get(name, DEVICE)) for k, name in enumerate(names)]
            return cls(tuple(streams), source)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InertialError(
                f"cannot read {path} as sensor data: {error}; write it with `depthmocap inertial read`"
            ) from error


@dataclass(frozen=True)
class _Source:
    """Used entries of the source of sensor data: device and origin of the orientation of each limb."""

    orientation: dict[str, str] = field(default_factory=dict)
    devices: dict[str, str] = field(default_factory=dict)


def _stored_stream(name: str, k: int, arrays: dict[str, np.ndarray], origin: str) -> SensorStream:
    columns = {key: arrays.get(f"{key}_{k}") for key in ("rotations", "gyro", "acceleration", "valid")}
    return checked_stream(name, arrays[f"times_{k}"], origin=origin, **columns)
