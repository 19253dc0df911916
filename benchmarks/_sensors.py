"""Simulated sensors on recordings: true poses as the camera's level frame has them, and calibrations that err."""

from __future__ import annotations

import numpy as np

from toolkit import skeleton
from toolkit.inertial.calibration import GOOD, Calibration, Mounting, TakeClock
from toolkit.rotations import quaternions as quat
from toolkit.simulation.inertial import SimulatedSensors


def levelled(poses: np.ndarray, yaw: float) -> np.ndarray:
    """Poses (T, P) of a clip in the camera's level frame: turned so that the first one faces it, then by yaw."""
    facing = quat.rotate(quat.exponential(poses[0, skeleton.ROOT_ROTATION]), [0.0, 0.0, 1.0])
    turn = quat.exponential([0.0, np.radians(yaw) - np.arctan2(facing[0], facing[2]), 0.0])
    out = poses.copy()
    out[:, :3] = quat.rotate(turn, poses[:, :3])
    out[:, skeleton.ROOT_ROTATION] = quat.logarithm(
        quat.multiply(turn, quat.exponential(poses[:, skeleton.ROOT_ROTATION]))
    )
    return out


def wrong_calibration(
    simulated: SimulatedSensors, name: str, degrees: float, seconds: float, rng: np.random.Generator
) -> Calibration:
    """The true calibration with every mounting turned by so many degrees about some axis and a clock that is off."""

    def turned(q: np.ndarray) -> tuple[float, float, float, float]:
        axis = rng.normal(size=3)
        w, x, y, z = quat.multiply(q, quat.exponential(np.radians(degrees) * axis / np.linalg.norm(axis)))
        return float(w), float(x), float(y), float(z)

    mountings = {limb: Mounting(turned(q), GOOD) for limb, q in simulated.mounting.items()}
    w, x, y, z = (float(value) for value in simulated.world)
    worlds = dict.fromkeys(mountings, (w, x, y, z))
    clock = TakeClock(simulated.offset + seconds, simulated.rate, worlds)
    return Calibration("robust", "shared", mountings, {name: clock})
