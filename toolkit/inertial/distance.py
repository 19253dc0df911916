"""Distance of a track from its sensors in each frame, and the segments with tracking errors (thesis 7.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.inertial import solvers
from toolkit.inertial.calibrate import UPRIGHT, CalibrationSequence, segments_of
from toolkit.inertial.calibration import Calibration
from toolkit.inertial.sensor_limbs import bone_axis
from toolkit.io.errors import InertialError
from toolkit.io.spans import spans

ERROR, TWIST = "error", "twist"
ERROR_DEGREES = 45.0
"""Degrees, `tau` of Eq. 7.16: distance of a tracking error."""


@dataclass(frozen=True, eq=False)
class Distances:
    """Distances of one part of the body over the frames of a sequence.

    Attributes
    ----------
    limb : part of the body
    times : float64 (T,), seconds
    full : float64 (T,), degrees between the orientations (Eq. 7.16), NaN where one is unknown
    axis : float64 (T,), degrees between the directions of the bone alone
    """

    limb: str
    times: np.ndarray
    full: np.ndarray
    axis: np.ndarray


@dataclass(frozen=True)
class ErrorSegment:
    """Segment with a tracking error of one part of the body.

    Attributes
    ----------
    limb : part of the body
    start, end : seconds, of the first and the last frame
    peak, mean : degrees
    kind : `twist` if only the rotation about the bone differs, else `error`
    """

    limb: str
    start: float
    end: float
    peak: float
    mean: float
    kind: str


def worlds_of(calibration: Calibration, take: CalibrationSequence) -> dict[str, Rotation]:
    """Return `q_G` of every sensor in a sequence: the shared one, or a heading for each sensor.

    A sensor without north has another heading in each recording; its mounting is constant.
    """
    if calibration.heading == "shared":
        return {limb: other.world(limb) for other in calibration.takes.values() for limb in other.worlds}
    limbs = tuple(calibration.sensors)
    segments, _ = segments_of([take], limbs, "own")
    mountings = [calibration.mounting(limb) for limb in limbs]
    return {
        limbs[segment.sensor]: UPRIGHT * solvers.yaw(solvers.heading_given([segment], mountings))
        for segment in segments
    }


def distances(calibration: Calibration, take: CalibrationSequence) -> list[Distances]:
    """Return the distances of every sensor with an accepted calibration.

    Raises
    ------
    InertialError
        The sensors differ from those of the calibration, or none is calibrated.
    """
    calibration.check_placement(take.sensors)
    worlds = worlds_of(calibration, take)
    found = []
    for stream in take.sensors:
        if stream.name in calibration.usable and stream.name in worlds:
            found.append(_distances(stream.name, take, worlds[stream.name], calibration.mounting(stream.name)))
    if not found:
        raise InertialError(f"no sensor of {take.motion.name} is calibrated; calibrate on a recording with more motion")
    return found


def _distances(limb: str, take: CalibrationSequence, world: Rotation, mounting: Rotation) -> Distances:
    motion = take.motion
    tracked = motion.orientation(limb)
    inertial, known = take.measured(limb)
    measured = world.inv() * inertial * mounting.inv()
    axis = bone_axis(limb)
    cosine = (measured.apply(axis) * tracked.apply(axis)).sum(axis=1)
    return Distances(
        limb,
        motion.times,
        np.where(known, np.degrees((measured.inv() * tracked).magnitude()), np.nan),
        np.where(known, np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))), np.nan),
    )


def errors_of(found: Distances, threshold: float = ERROR_DEGREES) -> list[ErrorSegment]:
    """Return the segments above a threshold in degrees, with hysteresis, without short gaps and short segments."""
    runs = runs_above(found.full, found.times, threshold)
    errors = []
    for first, last in runs:
        full, axis = found.full[first : last + 1], found.axis[first : last + 1]
        kind = ERROR if np.nanmax(axis) > threshold else TWIST
        errors.append(
            ErrorSegment(
                found.limb, float(found.times[first]), float(found.times[last]), float(np.nanmax(full)),
                float(np.nanmean(full)), kind,
            )
        )  # fmt: skip
    return errors


def runs_above(values: np.ndarray, times: np.ndarray, threshold: float) -> list[tuple[int, int]]:
    """Return first and last frame of each run above the threshold that has not yet fallen below the release value."""
    release = 0.8  # fraction of the threshold below which an error ends
    shortest = 0.1  # seconds; shorter errors are dropped, and shorter gaps between errors are closed
    inside = spans(values > release * threshold)  # NaN is outside
    runs = [(span.start, span.stop - 1) for span in inside if values[span].max() > threshold]
    joined: list[tuple[int, int]] = []
    for first, last in runs:
        if joined and times[first] - times[joined[-1][1]] < shortest:
            first = joined.pop()[0]
        joined.append((first, last))
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    return [(first, last) for first, last in joined if times[last] - times[first] + step >= shortest]
