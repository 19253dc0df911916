"""The clock of the sensors against that of the camera: correlation of what both know without calibration.

Angular speed and the size of the acceleration, gravity included, do not change when the sensor or the world is turned
(thesis 7.6.1 takes the second alone). Both are low-passed alike, correlated over the lags, and the correlations of all
signals of all sensors of one clock are summed, by how many rows each has. `t_sensor = rate * t_camera + offset`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.body.rotations import quaternions as quat
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.stream import GRAVITY, Sensors, SensorStream
from toolkit.io.errors import InertialError
from toolkit.kernels.motion.inertial import correlation_over_lags

STILL = 0.05
"""rad/s: a sensor whose angular speed spreads by less rests throughout."""
RATES = (0.8, 2.2)
"""Least and largest ratio of clocks that differ, sensor seconds per camera second."""
RATE_STEP = 0.01
"""Relative step between ratios; over 3 s one step shifts the ends by 15 ms."""
STEP = 0.01
"""Seconds, of the common grid of times."""
SMOOTHING, SMOOTHING_FRAMES = 0.06, 2.0
"""Standard deviation of the low-pass that both signals pass: seconds, and at least so many frames of the camera, for
slower cameras say less about fast turns."""
LEAST_OVERLAP = 0.5
"""Share of the track that a lag must leave."""
MARGIN = 0.05
"""By how much the highest correlation must exceed that of any other peak; periodic motion locks a period off."""
APART = 0.2
"""Seconds: a second peak is at least so far away."""


@dataclass(frozen=True)
class SyncSettings:
    """How clocks are compared.

    Attributes
    ----------
    max_offset : s, largest offset that is looked for
    rates : least and largest ratio of the clocks, sensor seconds per camera second, that is looked for; None: they run
        alike
    """

    max_offset: float = 3.0
    rates: tuple[float, float] | None = None


@dataclass(frozen=True)
class Clock:
    """`t_sensor = rate * t_camera + offset`, in seconds, and how sure it is.

    Attributes
    ----------
    offset, rate : of the sensors' clock
    correlation : mean correlation of all signals there, -1 to 1
    second : that of the best lag elsewhere
    """

    offset: float
    rate: float = 1.0
    correlation: float = 1.0
    second: float = -1.0

    def sensor_times(self, camera_times: np.ndarray) -> np.ndarray:
        """The sensors' times at times of the camera."""
        return self.rate * np.asarray(camera_times, np.float64) + self.offset


@dataclass(frozen=True, eq=False)
class Signal:
    """A curve on a uniform grid: values (N,) and where they are known (N,); `start` is the time of the first, s."""

    values: np.ndarray
    known: np.ndarray
    start: float


