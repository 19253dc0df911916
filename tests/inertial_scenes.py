"""Motions with inertial sensors, and run folders of them, for the tests of inertial sensors."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from tests.run_helpers import track_of
from tests.support.worn_sensors import SensorNoise, SimulatedSensors, simulate_sensors
from toolkit.body import skeleton
from toolkit.body.shape import ShapeSpace, subject_body
from toolkit.inertial.sensor_limbs import TrackedMotion
from toolkit.mocap.procedural import procedural_clips
from toolkit.tracks import TRACKED, RunInfo

RATE = 30.0
FIVE = ("left_shin", "right_shin", "left_forearm", "right_forearm", "pelvis")


@lru_cache(maxsize=8)
def poses_of(name: str = "knee_to_elbow") -> np.ndarray:
    """Return poses (T, P) of a bundled motion at 30 frames a second."""
    return procedural_clips([name], rate=RATE, body=subject_body("neutral"), seed=0)[0].poses


def motion_of(name: str = "knee_to_elbow", poses: np.ndarray | None = None) -> TrackedMotion:
    poses = poses_of(name) if poses is None else poses
    return TrackedMotion.of_poses(subject_body("neutral"), poses, np.arange(len(poses)) / RATE, name=name)


def sensors_of(
    name: str = "knee_to_elbow", limbs: tuple[str, ...] = FIVE, noise: str | SensorNoise = "none", seed: int = 0
) -> SimulatedSensors:
    return simulate_sensors(subject_body("neutral"), poses_of(name), RATE, limbs, noise, seed)


def write_run(folder: Path, poses: np.ndarray, state: np.ndarray | None = None) -> Path:
    """Write a finished run folder whose track has these poses, on the neutral body."""
    count = len(poses)
    body = ShapeSpace.load().body([])
    track = track_of(body.joint_positions(poses), poses, np.arange(count) / RATE, TRACKED if state is None else state)
    folder.mkdir(parents=True, exist_ok=True)
    track.save(folder)
    RunInfo(
        recording="nowhere.npz", recording_sha256="0", reader_options={}, body_fingerprint=skeleton.fingerprint(),
        shape=[], scale=1.0, database="", level_rotation=np.diag([1.0, -1.0, -1.0]).ravel().tolist(), sensing={},
        version="0",
    ).save(folder)  # fmt: skip
    return folder
