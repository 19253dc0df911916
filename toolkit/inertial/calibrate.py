"""Calibration of sensors against a track: their mounting on the limbs and the heading of their world (thesis 7.5).

The default, `robust`, uses the known vertical of both worlds. The rest of `q_G` is a heading, one for all sensors of a
magnetic world or one for each, so a single tilt determines all offsets. Frames with tracking errors get low weights.
`thesis` is the reference, by Park and Martin. Both methods refuse mountings that the motion does not determine.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.inertial import solvers
from toolkit.inertial.calibration import GOOD, REFUSED, WEAK, Calibration, Mounting, TakeClock
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.solvers import SynchronisedSegment
from toolkit.inertial.stream import FREE, Sensors
from toolkit.inertial.synchronise import Clock, parabola
from toolkit.io.errors import InertialError, UsageError

METHODS, HEADINGS = ("robust", "thesis"), ("shared", "own")
LEAST_FRAMES = 10
"""Smallest number of common frames of sensor and track."""
ROWS = 600
"""Largest number of frames of a segment that are used."""


UPRIGHT = Rotation.from_rotvec([0.5 * np.pi, 0.0, 0.0])
"""Rotation from a world with y up, such as the level frame, to an inertial one, which has z up."""


@dataclass(frozen=True)
class CalibrationSettings:
    """Settings of the calibration.

    Attributes
    ----------
    method : `robust` or `thesis`
    heading : `shared`, `own`, or None: shared if the devices measure orientations
    refine_clock : correct the clock by the residual of the calibration
    refuse : refuse mountings that the motion does not determine, or that disagree with the track
    """

    method: str = "robust"
    heading: str | None = None
    refine_clock: bool = True
    refuse: bool = True

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise UsageError(f"unknown method {self.method!r}; there are: {', '.join(METHODS)}")
        if self.heading not in (None, *HEADINGS):
            raise UsageError(f"unknown heading {self.heading!r}; there are: {', '.join(HEADINGS)}")


@dataclass(frozen=True, eq=False)
class CalibrationSequence:
    """Tracked recording with its sensors and their clock."""

    motion: TrackedMotion
    sensors: Sensors
    clock: Clock

    def measured(self, sensor: str, lag: float = 0.0) -> tuple[Rotation, np.ndarray]:
        """Return T orientations of a sensor in the motion's frames, and a bool (T,) mask of known ones."""
        inertial, known = self.sensors.named(sensor).at(self.clock.sensor_times(self.motion.times) + lag)
        return inertial, known & self.motion.valid

    def segment(self, limb: str, lag: float = 0.0, group: Hashable = None) -> SynchronisedSegment:
        """Return the orientations of a sensor and of its part of the body in frames where both are known."""
        inertial, known = self.measured(limb, lag)
        return SynchronisedSegment(limb, group, inertial[known], self.motion.orientation(limb)[known])


def calibrate(takes: Sequence[CalibrationSequence], settings: CalibrationSettings | None = None) -> Calibration:
    """Return the calibration with the smallest residual over all sequences.

    Parameters
    ----------
    takes : sequences of one person with unchanged mountings; their names differ
    settings : see `CalibrationSettings`

    Raises
    ------
    InertialError
        No sensor has enough frames in common with a track, or the motion determines no sensor.
    """
    settings = settings or CalibrationSettings()
    limbs = tuple(dict.fromkeys(name for take in takes for name in take.sensors.names))
    free = any(stream.origin == FREE for take in takes for stream in take.sensors)
    heading = settings.heading or ("own" if free else "shared")
    if settings.method == "thesis":
        worlds, mountings = _by_thesis(takes, limbs)
    else:
        for _ in range(2):
            worlds, mountings = _by_heading(takes, limbs, heading)
            if settings.refine_clock:
                takes = [refined_clock(take, worlds[i], mountings) for i, take in enumerate(takes)]
    found = {limb: _residuals(takes, worlds, limb, mountings[limb]) for limb in limbs}
    agreement = np.radians(20.0)  # largest residual of a frame in which sensor and track agree
    spreads = {limb: _spread(tracked[angles < agreement], settings.method) for limb, (angles, tracked) in found.items()}
    sensors = {}
    for limb, (angles, _) in found.items():
        # A shared heading is determined by the best of all sensors.
        shared = heading == "shared" and settings.method == "robust"
        inliers = float((solvers.weights_of(angles, float(solvers.SCALES[-1])) > 0.5).mean()) if len(angles) else 0.0
        median, p90 = np.quantile(np.degrees(angles), (0.5, 0.9)).tolist() if len(angles) else (0.0, 0.0)
        spread = max(spreads.values()) if shared else spreads[limb]
        status, reason = _status(len(angles), median, inliers, spread, settings)
        device = next((take.sensors.devices[limb] for take in takes if limb in take.sensors.devices), "")
        mounting = _plain(mountings[limb])
        sensors[limb] = Mounting(mounting, status, reason, spreads[limb], median, p90, inliers, device)
    if all(sensor.status == REFUSED for sensor in sensors.values()):
        reasons = "; ".join(f"{limb}: {sensor.reason}" for limb, sensor in sensors.items())
        raise InertialError(f"no sensor can be calibrated ({reasons})")
    clocks = {
        take.motion.name: TakeClock(take.clock.offset, {limb: _plain(worlds[i][limb]) for limb in take.sensors.names})
        for i, take in enumerate(takes)
    }
    return Calibration(settings.method, heading, sensors, clocks)


