"""Simulated inertial sensors on a moving body, with realistic noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from toolkit.body.body import Body
from toolkit.inertial.sensor_limbs import TrackedMotion, bone_axis, bone_vector
from toolkit.inertial.stream import GRAVITY, Sensors, SensorStream, checked_stream
from toolkit.inertial.synchronise import angular_velocity

Y_UP_TO_Z_UP = Rotation.from_rotvec([np.pi / 2, 0.0, 0.0])
"""Rotation from a world with y up to one with z up."""


SOFT_SECONDS = 0.3
"""Correlation time of the soft-tissue rotation between a sensor and its bone, seconds."""


@dataclass(frozen=True)
class SensorNoise:
    """Noise of a set of sensors; angles in degrees, times in seconds.

    Attributes
    ----------
    rate : samples a second
    tilt : standard deviation of a constant error of the vertical, per sensor
    white : standard deviation of the error of each orientation
    heading_walk : standard deviation of the heading after one minute, a random walk
    soft_tissue : standard deviation of a slow rotation between sensor and bone, see `SOFT_SECONDS`
    gyro : rad/s, white
    gyro_bias : rad/s, constant
    acceleration : m/s2, white
    offset : largest offset of the sensors' clock from the camera's
    skew : parts per million, largest difference of the clocks' rates
    lost : fraction of lost packets, in runs of one to five
    """

    rate: float = 100.0
    tilt: float = 0.0
    white: float = 0.0
    heading_walk: float = 0.0
    soft_tissue: float = 0.0
    gyro: float = 0.0
    gyro_bias: float = 0.0
    acceleration: float = 0.0
    offset: float = 0.0
    skew: float = 0.0
    lost: float = 0.0


NOISE: dict[str, SensorNoise] = {
    "none": SensorNoise(),
    "mtx": SensorNoise(
        tilt=1.0, white=0.3, heading_walk=1.0, soft_tissue=2.5, gyro=0.01, gyro_bias=0.005, acceleration=0.05,
        offset=1.5, skew=20.0, lost=0.005,
    ),
    "phone": SensorNoise(
        rate=60.0, tilt=2.0, white=0.8, heading_walk=6.0, soft_tissue=5.0, gyro=0.03, gyro_bias=0.02,
        acceleration=0.15, offset=1.5, skew=80.0, lost=0.02,
    ),
}  # fmt: skip
"""Noise of strapped sensors as in the thesis (`mtx`), and of a phone in a pocket or a sleeve (`phone`)."""


@dataclass(frozen=True, eq=False)
class SimulatedSensors:
    """Sensor streams with their truth.

    Attributes
    ----------
    sensors : measured streams, on the sensors' clock
    offset, rate : of their clock, `t_sensor = rate * t_camera + offset`
    world : `q_G`: level frame to inertial world
    mounting : part of the body -> `q_L`: sensor to the part's frame
    noise : noise of the sensors
    """

    sensors: Sensors
    offset: float
    rate: float
    world: Rotation
    mounting: dict[str, Rotation]
    noise: SensorNoise


def simulate_sensors(
    body: Body,
    poses: np.ndarray,
    frame_rate: float,
    limbs: Sequence[str],
    noise: str | SensorNoise = "mtx",
    seed: int = 0,
    start: float = 0.0,
) -> SimulatedSensors:
    """Simulate sensors on a body that moves through poses at a frame rate.

    Parameters
    ----------
    body : body with the sensors
    poses : float64 (T, P), any frame with y up; offsets refer to this frame
    frame_rate : poses a second
    limbs : names of `sensor_limbs.PARTS`
    noise : name of `NOISE`, or the noise itself
    seed : seed of offsets, clock and noise
    start : time of the first pose on the camera's clock, seconds
    """
    noise = NOISE[noise] if isinstance(noise, str) else noise
    rng = np.random.default_rng([seed, 7])
    times = start + np.arange(len(poses)) / frame_rate
    motion = TrackedMotion.of_poses(body, poses, times)
    world = Y_UP_TO_Z_UP * Rotation.from_rotvec([0.0, rng.uniform(-np.pi, np.pi), 0.0])
    clock = (rng.uniform(-1, 1) * noise.offset, 1.0 + 1e-6 * noise.skew * rng.uniform(-1, 1))
    mounting = {limb: Rotation.from_quat(rng.normal(size=4), scalar_first=True) for limb in limbs}
    streams = [_measure(motion, limb, world, mounting[limb], clock, noise, rng) for limb in limbs]
    devices = {limb: f"sim{k:02d}" for k, limb in enumerate(limbs)}
    sensors = Sensors(tuple(streams), source={"files": ["simulated"], "devices": devices})
    return SimulatedSensors(sensors, *clock, world, mounting, noise)


def _measure(
    motion: TrackedMotion,
    limb: str,
    world: Rotation,
    mounting: Rotation,
    clock: tuple[float, float],
    noise: SensorNoise,
    rng: np.random.Generator,
) -> SensorStream:
    """Return one stream; orientations and positions between the poses are splines, and rates their derivatives."""
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import RotationSpline

    camera = np.arange(motion.times[0], motion.times[-1] + 1e-9, 1.0 / noise.rate)
    spline = RotationSpline(motion.times, motion.orientation(limb))
    # position near the far end of the bone, on the skin
    at = 0.7 * bone_vector(motion.body, limb) + 0.04 * np.roll(bone_axis(limb), 1)
    places = motion.middle(limb) + motion.orientation(limb).apply(at - 0.5 * bone_vector(motion.body, limb))
    acceleration = CubicSpline(motion.times, places)(camera, 2) + [0.0, GRAVITY, 0.0]
    slow = _slow(rng, len(camera), SOFT_SECONDS * noise.rate)
    soft = Rotation.from_rotvec(np.radians(noise.soft_tissue / np.sqrt(3.0)) * slow)
    true = world * spline(camera) * soft * mounting
    walk = np.cumsum(rng.normal(size=len(camera))) * np.radians(noise.heading_walk) / np.sqrt(60.0 * noise.rate)
    tilt = np.append(np.radians(noise.tilt) * rng.normal(size=2), 0.0)
    wrong = Rotation.from_rotvec(walk[:, None] * [0.0, 0.0, 1.0]) * Rotation.from_rotvec(tilt)
    white = Rotation.from_rotvec(np.radians(noise.white / np.sqrt(3.0)) * rng.normal(size=(len(camera), 3)))
    rates = (soft * mounting).inv().apply(spline(camera, 1))
    if noise.soft_tissue:
        turned = angular_velocity(soft * mounting, camera)
        rates = rates + np.concatenate([turned, turned[-1:]])
    stream = checked_stream(
        limb,
        clock[1] * camera + clock[0],
        rotations=(wrong * true * white).as_quat(scalar_first=True),
        gyro=rates + noise.gyro * rng.normal(size=rates.shape) + noise.gyro_bias * rng.normal(size=3),
        acceleration=true.inv().apply(world.apply(acceleration)) + noise.acceleration * rng.normal(size=rates.shape),
    )
    return _thinned(stream, noise.lost, rng)


def _slow(rng: np.random.Generator, count: int, width: float) -> np.ndarray:
    """Return noise (count, 3) of unit variance, correlated over `width` samples."""
    from scipy.ndimage import gaussian_filter1d

    pad = int(4 * width) + 1
    raw = gaussian_filter1d(rng.normal(size=(count + 2 * pad, 3)), width, axis=0)[pad:-pad]
    return raw * np.sqrt(2.0 * np.sqrt(np.pi) * width)


def _thinned(stream: SensorStream, lost: float, rng: np.random.Generator) -> SensorStream:
    """Return the stream without lost packets."""
    keep = np.ones(len(stream), dtype=bool)
    for start in np.flatnonzero(rng.random(len(stream)) < lost / 3.0):
        keep[start : start + rng.integers(1, 6)] = False
    keep[[0, -1]] = True
    return replace(
        stream, times=stream.times[keep], rotations=stream.rotations[keep], gyro=stream.gyro[keep],
        acceleration=stream.acceleration[keep], valid=stream.valid[keep],
    )  # fmt: skip
