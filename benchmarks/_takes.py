"""Recordings of the simulated suite and of Qammaz's four sequences with image joints, and the errors of a tracker."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.support.casting import Scene
from tests.support.image_joints import detected
from tests.support.scenes import record_scene
from tests.support.sequences import DISTANCE, record_sequence, sequence_body
from tests.support.solo import Solo
from tests.support.suite import digest_of
from toolkit.app.pipeline.image_joints import JointChoice, store_joints
from toolkit.app.pipeline.scan import VIEW_FRAMES, scan_recordings
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.personal import load_body_file, save_body
from toolkit.evaluation.joint_errors import joint_errors
from toolkit.mocap.clip import PoseClip
from toolkit.recordings.opening import open_recording
from toolkit.sensing.joints2d import Joints2D
from toolkit.sensing.recording import Recording
from toolkit.simulation.simulate import simulate_recording
from toolkit.tracking.tracker_protocol import Tracker

SOURCES = ("colour", "depth", "truth", "none")
"""Sources of joints: network on colour or shaded depth, true joints with errors of the network, none."""
ENOUGH, WITHIN = 18, 0.15


def is_right(joints: np.ndarray, truth: np.ndarray) -> bool:
    """Return whether 18 of the 20 joints (20, 3) are within 150 mm."""
    return int((joint_errors(joints[None], truth[None]) < WITHIN).sum()) >= ENOUGH


def prepared(take: Scene, source: str, work: Path, frames: int) -> Recording:
    """Return the take with image joints from `source`."""
    path = record_scene(take, work, frames, color=source == "colour")
    return with_joints(path, source, work, take.seed)


def with_joints(path: Path, source: str, work: Path, seed: int = 0) -> Recording:
    """Return a recording with image joints from `source`; joints of a network are stored beside it.

    `seed` is that of the errors of joints that are the true ones.
    """
    if source == "none":
        return open_recording(path)
    if source == "truth":
        recording = open_recording(path)
        rng = np.random.default_rng(seed)
        recording.give_joints_2d(detected(np.asarray(recording.joints), recording.camera.undistorted(), rng))
        return recording
    folders = ["toolkit/landmarks", "toolkit/sensing"]
    kept = work / "joints" / f"{path.stem}_{source}_{digest_of([], folders)}.npz"
    return open_recording(kept) if kept.exists() else store_joints(open_recording(path), kept, JointChoice(source))


def joints_of(recording: Recording, i: int) -> tuple[Joints2D, ...]:
    """Return the image joints of the frame itself."""
    return () if recording.image_joints is None else recording.joints_2d(i)


class Tracked(NamedTuple):
    """Estimated and true joints (T, 20, 3), metres, and milliseconds of each frame (T,), of one recording."""

    joints: np.ndarray
    truth: np.ndarray
    milliseconds: np.ndarray = np.zeros(0)

    @property
    def errors(self) -> np.ndarray:
        """Distances to the true joints (T, 20), metres."""
        distances: np.ndarray = np.linalg.norm(self.joints - self.truth, axis=2)
        return distances


def follow(tracker: Tracker, recording: Recording) -> Tracked:
    """Track a recording."""
    solo = Solo(tracker, recording)
    results = [
        solo.step(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i))
        for i in range(len(recording))
    ]
    joints = np.array([r.joints for r in results])
    return Tracked(joints, np.asarray(recording.joints), np.array([r.stage_ms.sum() for r in results]))


def swarm_figures(tracked: Sequence[Tracked]) -> dict[str, float]:
    """Return means over recordings; times over frames, without the first of each."""
    errors = [t.errors for t in tracked]
    figures = {"delta_mm": 1000.0 * float(np.mean([e.mean() for e in errors]))}
    for limit in (50, 80, 100):
        figures[f"a{limit}"] = float(np.mean([(e < limit / 1000.0).mean() for e in errors]))
    times = np.concatenate([t.milliseconds[1:] for t in tracked])
    if len(times):
        figures["median_ms"], figures["p99_ms"] = (float(np.percentile(times, q)) for q in (50, 99))
    return figures


TURNS = (0.0, 90.0, 180.0, 270.0)
"""Yaws of the four views of a scan, degrees to the left."""


def sequence(name: str, source: str, work: Path, frames: int, yaw: float = 0.0) -> Recording:
    """Return a sequence of `frames` frames with image joints from `source`; see `with_joints`, `record_sequence`."""
    return with_joints(record_sequence(name, work, frames, yaw), source, work)


def view_of(name: str, degrees: float, work: Path) -> Path:
    """Return the subject of a sequence in a T-pose, rotated."""
    path = work / "scans" / f"{name}_{degrees:.0f}.npz"
    clip = PoseClip("T-pose", np.zeros((VIEW_FRAMES, skeleton.POSE_SIZE)), 30.0, "scan")
    simulate_recording(
        clip, path, body=sequence_body(name), yaw=degrees, sensor="kinect", distance=DISTANCE, height=1.2,
        furnished=False, seed=int(degrees),
    )  # fmt: skip
    return path


def scanned(name: str, work: Path) -> Body:
    """Return the body of a sequence's subject as found by `depthmocap body scan`, made unless present."""
    folders = ["toolkit/simulation", "toolkit/body", "toolkit/fitting", "toolkit/sensing"]
    path = work / "scans" / f"{name}_{digest_of([sequence_body], folders, name)}.npz"
    if not path.exists():
        save_body(scan_recordings([view_of(name, degrees, work) for degrees in TURNS]).body, path)
    return load_body_file(path)
