"""Calls behind the verbs `inertial read` and `inertial calibrate`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from toolkit.inertial.calibrate import CalibrationSequence, CalibrationSettings, calibrate, refined_clock, worlds_of
from toolkit.inertial.calibration import Calibration
from toolkit.inertial.fusion import oriented
from toolkit.inertial.placement import load_placement, placed
from toolkit.inertial.sensor_files import read_files
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.stream import Sensors
from toolkit.inertial.synchronise import MAX_OFFSET, synchronise
from toolkit.io.errors import InertialError, UsageError
from toolkit.io.files import check_output, sha256_of


def read_sensors(
    files: Sequence[str | Path],
    output: str | Path | None = None,
    *,
    placement: str | Path | None = None,
    columns: str | None = None,
    units: str | None = None,
) -> Sensors:
    """Read sensor files of any known format, place them, fuse raw data, and write the canonical file.

    Parameters
    ----------
    files : files of one recording on one clock
    output : the file to write (NPZ); None writes nothing
    placement : `placement.yaml`; without it the sensors' names must identify their parts
    columns, units : see `read_file`

    Raises
    ------
    InertialError, UsageError
        See `read_files`, `placed` and `oriented`; or the output is one of the files.
    OutputError
        The output cannot be written.
    """
    if output is not None:
        check_output(output, [*files, *([] if placement is None else [placement])])
    raw = placed(
        read_files(files, columns=columns, units=units), None if placement is None else load_placement(placement)
    )
    sensors = oriented(raw)
    if output is not None:
        sensors.save(output)
    return sensors


def load_sensors(path: str | Path) -> Sensors:
    """Read the canonical file of placed sensors, with an orientation for every sensor."""
    return oriented(placed(read_files([path])))


def calibrate_runs(
    runs: Sequence[str | Path],
    sensors: Sequence[str | Path | Sensors],
    output: str | Path | None = None,
    *,
    settings: CalibrationSettings | None = None,
    max_offset: float = MAX_OFFSET,
) -> Calibration:
    """Calibrate sensors on tracked recordings of one person, and write `calibration.json`.

    A run whose clock cannot be synchronised is skipped and noted.

    Parameters
    ----------
    runs : run folders; their names differ
    sensors : canonical files, one for all runs or one for each
    output : the file to write; None writes nothing
    settings : settings of the calibration
    max_offset : largest offset of the clocks, seconds

    Raises
    ------
    UsageError
        Runs and sensor files do not match, or the output is one of them.
    TrackError, InertialError
        A run cannot be read, no clock can be synchronised, or the motion determines no sensor.
    """
    if output is not None:
        check_output(output, [*runs, *(file for file in sensors if not isinstance(file, Sensors))])
    takes, notes = [], []
    for run, file in paired(runs, sensors):
        try:
            takes.append(take_of(run, file, max_offset))
        except InertialError as error:
            if len(runs) == 1:
                raise
            notes.append(f"{Path(run).name} is skipped: {error}")
    if not takes:
        raise InertialError(f"no run can be synchronised ({'; '.join(notes)})")
    found = calibrate(takes, settings)
    found = replace(found, notes=tuple(notes))
    if output is not None:
        found.save(output)
    return found


def paired(
    runs: Sequence[str | Path], sensors: Sequence[str | Path | Sensors]
) -> list[tuple[str | Path, str | Path | Sensors]]:
    """Return each run with its sensor file: one for all, or one for each.

    Raises
    ------
    UsageError
        The number of sensor files is neither one nor the number of runs, or two runs have the same name.
    """
    names = [Path(run).name for run in runs]
    if len(set(names)) < len(names):
        raise UsageError(f"two runs have the same name: {', '.join(names)}; rename one folder")
    if len(sensors) not in (1, len(runs)):
        raise UsageError(f"{len(sensors)} sensor files for {len(runs)} runs; give one for all or one for each")
    return list(zip(runs, list(sensors) * (len(runs) if len(sensors) == 1 else 1), strict=True))


def take_of(run: str | Path, sensors: str | Path | Sensors, max_offset: float = MAX_OFFSET) -> CalibrationSequence:
    """Return a run with its sensors, synchronised."""
    found = sensors if isinstance(sensors, Sensors) else load_sensors(sensors)
    motion = TrackedMotion.load(run)
    if motion.sensors_sha256 and not isinstance(sensors, Sensors) and sha256_of(sensors) == motion.sensors_sha256:
        raise InertialError(
            f"{motion.name} was tracked with these sensors, which cannot check it; track it without --inertial"
        )
    return CalibrationSequence(motion, found, synchronise(motion, found, max_offset))


def checked_take(
    run: str | Path,
    sensors: str | Path | Sensors,
    calibration: Calibration | None = None,
    *,
    max_offset: float = MAX_OFFSET,
) -> tuple[Calibration, CalibrationSequence]:
    """Return a synchronised run with the given calibration, or one made on this run.

    Raises
    ------
    TrackError, InertialError
        See `take_of`, `calibrate` and `Calibration.check_placement`.
    """
    take = take_of(run, sensors, max_offset)
    if calibration is None:
        calibration = calibrate([take])
        offset = calibration.takes[take.motion.name].offset
        return calibration, replace(take, clock=replace(take.clock, offset=offset))
    calibration.check_placement(take.sensors)
    mountings = {limb: calibration.mounting(limb) for limb in calibration.sensors}
    worlds = worlds_of(calibration, take)
    return calibration, refined_clock(take, worlds, mountings)