def synchronise(
    motion: TrackedMotion, sensors: Sensors, settings: SyncSettings | None = None, *, check: bool = True
) -> Clock:
    """The clock of sensors that share one, by all their signals at once.

    Parameters
    ----------
    motion : what the tracker says
    sensors : named after the parts of the body that carry them
    settings : see `SyncSettings`
    check : refuse a clock that is not sure

    Raises
    ------
    InertialError
        No sensor overlaps the track or all rest; the best lag is the last one looked at, or hardly better than another.
    """
    settings = settings or SyncSettings()
    rates = _rates(settings)
    smoothing = smoothing_for(motion, float(np.sqrt(rates[0] * rates[-1])))
    moving = [stream for stream in sensors if not is_still(stream)]
    if not moving:
        raise InertialError(
            f"the sensors {', '.join(sensors.names)} rest throughout; nothing can be synchronised without motion"
        )
    measured = [sensor_signals(stream, smoothing) for stream in moving]
    reach = round(settings.max_offset / STEP)
    lags = np.arange(-reach, reach + 1)
    # a clock may start anywhere: offsets are looked for around that which lets both begin together
    base = float(min(stream.times[stream.valid][0] for stream in moving))
    scores = np.full((len(rates), len(lags)), np.nan)
    for r, rate in enumerate(rates):
        tracked = [track_signals(motion, stream.name, rate, smoothing) for stream in moving]
        begin = rate * motion.times[0]
        offset = base - begin if abs(base - begin) > settings.max_offset else 0.0
        scores[r] = _summed(tracked, measured, lags, offset)
    if not np.isfinite(scores).any():
        raise InertialError(
            f"no sensor overlaps {motion.name} for half its length: the track runs from {motion.times[0]:.2f} to "
            f"{motion.times[-1]:.2f} s, the sensors from {base:.2f} s; raise --max-offset or name the right files"
        )
    r, k = divmod(int(np.nanargmax(scores)), scores.shape[1])
    begin = rates[r] * motion.times[0]
    shift = base - begin if abs(base - begin) > settings.max_offset else 0.0
    # the second peak is looked for at the same ratio: along the ridge of ratio against offset nothing is periodic
    elsewhere = np.abs(lags - lags[k]) * STEP >= APART
    second = highest_peak(np.where(elsewhere, scores[r], np.nan), scores[r])
    clock = Clock(
        float(shift + STEP * (lags[k] + parabola(scores[r], int(k)))),
        float(rates[r] * (1.0 + RATE_STEP * parabola(scores[:, k], int(r)))) if len(rates) > 1 else 1.0,
        float(scores[r, k]),
        second,
    )
    if check:
        _check(clock, int(k) in (0, len(lags) - 1), motion)
    return clock


def smoothing_for(motion: TrackedMotion, rate: float) -> float:
    """Standard deviation of the low-pass for a track, seconds of sensors whose clock is `rate` times as fast."""
    step = float(np.median(np.diff(motion.times))) if len(motion.times) > 1 else 0.0
    return max(SMOOTHING, SMOOTHING_FRAMES * rate * step)


def is_still(stream: SensorStream) -> bool:
    """Whether a sensor rests throughout."""
    return float(np.std(_angular_speed(stream)[1])) < STILL


def sensor_signals(stream: SensorStream, smoothing: float) -> list[Signal]:
    """Angular speed and size of the acceleration of a sensor, on its own clock, under a Gaussian of `smoothing` s."""
    times, rates = _angular_velocity(stream)
    signals = [_size(times, rates, smoothing)]
    if stream.acceleration is not None:
        vectors = stream.acceleration
        if stream.rotations is not None:  # vectors are low-passed in a frame that does not turn, as the track's are
            vectors = quat.rotate(stream.rotations, vectors)
        signals.append(_size(stream.times[stream.valid], vectors[stream.valid], smoothing))
    return signals


def track_signals(motion: TrackedMotion, limb: str, rate: float, smoothing: float) -> list[Signal]:
    """The same of a tracked part of the body; camera seconds are stretched by `rate`."""
    times = rate * motion.times[motion.valid]
    turned = quat.continuous(motion.orientation(limb)[motion.valid])
    middles = 0.5 * (times[1:] + times[:-1])
    signals = [_size(middles, quat.angular_velocity(turned, times), smoothing)]
    grid, path, known = on_grid(times, motion.middle(limb)[motion.valid])
    if len(grid) > 4:
        smooth = _low_passed(path, smoothing)
        acceleration = np.gradient(np.gradient(smooth, STEP, axis=0), STEP, axis=0)
        acceleration[:, 1] += GRAVITY
        size = np.linalg.norm(acceleration, axis=1)
        known[:2] = known[-2:] = False
        signals.append(Signal(size, known, float(grid[0])))
    return signals


def _angular_velocity(stream: SensorStream) -> tuple[np.ndarray, np.ndarray]:
    times = stream.times[stream.valid]
    if stream.gyro is not None:
        return times, stream.gyro[stream.valid]
    assert stream.rotations is not None  # a stream has one or the other
    return 0.5 * (times[1:] + times[:-1]), quat.angular_velocity(stream.rotations[stream.valid], times)


def _angular_speed(stream: SensorStream) -> tuple[np.ndarray, np.ndarray]:
    times, rates = _angular_velocity(stream)
    return times, np.linalg.norm(rates, axis=1)


