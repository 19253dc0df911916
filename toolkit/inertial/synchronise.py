"""Synchronisation of the sensors' clock with the camera's, by correlation of rotation-invariant signals.

Angular speed and the norm of the acceleration, gravity included, do not depend on the orientation of sensor and world
(thesis 7.6.1 uses only the latter). Both pass the same low-pass and are correlated over the lags. The correlations of
all signals of all sensors of one clock are averaged. `t_sensor = t_camera + offset`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.inertial.stream import GRAVITY, Sensors, SensorStream
from toolkit.io.errors import InertialError

STEP = 0.01
"""Step of the common time grid of the signals, seconds."""
MAX_OFFSET = 3.0
"""Largest offset of the clocks, seconds."""


@dataclass(frozen=True)
class Clock:
    """Clock of the sensors: `t_sensor = t_camera + offset`, in seconds, with its correlation.

    Attributes
    ----------
    offset : offset of the sensors' clock
    correlation : mean correlation of all signals, -1 to 1
    second : correlation of the best other lag
    """

    offset: float
    correlation: float = 1.0
    second: float = -1.0

    def sensor_times(self, camera_times: np.ndarray) -> np.ndarray:
        """Return the sensors' times for times of the camera."""
        return np.asarray(camera_times, np.float64) + self.offset


@dataclass(frozen=True, eq=False)
class Signal:
    """Signal on a uniform grid: values and known, both (N,) or (N, K), and `start`, seconds of the first row."""

    values: np.ndarray
    known: np.ndarray
    start: float

    def __len__(self) -> int:
        return len(self.values)


def synchronise(
    motion: TrackedMotion, sensors: Sensors, max_offset: float = MAX_OFFSET, *, check: bool = True
) -> Clock:
    """Return the common clock of all sensors, from all their signals.

    Parameters
    ----------
    motion : tracked motion
    sensors : sensors, named by their part of the body
    max_offset : largest offset, seconds
    check : raise an error for an uncertain clock

    Raises
    ------
    InertialError
        No sensor overlaps the track, all rest, the best lag is at the border of the search, or another lag is as good.
    """
    # Standard deviation of the low-pass of both signals, seconds; two frames, because slow cameras miss fast rotations.
    smoothing = max(0.06, 2.0 * float(np.median(np.diff(motion.times))))
    moving = [stream for stream in sensors if not is_still(stream)]
    if not moving:
        raise InertialError(
            f"the sensors {', '.join(sensors.names)} rest throughout; nothing can be synchronised without motion"
        )
    measured = [sensor_signals(stream, smoothing) for stream in moving]
    reach = round(max_offset / STEP)
    lags = np.arange(-reach, reach + 1)
    # clocks have any start: the search is centred at the offset of equal starts
    base = float(min(stream.times[stream.valid][0] for stream in moving))
    shift = base - motion.times[0] if abs(base - motion.times[0]) > max_offset else 0.0
    tracked = [track_signals(motion, stream.name, smoothing) for stream in moving]
    scores = _summed(tracked, measured, lags, shift)
    if not np.isfinite(scores).any():
        raise InertialError(
            f"no sensor overlaps {motion.name} for half its length: the track runs from {motion.times[0]:.2f} to "
            f"{motion.times[-1]:.2f} s, the sensors from {base:.2f} s; raise --max-offset or name the right files"
        )
    k = int(np.nanargmax(scores))
    peak_distance = 0.2  # seconds, smallest distance of a second peak
    elsewhere = np.abs(lags - lags[k]) * STEP >= peak_distance
    second = highest_peak(np.where(elsewhere, scores, np.nan), scores)
    clock = Clock(float(shift + STEP * (lags[k] + parabola(scores, k))), float(scores[k]), second)
    if check:
        _check(clock, k in (0, len(lags) - 1), motion)
    return clock


def is_still(stream: SensorStream) -> bool:
    """Return True if a sensor rests all the time."""
    still = 0.05  # rad/s; a sensor with a smaller standard deviation of the angular speed rests
    return float(np.std(np.linalg.norm(_angular_velocity(stream)[1], axis=1))) < still


def sensor_signals(stream: SensorStream, smoothing: float) -> list[Signal]:
    """Return angular speed and norm of the acceleration of a sensor on its clock, smoothed by `smoothing` s."""
    times, rates = _angular_velocity(stream)
    signals = [_size(times, rates, smoothing)]
    if stream.acceleration is not None:
        vectors = stream.acceleration
        if stream.rotations is not None:  # filter the vectors in a fixed frame, as for the track
            vectors = stream.rotations.apply(vectors)
        signals.append(_size(stream.times[stream.valid], vectors[stream.valid], smoothing))
    return signals


def track_signals(motion: TrackedMotion, limb: str, smoothing: float) -> list[Signal]:
    """Return the same signals of a tracked part of the body."""
    times = motion.times[motion.valid]
    turned = motion.orientation(limb)[motion.valid]
    middles = 0.5 * (times[1:] + times[:-1])
    signals = [_size(middles, angular_velocity(turned, times), smoothing)]
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
    return 0.5 * (times[1:] + times[:-1]), angular_velocity(stream.rotations[stream.valid], times)


def angular_velocity(rotations: Rotation, times: np.ndarray) -> np.ndarray:
    """Return the rate of turn (N - 1, 3) between neighbours of N rotations, rad/s, turning frame (thesis, Eq. A.14)."""
    return (rotations[:-1].inv() * rotations[1:]).as_rotvec() / np.diff(times)[:, None]