def segments_of(takes: Sequence[CalibrationSequence], heading: str) -> list[SynchronisedSegment]:
    """Return segments in worlds with y up; short ones are skipped."""
    segments = []
    for i, take in enumerate(takes):
        for limb in take.sensors.names:
            segment = take.segment(limb, group=_group(i, limb, heading))
            if len(segment.inertial) >= LEAST_FRAMES:
                segments.append(replace(segment, inertial=UPRIGHT.inv() * segment.inertial).thinned(ROWS))
    if not segments:
        raise InertialError("no sensor and its track have ten frames in common; check clocks and gaps")
    return segments


def _group(take: int, limb: str, heading: str) -> Hashable:
    return (take, limb) if heading == "own" else None


def _by_heading(
    takes: Sequence[CalibrationSequence], limbs: Sequence[str], heading: str
) -> tuple[list[dict[str, Rotation]], dict[str, Rotation]]:
    """Return worlds and mountings; a sensor with too few frames has the world of another one."""
    psis, mountings = solvers.heading(segments_of(takes, heading))
    worlds = []
    for i, take in enumerate(takes):
        groups = [_group(i, limb, heading) for limb in take.sensors.names]
        there = next((psis[group] for group in groups if group in psis), next(iter(psis.values())))
        turns = [UPRIGHT * solvers.yaw(psis.get(group, there)) for group in groups]
        worlds.append(dict(zip(take.sensors.names, turns, strict=True)))
    return worlds, {limb: mountings.get(limb, Rotation.identity()) for limb in limbs}


def worlds_of(calibration: Calibration, take: CalibrationSequence) -> dict[str, Rotation]:
    """Return `q_G` of every sensor in a sequence: the shared one, or a heading for each sensor.

    A sensor without north has another heading in each recording; its mounting is constant.
    """
    if calibration.heading == "shared":
        return {limb: other.world(limb) for other in calibration.takes.values() for limb in other.worlds}
    mountings: solvers.Mountings = {limb: calibration.mounting(limb) for limb in calibration.sensors}
    segments = segments_of([take], "own")
    return {str(s.sensor): UPRIGHT * solvers.yaw(solvers.heading_given([s], mountings)) for s in segments}


def _by_thesis(
    takes: Sequence[CalibrationSequence], limbs: Sequence[str]
) -> tuple[list[dict[str, Rotation]], dict[str, Rotation]]:
    """Return world and mounting of each sensor separately, from all sequences together, which share one world."""
    worlds: list[dict[str, Rotation]] = [{} for _ in takes]
    mountings = {}
    for limb in limbs:
        rng = np.random.default_rng(0)
        own = [(i, take.segment(limb)) for i, take in enumerate(takes) if limb in take.sensors.names]
        inertial, tracked = zip(*((s.inertial, s.tracked) for _, s in own), strict=True)
        segment = SynchronisedSegment(limb, None, Rotation.concatenate(inertial), Rotation.concatenate(tracked))
        if len(segment.inertial) < LEAST_FRAMES:
            raise InertialError(f"the sensor on {limb} and its track have {len(segment.inertial)} frames in common")
        thinned = segment.thinned(ROWS)
        world, mountings[limb] = solvers.thesis(thinned.inertial, thinned.tracked, rng)
        for i, _ in own:
            worlds[i][limb] = world
    return worlds, mountings


