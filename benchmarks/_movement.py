"""Simulated people who walk, squat, rise and stand, with true poses and tracks, for the benchmarks of feet and gait."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from filelock import FileLock

from tests.support.suite import WORK, motion_of
from tests.support.walking import Rising, Walk, rising, walking
from toolkit.app.pipeline import TrackerRecipe
from toolkit.app.pipeline.run import track_recording
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import subject_body
from toolkit.database import DEFAULT_DATABASE
from toolkit.mocap.clip import PoseClip
from toolkit.motion.contact import foot_contacts
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import level_rotation
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, prepare, simulate_scene
from toolkit.tracks import TRACK_FILE, TRACKED
from toolkit.tracks.runs import Person, load_persons

RATE = 30.0


class Take(NamedTuple):
    """Recording: name, motion (synthetic or mocap), body, sensor, yaw in degrees, distance in metres, seed."""

    name: str
    motion: Walk | Rising | str
    body: str
    sensor: str
    yaw: float
    distance: float
    seed: int


TAKES = (
    Take("walk_towards", Walk(1.1, 108.0, 0.12, 0.62), "average_female", "kinect", 0.0, 3.9, 1),
    Take("walk_across", Walk(1.2, 112.0, 0.10, 0.62), "tall_male", "kinect", 80.0, 4.2, 2),
    Take("walk_slow", Walk(0.75, 88.0, 0.18, 0.66), "elderly", "tof", 15.0, 4.0, 3),
    Take("walk_mocap", "02_01", "slim_male", "kinect", 20.0, 4.2, 4),
    Take("squats", Rising(2, 1.1, 0.0, 0.5, 0.42, 0.25), "athletic_male", "kinect", 25.0, 3.0, 5),
    Take("sit_to_stand", Rising(2, 1.3, 0.9, 0.5, 0.38, 0.34), "heavy_female", "kinect", 30.0, 3.0, 6),
    Take("stand", Rising(count=0, stand=3.0), "average_male", "kinect", 15.0, 3.2, 7),
    Take("stand_tof", Rising(count=0, stand=3.0), "short_female", "tof", -20.0, 2.6, 8),
)


class Tracked(NamedTuple):
    """Tracked person with the true body and the true poses, float64 (T, P), level frame."""

    person: Person
    body: Body
    poses: np.ndarray

    @property
    def truth(self) -> Person:
        """Return the true person, as a track."""
        track, turn = self.person.track, self.person.R_level_camera
        joints = (self.body.joint_positions(self.poses) @ turn).astype(np.float32)
        found = replace(track, pose=self.poses, joints=joints, state=np.full(len(track), TRACKED, dtype=np.uint8))
        return Person("truth", replace(found, contact=foot_contacts(self.body, found)), self.body, turn)


def tracked_run(recording: Path, run: Path, database: Path) -> Person:
    """Return the one person of a recording, tracked into `run` unless present."""
    if not (run / TRACK_FILE).exists():
        tracker = TrackerRecipe(database=database).build()
        track_recording(open_recording(recording), tracker, run, resume=True)
    return load_persons(run)[0]


def tracked_shot(performer: SimulatedPerson, shot: CaptureSettings, run: Path, database: Path) -> Tracked:
    """Return a simulated person, recorded in the file `<run>.npz` and tracked, both unless present."""
    recording = run.with_name(f"{run.name}.npz")
    run.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(run.with_name(f"{run.name}.lock")):  # benchmarks of the same takes may run at the same time
        if not recording.exists():
            simulate_scene([performer], recording, shot)
        person = tracked_run(recording, run, database)
    simulation = prepare([performer], shot)
    true = simulation.performers[0]
    turn = level_rotation(simulation.view.up_camera)
    poses = true.poses.copy()
    poses[:, skeleton.ROOT_POSITION] = simulation.view.to_camera(poses[:, None, :3])[:, 0] @ turn.T
    return Tracked(person, true.body, poses)


def tracked(take: Take, work: Path, database: Path) -> Tracked:
    """Return a synthetic take, in `work`."""
    body = subject_body(take.body, seed=take.seed)
    performer = SimulatedPerson(PoseClip(take.name, _poses(take, body), RATE, take.name), body=body, yaw=take.yaw)
    shot = CaptureSettings(sensor=take.sensor, distance=take.distance, height=1.2, furnished=True, seed=take.seed)
    return tracked_shot(performer, shot, work / take.name, database)


def _poses(take: Take, body: Body) -> np.ndarray:
    if isinstance(take.motion, str):
        poses = motion_of(take.motion, body).poses
    elif isinstance(take.motion, Walk):
        poses = walking(body, take.motion, 3.4 / take.motion.speed, RATE)[0]
    else:
        poses = rising(body, take.motion, RATE)
    poses[:, [0, 2]] -= 0.5 * (poses[:, [0, 2]].min(axis=0) + poses[:, [0, 2]].max(axis=0))
    return poses


OPTIONS = {"database": DEFAULT_DATABASE, "work": WORK / "movement"}
"""Options of benchmarks with these recordings: database and work folder."""
