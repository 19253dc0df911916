"""How far a track is from what the sensors say, frame by frame, and the stretches in which it errs (thesis 7.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body.rotations import quaternions as quat
from toolkit.inertial import solvers
from toolkit.inertial.calibrate import CalibrationSequence, strands_of, upright
from toolkit.inertial.calibration import Calibration
from toolkit.inertial.sensor_limbs import bone_axis
from toolkit.io.errors import InertialError
from toolkit.io.spans import spans

ERROR, TWIST = "error", "twist"
THRESHOLD = 45.0
"""Degrees, `tau` of Eq. 7.16: above it a track errs."""
RELEASE = 0.8
"""Share of the threshold below which an error is over."""
SHORTEST = 0.1
"""Seconds: shorter errors are left out, and shorter gaps between them closed."""


@dataclass(frozen=True, eq=False)
class Distances:
    """One part of the body over the frames of a take.

    Attributes
    ----------
    limb : its name
    times : float64 (T,), of the frames, seconds
    full : float64 (T,), degrees between the orientations (Eq. 7.16), NaN where one is unknown
    axis : float64 (T,), degrees between the directions of the bone alone
    """

    limb: str
    times: np.ndarray
    full: np.ndarray
    axis: np.ndarray


@dataclass(frozen=True)
class WrongStretch:
    """A stretch in which a part of the body is tracked wrongly.

    Attributes
    ----------
    limb : its name
    start, end : seconds, of the first and the last frame
    peak, mean : degrees
    kind : `twist` where the bone's direction agrees throughout, else `error`
    """

    limb: str
    start: float
    end: float
    peak: float
    mean: float
    kind: str


def worlds_of(calibration: Calibration, take: CalibrationSequence) -> dict[str, np.ndarray]:
    """`q_G` of every sensor in a take: the shared one, or by the heading alone.

    A sensor without north starts each recording with another heading; the mounting stays.
    """
    if calibration.heading == "shared":
        return {limb: np.array(q) for other in calibration.takes.values() for limb, q in other.worlds.items()}
    limbs = tuple(calibration.sensors)
    strands, _ = strands_of([take], limbs, "own")
    mountings = np.array([calibration.mounting(limb) for limb in limbs])
    up = upright(take.sensors.world_up)
    return {
        limbs[strand.sensor]: quat.multiply(up, solvers.yaw(solvers.heading_given([strand], mountings)))
        for strand in strands
    }


def distances(calibration: Calibration, take: CalibrationSequence) -> list[Distances]:
    """The distances of every sensor whose calibration was not refused.

    Raises
    ------
    InertialError
        The sensors are not those of the calibration, or none is left.
    """
    calibration.check_placement(take.sensors)
    worlds = worlds_of(calibration, take)
    found = []
    for stream in take.sensors:
        if stream.name in calibration.usable and stream.name in worlds:
            found.append(_distances(stream.name, take, worlds[stream.name], calibration.mounting(stream.name)))
    if not found:
        raise InertialError(f"no sensor of {take.motion.name} is calibrated; calibrate on a take with more motion")
    return found


def measured_limb(
    limb: str, take: CalibrationSequence, world: np.ndarray, mounting: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What a sensor says of its limb in the level frame, quaternions (T, 4), and where it is known, bool (T,)."""
    inertial, known = take.measured(limb)
    return quat.multiply(quat.multiply(quat.conjugate(world), inertial), quat.conjugate(mounting)), known


def _distances(limb: str, take: CalibrationSequence, world: np.ndarray, mounting: np.ndarray) -> Distances:
    motion = take.motion
    tracked = motion.orientation(limb)
    said, known = measured_limb(limb, take, world, mounting)
    axis = bone_axis(limb)
    cosine = (quat.rotate(said, axis) * quat.rotate(tracked, axis)).sum(axis=1)
    return Distances(
        limb,
        motion.times,
        np.where(known, np.degrees(quat.angle(said, tracked)), np.nan),
        np.where(known, np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))), np.nan),
    )


def errors_of(found: Distances, threshold: float = THRESHOLD) -> list[WrongStretch]:
    """Stretches above a threshold, degrees, with hysteresis; short gaps closed, short stretches left out."""
    runs = runs_above(found.full, found.times, threshold)
    errors = []
    for first, last in runs:
        full, axis = found.full[first : last + 1], found.axis[first : last + 1]
        kind = ERROR if np.nanmax(axis) > threshold else TWIST
        errors.append(
            WrongStretch(
                found.limb, float(found.times[first]), float(found.times[last]), float(np.nanmax(full)),
                float(np.nanmean(full)), kind,
            )
        )  # fmt: skip
    return errors


def runs_above(values: np.ndarray, times: np.ndarray, threshold: float) -> list[tuple[int, int]]:
    """First and last frame of every stretch that exceeds the threshold and has not yet fallen below the release."""
    inside = spans(values > RELEASE * threshold)  # NaN is outside
    runs = [(span.start, span.stop - 1) for span in inside if values[span].max() > threshold]
    joined: list[tuple[int, int]] = []
    for first, last in runs:
        if joined and times[first] - times[joined[-1][1]] < SHORTEST:
            first = joined.pop()[0]
        joined.append((first, last))
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    return [(first, last) for first, last in joined if times[last] - times[first] + step >= SHORTEST]
