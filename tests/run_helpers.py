"""Calls of the command, and run folders of synthetic tracks of one or several people."""

from pathlib import Path

import numpy as np
import pytest

from toolkit.app.cli.main import main
from toolkit.body import skeleton
from toolkit.tracks import EMPTY, TRACKED, FrameResult, RunInfo, Track, TrackWriter
from toolkit.tracks.runs import PersonSummary, save_people

TURN = np.diag([1.0, -1.0, -1.0])
"""R_level_camera of a camera that looks horizontally, its own inverse."""
KNOWN_SIZE = ("--set", "shape.seconds=0", "--set", "sizes=[-0.6]")
"""Options of `track` for people with the stature of the simulated ones: one size, no body learning."""


def run(*words: object) -> int:
    """Return the exit code of the command."""
    with pytest.raises(SystemExit) as stop:
        main([str(word) for word in words])
    return int(stop.value.code or 0)


def track_of(
    joints: np.ndarray, poses: np.ndarray | None = None, times: np.ndarray | None = None,
    state: np.ndarray | int = TRACKED, confidence: float = 1.0,
) -> Track:  # fmt: skip
    """Return a track of joints (T, 20, 3), camera frame; without `times` at 10 frames a second."""
    count = len(joints)
    return Track(
        joints=joints.astype(np.float32), pose=np.zeros((count, skeleton.POSE_SIZE)) if poses is None else poses,
        confidence=np.full((count, 20), confidence, np.float32), state=np.full(count, state, np.uint8),
        source=np.zeros(count, np.uint8), timestamps=np.arange(count) / 10.0 if times is None else times,
        stage_ms=np.ones((count, 1), np.float32), observed=np.ones((count, 20), dtype=bool),
        source_names=("local",), stage_names=("fit",),
    )  # fmt: skip


def write_run(
    run: Path,
    poses: np.ndarray,
    *,
    shape: float = 0.5,
    absent: int = 0,
    rate: float = 25.0,
    recording: str = "/r.npz",
    contact: np.ndarray | None = None,
) -> Path:
    """Write a finished run of poses (T, P) without a person in the first `absent` frames; `contact` (T, 2) are foot
    contacts.
    """
    turn = TURN.ravel().tolist()
    info = RunInfo(recording, "ab", {}, skeleton.fingerprint(), [shape], 1.1, "", turn, {}, "0")
    joints = (info.body().joint_positions(poses) @ TURN).astype(np.float32)
    writer = TrackWriter(run, ("fit",), ("local",))
    for i, pose in enumerate(poses):
        state, confidence = (EMPTY, 0.0) if i < absent else (TRACKED, 0.9)
        row = FrameResult(pose, joints[i], np.full(20, confidence, np.float32), state, 0, np.ones(1))
        writer.append(row, 1.0 + i / rate)
    writer.finish(contacts=None if contact is None else lambda _: contact)
    info.save(run)
    return run


def write_people(run: Path, poses: np.ndarray) -> Path:
    """Write a run of two people with other shapes and the same motion a metre apart; the second enters after one
    frame.
    """
    beside = poses.copy()
    beside[:, 0] += 1.0
    write_run(run / "person_01", poses)
    write_run(run / "person_02", beside, shape=-1.0, absent=1)
    last = len(poses) - 1
    save_people(
        run,
        [
            PersonSummary(1, "person_01", 0, last, 1.8, 1.0, 0.0, 0.0),
            PersonSummary(2, "person_02", 1, last, 1.7, 1.0, 0.0, 0.0),
        ],
    )
    return run