def _size(times: np.ndarray, vectors: np.ndarray, smoothing: float) -> Signal:
    grid, values, known = on_grid(times, vectors)
    return Signal(np.linalg.norm(_low_passed(values, smoothing), axis=1), known, float(grid[0]))


def on_grid(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values (N, K) on the common grid, whose times are whole steps, with times and known mask."""
    first, last = np.ceil(times[0] / STEP - 1e-6), np.floor(times[-1] / STEP + 1e-6)
    grid = STEP * np.arange(first, max(last, first) + 1)
    low = np.clip(np.searchsorted(times, grid, side="right") - 1, 0, len(times) - 2)
    wide = times[low + 1] - times[low]
    # dropped frames leave gaps, in which interpolated values are not used
    known = wide <= max(0.1, 2.5 * float(np.median(np.diff(times))))
    columns = [np.interp(grid, times, values[:, c]) for c in range(values.shape[1])]
    return grid, np.stack(columns, axis=1), known


def _low_passed(values: np.ndarray, smoothing: float) -> np.ndarray:
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(values, smoothing / STEP, axis=0, mode="nearest")


def _summed(
    tracked: Sequence[Sequence[Signal]],
    measured: Sequence[Sequence[Signal]],
    lags: np.ndarray,
    offset: float,
) -> np.ndarray:
    """Return the mean correlation of all pairs of signals over the lags (L,), from the pairs known at each lag."""
    total, weight = np.zeros(len(lags)), np.zeros(len(lags))
    least_overlap = 0.5  # smallest fraction of the track that a lag covers
    for ours, theirs in zip(tracked, measured, strict=True):
        for a, b in zip(ours, theirs, strict=False):
            shift = round((a.start + offset - b.start) / STEP)
            least = int(least_overlap * a.known.sum())
            found = correlations(a, b, lags + shift, max(least, 10))
            known = np.isfinite(found)
            total[known] += found[known]
            weight[known] += 1.0
    full = max(weight.max(initial=0.0), 1.0)
    # a lag needs data of at least half of the sensors
    return np.where(weight >= 0.5 * full, total / np.maximum(weight, 1.0), np.nan)


def correlations(first: Signal, second: Signal, lags: np.ndarray, least: int) -> np.ndarray:
    """Return the normalised correlation (L,) of `first[i]` with `second[i + lag]` over the values known in both.

    A lag with fewer than `least` common values is NaN, and one with a constant signal.
    """
    from scipy.signal import correlate

    known, values = [], []
    for signal in (first, second):
        centred = np.where(signal.known, signal.values - signal.values[signal.known].mean(), 0.0)
        known.append(signal.known.astype(np.float64).reshape(len(signal), -1).T)
        values.append(centred.reshape(len(signal), -1).T)
    a, b = values
    places = lags + len(first) - 1
    inside = (places >= 0) & (places < len(first) + len(second) - 1)

    def summed(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        over_columns = sum(correlate(v, u, method="fft") for u, v in zip(x, y, strict=True))
        return np.where(inside, np.take(over_columns, places, mode="clip"), 0.0)

    count = np.maximum(np.rint(summed(*known)), 1.0)
    sum_a, sum_b, squares_a, squares_b = (
        summed(a, known[1]), summed(known[0], b), summed(a * a, known[1]), summed(known[0], b * b)
    )  # fmt: skip
    spread_a, spread_b = squares_a - sum_a**2 / count, squares_b - sum_b**2 / count
    moving = (spread_a > 1e-9 * (a * a).sum()) & (spread_b > 1e-9 * (b * b).sum())
    product = np.where(moving, spread_a * spread_b, 1.0)
    return np.where(
        moving & (count >= max(least, 2)), (summed(a, b) - sum_a * sum_b / count) / np.sqrt(product), np.nan
    )


def parabola(values: np.ndarray, k: int) -> float:
    """Return the vertex of the parabola through a peak and its neighbours, in steps from `k`, at most half a step."""
    if k in (0, len(values) - 1) or not np.isfinite(values[k - 1 : k + 2]).all():
        return 0.0
    left, middle, right = values[k - 1 : k + 2]
    bend = left - 2.0 * middle + right
    return float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5)) if bend < 0 else 0.0


def highest_peak(values: np.ndarray, whole: np.ndarray) -> float:
    """Return the highest local maximum of `whole` where `values` is finite, -1 if there is none."""
    inner = np.arange(1, len(whole) - 1)
    peaks = inner[(whole[inner] >= whole[inner - 1]) & (whole[inner] >= whole[inner + 1]) & np.isfinite(values[inner])]
    return float(values[peaks].max()) if len(peaks) else -1.0


def _check(clock: Clock, at_border: bool, motion: TrackedMotion) -> None:
    if at_border:
        raise InertialError(
            f"the clocks of {motion.name} agree best at the border of the search, an offset of {clock.offset:.2f} s; "
            "raise --max-offset"
        )
    # Smallest difference between the highest correlation and any other peak; periodic motion gives equal peaks.
    peak_margin = 0.05
    if clock.correlation - clock.second < peak_margin:
        raise InertialError(
            f"the clocks of {motion.name} agree nearly as well at two offsets (correlations {clock.correlation:.2f} "
            f"and {clock.second:.2f}, apart by less than {peak_margin:g}); record a motion without "
            "repetitions, or narrow the search with --max-offset"
        )
