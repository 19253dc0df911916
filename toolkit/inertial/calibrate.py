"""How sensors sit on the limbs and where their world points, from what a tracker saw (thesis 7.5).

The default, `robust`, knows the vertical in both worlds: what is left of `q_G` is a heading, one for all sensors of a
magnetic world or one each, and one turn about a horizontal axis determines all. Frames in which the tracker erred lose
their say. `thesis` is the reference, by Park and Martin. Neither gives a number that the motion does not determine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.body.rotations import quaternions as quat
from toolkit.inertial import solvers
from toolkit.inertial.calibration import GOOD, REFUSED, WEAK, Calibration, Mounting, TakeClock
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.solvers import SynchronisedSegment
from toolkit.inertial.stream import FREE, Sensors
from toolkit.inertial.synchronise import Clock
from toolkit.io.errors import InertialError, UsageError

METHODS, HEADINGS = ("robust", "thesis"), ("shared", "own")
AGREE = np.radians(20.0)
"""Residual below which a frame speaks for itself."""
GOOD_SPREAD: dict[str, float] = {"robust": 15.0, "thesis": 20.0}
WEAK_SPREAD: dict[str, float] = {"robust": 5.0, "thesis": 8.0}
"""Degrees of spread (see `_spread`) from which a mounting is good, or is told at all."""
GOOD_INLIERS = 0.5
"""Share of the frames in which sensor and track agree from which a mounting is good (a weight above one half: within
6.4 degrees, so that at one half the median residual is below that too). On simulated sensors whose track is wrong for a
part of the time, every mounting with one half or more is right within 1.3 degrees; below 0.3 it is off by 31 in the
median."""
MOST_RESIDUAL = 40.0
"""Degrees, median residual above which sensor and track do not belong together."""
LEAST_FRAMES = 10
"""Frames that sensor and track have in common, below which nothing is said."""
ROWS = 600
"""Frames per strand that take part."""
LAGS, LAG_STEP = 0.06, 0.01
"""Seconds: largest correction of the clock by what the calibration leaves over, and the step between those tried."""
Y_UP: np.ndarray = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class CalibrationSettings:
    """How sensors are calibrated.

    Attributes
    ----------
    method : `robust` or `thesis`
    heading : `shared`, `own`, or None: shared where the devices know north
    refine_clock : whether the clock may be corrected by what the calibration leaves over
    refuse : whether mountings that the motion does not determine, or that disagree with the track, are refused
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
    """One tracked recording with its sensors and their clock."""

    motion: TrackedMotion
    sensors: Sensors
    clock: Clock

    def measured(self, sensor: str, lag: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Orientations of a sensor in the motion's frames, quaternions (T, 4), and where both are known, bool (T,)."""
        inertial, known = self.sensors.named(sensor).at(self.clock.sensor_times(self.motion.times) + lag)
        return inertial, known & self.motion.valid

    def strand(self, limb: str, number: int = 0, group: int = 0, lag: float = 0.0) -> SynchronisedSegment:
        """Orientations of a sensor and of its part of the body where both are known."""
        inertial, known = self.measured(limb, lag)
        return SynchronisedSegment(number, group, inertial[known], self.motion.orientation(limb)[known])


def calibrate(takes: Sequence[CalibrationSequence], settings: CalibrationSettings | None = None) -> Calibration:
    """The calibration that all takes agree on.

    Parameters
    ----------
    takes : of one person whose sensors stay where they are; their names differ
    settings : see `CalibrationSettings`

    Raises
    ------
    InertialError
        No sensor and no track have `LEAST_FRAMES` in common, or the motion determines no sensor at all.
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
                takes = [better_clock(take, worlds[i], mountings) for i, take in enumerate(takes)]
    spreads = {limb: _spread(takes, limb, worlds, mountings[limb], settings.method) for limb in limbs}
    shared = heading == "shared" and settings.method == "robust"
    sensors = {limb: _judged(takes, limb, worlds, mountings[limb], spreads, shared, settings) for limb in limbs}
    if all(sensor.status == REFUSED for sensor in sensors.values()):
        reasons = "; ".join(f"{limb}: {sensor.reason}" for limb, sensor in sensors.items())
        raise InertialError(f"no sensor can be calibrated ({reasons})")
    clocks = {
        take.motion.name: TakeClock(
            take.clock.offset, take.clock.rate, {limb: _plain(worlds[i][limb]) for limb in take.sensors.names}
        )
        for i, take in enumerate(takes)
    }
    return Calibration(settings.method, heading, sensors, clocks)


def upright(world_up: np.ndarray) -> np.ndarray:
    """The change of axes (4,) from a world with y up, such as the level frame, to one with `world_up`."""
    return quat.between(Y_UP, world_up)


def strands_of(
    takes: Sequence[CalibrationSequence], limbs: Sequence[str], heading: str
) -> tuple[list[SynchronisedSegment], list[int]]:
    """Strands in worlds with y up, and for each the number of its take; those of few frames are left out."""
    strands, owners, groups = [], [], 0
    for i, take in enumerate(takes):
        change = quat.conjugate(upright(take.sensors.world_up))
        for limb in take.sensors.names:
            group = groups if heading == "own" else 0
            strand = take.strand(limb, limbs.index(limb), group)
            if len(strand.inertial) < LEAST_FRAMES:
                continue
            strands.append(replace(strand, inertial=quat.multiply(change, strand.inertial)).thinned(ROWS))
            owners.append(i)
            groups += 1
    if not strands:
        raise InertialError("no sensor and its track have ten frames in common; check clocks and gaps")
    return strands, owners


def _by_heading(
    takes: Sequence[CalibrationSequence], limbs: Sequence[str], heading: str
) -> tuple[list[dict[str, np.ndarray]], dict[str, np.ndarray]]:
    strands, owners = strands_of(takes, limbs, heading)
    groups = max(s.group for s in strands) + 1
    psis, mountings = np.zeros(groups), np.tile(quat.IDENTITY, (len(limbs), 1))
    if heading == "own":  # sensors with headings of their own have nothing to say to each other
        for k in range(len(limbs)):
            own = [s for s in strands if s.sensor == k]
            numbers = sorted({s.group for s in own})
            local = [replace(s, sensor=0, group=numbers.index(s.group)) for s in own]
            found, mounting, _ = solvers.heading(local, len(numbers), 1)
            psis[numbers], mountings[k] = found, mounting[0]
    else:
        psis, mountings, _ = solvers.heading(strands, groups, len(limbs))
    worlds: list[dict[str, np.ndarray]] = [{} for _ in takes]
    for strand, i in zip(strands, owners, strict=True):
        up = upright(takes[i].sensors.world_up)
        worlds[i][limbs[strand.sensor]] = quat.multiply(up, solvers.yaw(psis[strand.group]))
    return _filled(worlds, takes), dict(zip(limbs, mountings, strict=True))


def _by_thesis(
    takes: Sequence[CalibrationSequence], limbs: Sequence[str]
) -> tuple[list[dict[str, np.ndarray]], dict[str, np.ndarray]]:
    """World and mounting of each sensor by itself, from all takes at once: they share one world."""
    worlds: list[dict[str, np.ndarray]] = [{} for _ in takes]
    mountings = {}
    for limb in limbs:
        rng = np.random.default_rng(0)
        own = [(i, take.strand(limb)) for i, take in enumerate(takes) if limb in take.sensors.names]
        strand = SynchronisedSegment(
            0, 0, np.concatenate([s.inertial for _, s in own]), np.concatenate([s.tracked for _, s in own])
        )
        if len(strand.inertial) < LEAST_FRAMES:
            raise InertialError(f"the sensor on {limb} and its track have {len(strand.inertial)} frames in common")
        thinned = strand.thinned(ROWS)
        world, mountings[limb] = solvers.thesis(thinned.inertial, thinned.tracked, rng)
        for i, _ in own:
            worlds[i][limb] = world
    return worlds, mountings


def _filled(worlds: list[dict[str, np.ndarray]], takes: Sequence[CalibrationSequence]) -> list[dict[str, np.ndarray]]:
    """A sensor without frames of its own in a take has the world of the others there, else of any take."""
    anywhere = next(world for own in worlds for world in own.values())
    for own, take in zip(worlds, takes, strict=True):
        there = next(iter(own.values()), anywhere)
        for limb in take.sensors.names:
            own.setdefault(limb, there)
    return worlds


def better_clock(
    take: CalibrationSequence, worlds: dict[str, np.ndarray], mountings: dict[str, np.ndarray]
) -> CalibrationSequence:
    """The take with its clock at the lag of least calibrated distance: orientations are sharper than their speeds."""
    lags = np.arange(-LAGS, LAGS + 1e-9, LAG_STEP)
    costs = np.zeros(len(lags))
    for k, lag in enumerate(lags):
        for limb in worlds:
            strand = take.strand(limb, lag=lag).thinned(ROWS)
            if len(strand.inertial) >= LEAST_FRAMES:
                costs[k] += solvers.cost_of(
                    solvers.residuals(strand, worlds[limb], mountings[limb]), float(solvers.SCALES[-1])
                )
    best = int(costs.argmin())
    if best in (0, len(lags) - 1):
        return take
    left, middle, right = costs[best - 1 : best + 2]
    bend = left - 2.0 * middle + right
    step = 0.5 * (left - right) / bend if bend > 0 else 0.0
    offset = take.clock.offset + lags[best] + LAG_STEP * step
    return replace(take, clock=replace(take.clock, offset=float(offset)))


def _spread(
    takes: Sequence[CalibrationSequence],
    limb: str,
    worlds: Sequence[dict[str, np.ndarray]],
    mounting: np.ndarray,
    method: str,
) -> float:
    """Degrees by which the vertical moves about in the limb's frame; of `thesis`, which knows no vertical, the extent
    of the turns about their second axis.

    Of the frames in which sensor and track agree: a tracker that errs pretends a motion.
    """
    parts = []
    for i, take in enumerate(takes):
        if limb in take.sensors.names:
            strand = take.strand(limb)
            agree = solvers.residuals(strand, worlds[i][limb], mounting) < AGREE
            parts.append(strand.tracked[agree])
    tracked = np.concatenate(parts)
    if len(tracked) < LEAST_FRAMES:
        return 0.0
    if method == "robust":
        up = quat.rotate(quat.conjugate(tracked), Y_UP)
        return float(np.degrees(np.sqrt(((up - up.mean(axis=0)) ** 2).sum(axis=1).mean())))
    turns = quat.logarithm(quat.multiply(quat.conjugate(quat.mean(tracked, np.ones(len(tracked)))), tracked))
    squares = np.linalg.eigvalsh(np.einsum("ni,nj->ij", turns, turns) / len(turns))
    return float(np.degrees(np.sqrt(max(squares[1], 0.0))))


def _judged(
    takes: Sequence[CalibrationSequence],
    limb: str,
    worlds: Sequence[dict[str, np.ndarray]],
    mounting: np.ndarray,
    spreads: dict[str, float],
    shared: bool,
    settings: CalibrationSettings,
) -> Mounting:
    """A mounting with its residuals and whether the motion determined it."""
    angles = np.concatenate(
        [
            solvers.residuals(take.strand(limb), worlds[i][limb], mounting)
            for i, take in enumerate(takes)
            if limb in take.sensors.names
        ]
    )
    degrees = np.degrees(angles)
    # a shared heading is known by all sensors together, the best of which is enough
    spread = max(spreads.values()) if shared else spreads[limb]
    good, weak = GOOD_SPREAD[settings.method], WEAK_SPREAD[settings.method]
    what = "tilted" if settings.method == "robust" else "turned about a second axis"
    inliers = float((solvers.weights_of(angles, float(solvers.SCALES[-1])) > 0.5).mean()) if len(degrees) else 0.0
    status, reason = GOOD, ""
    if len(degrees) < LEAST_FRAMES:
        status, reason = REFUSED, f"only {len(degrees)} frames are known to both"
    elif settings.refuse and float(np.median(degrees)) > MOST_RESIDUAL:
        status = REFUSED
        reason = f"it disagrees by {np.median(degrees):.0f} degrees in the middle; check placement and clock"
    elif settings.refuse and spread < weak:
        status, reason = (
            REFUSED,
            f"it {what} by {spread:.1f} degrees only; bend and lean in a take of at least {good:.0f}",
        )
    elif spread < good:
        status, reason = WEAK, f"it {what} by {spread:.1f} degrees; {good:.0f} make it sure"
    elif inliers < GOOD_INLIERS:
        status = WEAK
        reason = (
            f"it agrees with the track in {100 * inliers:.0f} % of the frames only, its median residual is "
            f"{np.median(degrees):.0f} degrees; {100 * GOOD_INLIERS:.0f} % make it sure: show the limb longer"
        )
    return Mounting(
        _plain(mounting), status, reason, spreads[limb],
        float(np.median(degrees)) if len(degrees) else 0.0,
        float(np.quantile(degrees, 0.9)) if len(degrees) else 0.0,
        inliers,
        next((t.sensors.devices[limb] for t in takes if limb in t.sensors.devices), ""),
    )  # fmt: skip


def _plain(q: np.ndarray) -> tuple[float, float, float, float]:
    w, x, y, z = (float(value) for value in (-q if q[0] < 0 else q))
    return w, x, y, z
