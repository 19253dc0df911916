"""Check of a track by inertial sensors: distance curves, detected errors, precision and recall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.inertial.calibrate import CalibrationSequence, worlds_of
from toolkit.inertial.calibration import Calibration
from toolkit.inertial.sensor_limbs import PARTS, bone_axis
from toolkit.inertial.stream import Sensors
from toolkit.inertial.synchronise import MAX_OFFSET
from toolkit.inertial.workflow import checked_take, paired
from toolkit.io.errors import InertialError, UsageError
from toolkit.io.spans import spans
from toolkit.io.yaml_reader import read_table
from toolkit.retrieval.annotation.measures import Scores, Segment, segment_scores

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


THRESHOLDS: np.ndarray = np.arange(10.0, 91.0, 5.0)
"""Thresholds, degrees, of precision and recall (thesis, Fig. 7.12)."""


@dataclass(frozen=True, eq=False)
class RunCheck:
    """Result of the check of one run.

    Attributes
    ----------
    name : name of the run
    calibration : calibration of the sensors
    distances : distances of each sensor
    errors : detected errors of all sensors, by time
    truth : known errors, labelled by body part; None if unknown
    threshold : distance above which the track is wrong, degrees
    """

    name: str
    calibration: Calibration
    distances: tuple[Distances, ...]
    errors: tuple[ErrorSegment, ...]
    truth: tuple[Segment, ...] | None = None
    threshold: float = ERROR_DEGREES

    def scores(self) -> dict[str, Scores]:
        """Return the scores over "frames" and "segments" of all sensors; empty without truth."""
        if self.truth is None:
            return {}
        frames = Scores(0, 0, 0, 0)
        for curve in self.distances:
            found = np.zeros(len(curve.times), dtype=bool)
            for error in (e for e in self.errors if e.limb == curve.limb):
                found |= (curve.times >= error.start) & (curve.times <= error.end)
            frames += frame_scores(curve, self.truth, found)
        step = float(np.median(np.diff(self.distances[0].times)))
        segments = [Segment(e.start, e.end + step, e.limb) for e in self.errors]
        limbs = {curve.limb for curve in self.distances}
        return {"frames": frames, "segments": segment_scores([s for s in self.truth if s.label in limbs], segments)}

    def over_thresholds(self) -> list[Scores]:
        """Return the scores over frames at each of `THRESHOLDS`; all zero without truth."""
        out = [Scores(0, 0, 0, 0)] * len(THRESHOLDS)
        for curve in self.distances:
            for k, threshold in enumerate(THRESHOLDS):
                out[k] += frame_scores(curve, self.truth or (), np.nan_to_num(curve.full) > threshold)
        return out


def check_runs(
    runs: Sequence[str | Path],
    sensors: Sequence[str | Path | Sensors],
    *,
    calibration: str | Path | Calibration | None = None,
    truth: str | Path | None = None,
    threshold: float = ERROR_DEGREES,
    max_offset: float = MAX_OFFSET,
) -> list[RunCheck]:
    """Check runs with their sensors (`depthmocap inertial check`).

    Parameters
    ----------
    runs, sensors : as in `calibrate_runs`
    calibration : a file or its content; None calibrates each run by itself
    truth : CSV with the columns limb, start, end in seconds, and run where there are several
    threshold : distance above which a track is wrong, degrees between 0 and 180
    max_offset : largest offset of the clocks, seconds

    Raises
    ------
    TrackError, InertialError, UsageError
        A run, the sensors, the calibration or the truth is invalid.
    """
    if not 0.0 < threshold < 180.0:
        raise UsageError(f"a threshold of {threshold:g} degrees detects nothing; give one between 0 and 180")
    pairs = paired(runs, sensors)
    known = Calibration.load(calibration) if isinstance(calibration, (str, Path)) else calibration
    true = None if truth is None else read_truth(truth)
    checks = []
    for run, file in pairs:
        used, take = checked_take(run, file, known, max_offset=max_offset)
        curves = distances(used, take)
        errors = sorted((e for curve in curves for e in errors_of(curve, threshold)), key=lambda e: (e.start, e.limb))
        name = take.motion.name
        own = None if true is None else tuple(s for owner, s in true if owner in ("", name))
        checks.append(RunCheck(name, used, tuple(curves), tuple(errors), own, threshold))
    return checks


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


def frame_scores(curve: Distances, truth: Sequence[Segment], found: np.ndarray) -> Scores:
    """Return the scores over the frames (T,) with a known distance."""
    true = np.zeros(len(curve.times), dtype=bool)
    for segment in truth:
        if segment.label == curve.limb:
            true |= (curve.times >= segment.start - 1e-6) & (curve.times < segment.end - 1e-6)
    known = np.isfinite(curve.full)
    both = int((true & found & known).sum())
    return Scores(both, int((found & known).sum()), both, int((true & known).sum()))


def read_truth(path: str | Path) -> list[tuple[str, Segment]]:
    """Read known errors by run ("" without a run name) from a CSV with the columns limb, start, end.

    Raises
    ------
    InertialError
        The file cannot be read, or a line is no error of a known body part.
    """
    file = Path(path)
    found = []
    for line, row in enumerate(read_table(file, InertialError, "give a CSV file with limb, start and end"), start=2):
        try:
            segment = Segment(float(row["start"]), float(row["end"]), row["limb"].strip())
        except (KeyError, TypeError, ValueError, AttributeError):
            raise InertialError(f"{file.name}, line {line}: expected limb, start and end, got {row}") from None
        if segment.label not in PARTS or not segment.start < segment.end:
            raise InertialError(
                f"{file.name}, line {line}: {segment.label!r} from {segment.start:g} to {segment.end:g} s is no error "
                f"of a body part; the parts are {', '.join(PARTS)}"
            )
        found.append(((row.get("run") or "").strip(), segment))
    return found
