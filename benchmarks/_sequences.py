"""The four sequences of Qammaz's kind as the benchmarks need them: with joints in the image, and the scanned bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks._takes import with_joints
from toolkit import skeleton
from toolkit.body.body import Body
from toolkit.body.personal import load_body_file, save_body
from toolkit.mocap.clip import PoseClip
from toolkit.pipeline.scan import FRAMES, scan_recordings
from toolkit.sensing.recording import Recording
from toolkit.simulation.simulate import simulate_recording
from toolkit.testing.sequences import DISTANCE, record_sequence, sequence_body
from toolkit.testing.suite import digest_of

TURNS = (0.0, 90.0, 180.0, 270.0)
"""Degrees to the left, of the four views of a scan."""


def sequence(name: str, source: str, work: Path, frames: int) -> Recording:
    """A sequence of `frames` frames with joints in the image from `source`; see `with_joints`."""
    return with_joints(record_sequence(name, work, frames), source, work)


def view_of(name: str, degrees: float, work: Path) -> Path:
    """The subject of a sequence in a T-pose, turned."""
    path = work / "scans" / f"{name}_{degrees:.0f}.npz"
    clip = PoseClip("T-pose", np.zeros((FRAMES, skeleton.POSE_SIZE)), 30.0, "scan")
    simulate_recording(
        clip, path, body=sequence_body(name), yaw=degrees, sensor="kinect", distance=DISTANCE, height=1.2,
        furnished=False, seed=int(degrees),
    )  # fmt: skip
    return path


def scanned(name: str, work: Path) -> Body:
    """The body of a sequence's subject as `depthmocap body scan` finds it, made if it is not there yet."""
    folders = ["toolkit/simulation", "toolkit/body", "toolkit/fitting", "toolkit/sensing"]
    path = work / "scans" / f"{name}_{digest_of([sequence_body], folders, name)}.npz"
    if not path.exists():
        save_body(scan_recordings([view_of(name, degrees, work) for degrees in TURNS]).body, path)
    return load_body_file(path)
