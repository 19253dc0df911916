"""Orientation from raw measurements: integrated gyroscope, tilt from gravity, free heading.

The integrated frame rotates only with the drift of the gyroscope's bias. The accelerations of a limb in it cancel over
time, so a slow low-pass leaves gravity (as in Laidig and Seel 2023). Lower weights for accelerated rows increase the
tilt error, because all accelerations together cancel and a part of them does not. The inertial world has z up; the
heading is free.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate
from operator import mul

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.body.rotations.matrices import swing
from toolkit.inertial.stream import FREE, Sensors, SensorStream
from toolkit.io.errors import InertialError


def oriented(sensors: Sensors) -> Sensors:
    """Return the sensors with orientations: their own, else fused.

    Raises
    ------
    InertialError
        A sensor without orientations has no gyroscope or no accelerometer.
    """
    streams = tuple(s if s.rotations is not None else fused(s) for s in sensors)
    return replace(sensors, streams=streams)


def fused(stream: SensorStream) -> SensorStream:
    """Return a stream with orientations from gyroscope and accelerometer.

    Parameters
    ----------
    stream : raw measurements

    Raises
    ------
    InertialError
        The stream has no gyroscope or no accelerometer.
    """
    if stream.gyro is None or stream.acceleration is None:
        raise InertialError(
            f"sensor {stream.name} has no orientation and no gyroscope and accelerometer to make one from; "
            "record quaternions or both"
        )
    rows = np.flatnonzero(stream.valid)
    times, gyro = stream.times[rows], stream.gyro[rows]
    free = integrated(times, gyro - gyroscope_bias(times, gyro))
    rotations = Rotation.identity(len(stream))
    rotations[rows] = _upright(free, times, stream.acceleration[rows]) * free
    return replace(stream, rotations=rotations, origin=FREE)


def integrated(times: np.ndarray, gyro: np.ndarray) -> Rotation:
    """Return the N orientations of a sensor in the frame of its first row, from its rates (N, 3), rad/s."""
    turns = Rotation.from_rotvec(0.5 * (gyro[1:] + gyro[:-1]) * np.diff(times)[:, None])
    return Rotation.concatenate(list(accumulate(turns, mul, initial=Rotation.identity())))


def gyroscope_bias(times: np.ndarray, gyro: np.ndarray) -> np.ndarray:
    """Return the mean rate (3,) of the still windows; zero if the sensor never rests."""
    still_seconds = 0.5  # seconds, shortest rest; its mean rate is the bias
    width = max(2, round(still_seconds / float(np.median(np.diff(times)))))
    if len(gyro) < width:
        return np.zeros(3)
    windows = np.lib.stride_tricks.sliding_window_view(gyro, width, axis=0)
    means = windows.mean(axis=2)
    still_rate = 0.03  # rad/s, largest standard deviation of the gyroscope at rest
    still = windows.std(axis=2).max(axis=1) < still_rate
    largest_bias = 0.1  # rad/s; a steady rotation that is faster is no rest
    still &= np.linalg.norm(means, axis=1) < largest_bias
    return np.median(means[still], axis=0) if still.any() else np.zeros(3)


def _upright(free: Rotation, times: np.ndarray, acceleration: np.ndarray) -> Rotation:
    """Return the N rotations of the integrated frame that align gravity with z."""
    # Seconds, standard deviation of the low-pass of gravity: longer than a motion, shorter than the drift.
    gravity_seconds = 1.5
    up = _smoothed(free.apply(acceleration), gravity_seconds / float(np.median(np.diff(times))))
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-9)
    return Rotation.from_matrix(swing(up, np.array([0.0, 0.0, 1.0])))


def _smoothed(values: np.ndarray, sigma: float) -> np.ndarray:
    """Return a Gaussian mean over rows (N, K), without padding beyond the ends."""
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(values, sigma, axis=0, mode="constant", truncate=3.0)
