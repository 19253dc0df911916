"""What the verbs `inertial read` and `inertial synchronise` do, as calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.inertial.fusion import FusionSettings, oriented
from toolkit.inertial.limbs import TrackedMotion
from toolkit.inertial.placement import load_placement, placed
from toolkit.inertial.readers import read_files
from toolkit.inertial.readers.common import SensorOptions
from toolkit.inertial.stream import Sensors
from toolkit.inertial.suspicions import clock_suspicion, suspicions
from toolkit.inertial.synchronise import Clock, SyncSettings, synchronise


@dataclass(frozen=True)
class ReadReport:
    """What was read.

    Attributes
    ----------
    sensors : named after the parts of the body, each with an orientation
    suspicions : sentences about what looks wrong
    """

    sensors: Sensors
    suspicions: tuple[str, ...]


def read_sensors(
    files: Sequence[str | Path],
    output: str | Path | None = None,
    *,
    placement: str | Path | None = None,
    options: SensorOptions | None = None,
    fusion: FusionSettings | None = None,
) -> ReadReport:
    """Read sensor files of any known format, place them, fuse what is raw, and write the canonical file.

    Parameters
    ----------
    files : of one recording, on one clock
    output : `.npz` or `.csv`; None writes nothing
    placement : `placement.yaml`; without it the sensors' own names must say where they sit
    options : what the readers may be told
    fusion : how raw measurements become orientations

    Raises
    ------
    InertialError, UsageError
        See `read_files`, `placed` and `oriented`.
    OutputError
        The output cannot be written.
    """
    raw = placed(read_files(files, options), None if placement is None else load_placement(placement))
    doubts = suspicions(raw)
    sensors = oriented(raw, fusion)
    if output is not None:
        sensors.save(output)
    return ReadReport(sensors, tuple(doubts))


def load_sensors(path: str | Path) -> Sensors:
    """The canonical file for a verb that checks a track: placed, every sensor with an orientation."""
    return oriented(placed(read_files([path])))


def synchronise_run(
    run: str | Path, sensors: str | Path | Sensors, settings: SyncSettings | None = None
) -> tuple[Clock, list[str]]:
    """The clock of sensors against a run's, and what looks wrong with it.

    Raises
    ------
    TrackError, InertialError
        See `TrackedMotion.load` and `synchronise`.
    """
    found = sensors if isinstance(sensors, Sensors) else load_sensors(sensors)
    clock = synchronise(TrackedMotion.load(run), found, settings)
    return clock, clock_suspicion(clock.rate)


def gap_seconds(times: np.ndarray, valid: np.ndarray) -> float:
    """The longest time without a valid row, seconds."""
    return float(np.diff(times[valid]).max(initial=0.0))
