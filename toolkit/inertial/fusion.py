"""Orientation from raw measurements: the gyroscope integrated, the tilt held by gravity, the heading free.

The integrated frame turns only as fast as the gyroscope's bias drifts. In it the accelerations of a limb cancel over
time, since it does not fly away, and what remains of a slow low-pass is gravity (as in Laidig and Seel 2023). To let
rows count less in which the limb accelerates makes the tilt worse: over time those accelerations cancel, of the others
only some do. The inertial world has z up. With a steady magnetic field the heading is tied to north; else it is free.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit.body.rotations import quaternions as quat
from toolkit.inertial.stream import FREE, Sensors, SensorStream
from toolkit.io.errors import InertialError
from toolkit.kernels.motion.inertial import integrate

NORTH = "gyroscope, gravity and magnetic north"
UP: np.ndarray = np.array([0.0, 0.0, 1.0])
GRAVITY_SECONDS = 1.5
"""Standard deviation of the low-pass that leaves gravity: longer than a motion, shorter than the drift."""
STILL_RATE, STILL_SECONDS = 0.03, 0.5
"""rad/s, standard deviation of the gyroscope within a rest, and how long one lasts at least; its mean rate is the
bias."""
MOST_BIAS = 0.1
"""rad/s: a steadier turn that is faster is no rest."""
STEADY_FIELD = 0.1
"""Share by which the magnetic field's strength may differ from its median to be north."""


def oriented(sensors: Sensors) -> Sensors:
    """The sensors with an orientation each: their own where they have one, else fused.

    Raises
    ------
    InertialError
        A sensor without orientations has no gyroscope or no accelerometer.
    """
    if all(stream.rotations is not None for stream in sensors):
        return sensors
    streams = tuple(s if s.rotations is not None else fused(s, sensors.world_up) for s in sensors)
    return replace(sensors, streams=streams)


def fused(stream: SensorStream, world_up: np.ndarray = UP, declination: float = 0.0) -> SensorStream:
    """One stream with orientations from its gyroscope, accelerometer and, where it is steady, magnetometer.

    Parameters
    ----------
    stream : raw measurements
    world_up : (3,), the vertical of the world that is wanted
    declination : degrees by which magnetic north lies east of the north that x points to (thesis, App. A); with 0 x
        points to magnetic north, and a calibration finds what is left as part of the heading

    Raises
    ------
    InertialError
        It has no gyroscope or no accelerometer.
    """
    if stream.gyro is None or stream.acceleration is None:
        raise InertialError(
            f"sensor {stream.name} has no orientation and no gyroscope and accelerometer to make one from; "
            "record quaternions or both"
        )
    rows = np.flatnonzero(stream.valid)
    times, gyro = stream.times[rows], stream.gyro[rows]
    free = np.empty((len(rows), 4))
    integrate(np.ascontiguousarray(times), gyro - gyroscope_bias(times, gyro), free)
    q = quat.multiply(_upright(free, times, stream.acceleration[rows]), free)
    origin = FREE
    if stream.magnetic is not None and (turn := _north(q, stream.magnetic[rows], declination)) is not None:
        q, origin = quat.multiply(quat.exponential(turn[:, None] * UP), q), NORTH
    q = quat.multiply(quat.between(UP, world_up), q)
    rotations = np.tile(quat.IDENTITY, (len(stream), 1))
    rotations[rows] = quat.continuous(q)
    return replace(stream, rotations=rotations, origin=origin)


def gyroscope_bias(times: np.ndarray, gyro: np.ndarray) -> np.ndarray:
    """Mean rate (3,) of the still stretches; zero where the sensor never rests."""
    width = max(2, round(STILL_SECONDS / float(np.median(np.diff(times)))))
    if len(gyro) < width:
        return np.zeros(3)
    windows = np.lib.stride_tricks.sliding_window_view(gyro, width, axis=0)
    means = windows.mean(axis=2)
    still = windows.std(axis=2).max(axis=1) < STILL_RATE
    still &= np.linalg.norm(means, axis=1) < MOST_BIAS
    return np.median(means[still], axis=0) if still.any() else np.zeros(3)


def _upright(free: np.ndarray, times: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Turns (N, 4) of the integrated frame that bring gravity on to z, each the smallest after the one before."""
    up = _smoothed(quat.rotate(free, acceleration), GRAVITY_SECONDS / float(np.median(np.diff(times))))
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-9)
    half = np.concatenate([1.0 + up[:, 2:], np.cross(up, UP)], axis=1)
    half[np.linalg.norm(half, axis=1) < 1e-6] = (0.0, 1.0, 0.0, 0.0)
    return quat.normalised(half)


def _smoothed(values: np.ndarray, sigma: float) -> np.ndarray:
    """A Gaussian mean over rows (N, K), of those that are there: nothing is made up beyond the ends."""
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(values, sigma, axis=0, mode="constant", truncate=3.0)


def _north(q: np.ndarray, magnetic: np.ndarray, declination: float) -> np.ndarray | None:
    """Turn about the vertical (N,) that brings x to the north; None where the field is never steady.

    The heading error is smoothed over the steady rows, since a gyroscope drifts slowly.
    """
    strength = np.linalg.norm(magnetic, axis=1)
    typical = float(np.median(strength[strength > 0])) if (strength > 0).any() else 0.0
    steady = (typical > 0) & (np.abs(strength - typical) <= STEADY_FIELD * typical)
    if steady.sum() < max(10, 0.5 * len(q)):
        return None
    field = quat.rotate(q, magnetic / typical)
    horizontal = np.where(steady[:, None], field[:, :2], 0.0)
    smooth = _smoothed(horizontal, max(1.0, len(q) / 8.0))
    return -np.unwrap(np.arctan2(smooth[:, 1], smooth[:, 0])) - np.radians(declination)