def _size(times: np.ndarray, vectors: np.ndarray, smoothing: float) -> Signal:
    grid, values, known = on_grid(times, vectors)
    return Signal(np.linalg.norm(_low_passed(values, smoothing), axis=1), known, float(grid[0]))


def on_grid(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values (N, K) on the common grid, whose times are whole steps, and where they are known."""
    first, last = np.ceil(times[0] / STEP - 1e-6), np.floor(times[-1] / STEP + 1e-6)
    grid = STEP * np.arange(first, max(last, first) + 1)
    low = np.clip(np.searchsorted(times, grid, side="right") - 1, 0, len(times) - 2)
    wide = times[low + 1] - times[low]
    # a camera that drops frames leaves holes; what is guessed in them says nothing
    known = wide <= max(0.1, 2.5 * float(np.median(np.diff(times))))
    columns = [np.interp(grid, times, values[:, c]) for c in range(values.shape[1])]
    return grid, np.stack(columns, axis=1), known


def _low_passed(values: np.ndarray, smoothing: float) -> np.ndarray:
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(values, smoothing / STEP, axis=0, mode="nearest")


def _rates(settings: SyncSettings) -> np.ndarray:
    if settings.rates is None:
        return np.ones(1)
    low, high = np.log(settings.rates)
    return np.exp(np.arange(low, high, np.log1p(RATE_STEP)))


def _summed(
    tracked: Sequence[Sequence[Signal]],
    measured: Sequence[Sequence[Signal]],
    lags: np.ndarray,
    offset: float,
) -> np.ndarray:
    """Mean correlation of all pairs of signals over the lags (L,), each lag by the pairs known there."""
    total, weight = np.zeros(len(lags)), np.zeros(len(lags))
    out = np.empty(len(lags))
    for ours, theirs in zip(tracked, measured, strict=True):
        for a, b in zip(ours, theirs, strict=False):
            shift = round((a.start + offset - b.start) / STEP)
            least = int(LEAST_OVERLAP * a.known.sum())
            correlation_over_lags(a.values, a.known, b.values, b.known, lags + shift, max(least, 10), out)
            known = np.isfinite(out)
            total[known] += out[known]
            weight[known] += 1.0
    full = max(weight.max(initial=0.0), 1.0)
    # lags at which part of the sensors has no data are compared by less; below half of them by too little
    return np.where(weight >= 0.5 * full, total / np.maximum(weight, 1.0), np.nan)


def parabola(values: np.ndarray, k: int) -> float:
    """Place of the vertex through a peak and its neighbours, in steps from `k`, at most half of one."""
    if k in (0, len(values) - 1) or not np.isfinite(values[k - 1 : k + 2]).all():
        return 0.0
    left, middle, right = values[k - 1 : k + 2]
    bend = left - 2.0 * middle + right
    return float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5)) if bend < 0 else 0.0


def highest_peak(values: np.ndarray, whole: np.ndarray) -> float:
    """The highest local maximum of `whole` where `values` is known; -1 where there is none."""
    inner = np.arange(1, len(whole) - 1)
    peaks = inner[(whole[inner] >= whole[inner - 1]) & (whole[inner] >= whole[inner + 1]) & np.isfinite(values[inner])]
    return float(values[peaks].max()) if len(peaks) else -1.0


def _check(clock: Clock, at_border: bool, motion: TrackedMotion) -> None:
    if at_border:
        raise InertialError(
            f"the clocks of {motion.name} agree best at the border of the search, an offset of {clock.offset:.2f} s; "
            "raise --max-offset"
        )
    if clock.correlation - clock.second < MARGIN:
        raise InertialError(
            f"the clocks of {motion.name} agree nearly as well at two offsets (correlations {clock.correlation:.2f} "
            f"and {clock.second:.2f}, apart by less than {MARGIN:g}); record a motion that does not repeat "
            "itself, or narrow the search with --max-offset"
        )