def refined_clock(
    take: CalibrationSequence, worlds: dict[str, Rotation], mountings: dict[str, Rotation]
) -> CalibrationSequence:
    """Return the sequence with the clock lag of the smallest calibrated distance.

    Orientations determine the lag more accurately than angular speeds.
    """
    largest, step_size = 0.06, 0.01  # seconds, largest correction of the clock, and the step between two tried ones
    lags = np.arange(-largest, largest + 1e-9, step_size)
    costs = np.zeros(len(lags))
    for k, lag in enumerate(lags):
        for limb in worlds:
            segment = take.segment(limb, lag=lag).thinned(ROWS)
            if len(segment.inertial) >= LEAST_FRAMES:
                costs[k] += solvers.cost_of(
                    solvers.residuals(segment, worlds[limb], mountings[limb]), float(solvers.SCALES[-1])
                )
    best = int(costs.argmin())
    if best in (0, len(lags) - 1):
        return take
    offset = take.clock.offset + lags[best] + step_size * parabola(-costs, best)
    return replace(take, clock=replace(take.clock, offset=float(offset)))


def _residuals(
    takes: Sequence[CalibrationSequence], worlds: Sequence[dict[str, Rotation]], limb: str, mounting: Rotation
) -> tuple[np.ndarray, Rotation]:
    """Return the residuals (N,), radians, and the tracked orientations of all frames with sensor and track."""
    own = [(take.segment(limb), world[limb]) for take, world in zip(takes, worlds, strict=True) if limb in world]
    angles = np.concatenate([solvers.residuals(segment, world, mounting) for segment, world in own])
    return angles, Rotation.concatenate([segment.tracked for segment, _ in own])


def _spread(tracked: Rotation, method: str) -> float:
    """Return the degrees by which the vertical moves in the limb's frame.

    For `thesis`, which uses no vertical, the spread of the rotations about their second axis. The orientations are
    those of frames with agreement of sensor and track, because tracking errors look like motion.
    """
    if len(tracked) < LEAST_FRAMES:
        return 0.0
    if method == "robust":
        up = tracked.inv().apply([0.0, 1.0, 0.0])
        return float(np.degrees(np.sqrt(((up - up.mean(axis=0)) ** 2).sum(axis=1).mean())))
    turns = (tracked.mean().inv() * tracked).as_rotvec()
    squares = np.linalg.eigvalsh(np.einsum("ni,nj->ij", turns, turns) / len(turns))
    return float(np.degrees(np.sqrt(max(squares[1], 0.0))))


def _status(
    frames: int, median: float, inliers: float, spread: float, settings: CalibrationSettings
) -> tuple[str, str]:
    """Return the status of a mounting with its reason, from its median residual and its spread in degrees."""
    # Degrees of spread of a good mounting, and below which a mounting is refused.
    good, weak = (15.0, 5.0) if settings.method == "robust" else (20.0, 8.0)
    largest_residual = 40.0  # degrees, largest median residual of a sensor that belongs to the track
    # Fraction of frames with a weight above one half (residual below 6.4 degrees) of a good mounting. On simulated
    # sensors with partly wrong tracks, mountings with 0.5 or more were within 1.3 degrees; below 0.3 the median was 31.
    good_inliers = 0.5
    what = "tilted" if settings.method == "robust" else "turned about a second axis"
    if frames < LEAST_FRAMES:
        return REFUSED, f"only {frames} frames have both sensor and track"
    if settings.refuse and median > largest_residual:
        return REFUSED, f"its median residual is {median:.0f} degrees; check placement and clock"
    if settings.refuse and spread < weak:
        return REFUSED, f"it {what} by {spread:.1f} degrees only; record bends of at least {good:.0f} degrees"
    if spread < good:
        return WEAK, f"it {what} by {spread:.1f} degrees; {good:.0f} are needed"
    if inliers < good_inliers:
        return WEAK, (
            f"it agrees with the track in {100 * inliers:.0f} % of the frames only, its median residual is "
            f"{median:.0f} degrees; {100 * good_inliers:.0f} % are needed; record a visible limb for longer"
        )
    return GOOD, ""


def _plain(rotation: Rotation) -> tuple[float, float, float, float]:
    w, x, y, z = rotation.as_quat(canonical=True, scalar_first=True).tolist()
    return w, x, y, z
