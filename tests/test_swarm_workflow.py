"""Workflow without a database at the command line: simulate, joints, track, evaluate, render."""

import json
from pathlib import Path

import numpy as np

from tests.run_helpers import run
from tests.support.image_joints import DetectorErrors, detected
from tests.support.subjects import moving_poses
from tests.test_joint_files import folder_of, one
from toolkit.body.shape import subject_body
from toolkit.output.export.bvh import export_bvh
from toolkit.recordings.opening import open_recording
from toolkit.tracks import RunInfo, Track

FRAMES = 6


def test_a_motion_becomes_a_recording_with_joints_a_track_a_table_and_a_picture(tmp_path: Path) -> None:
    clip, take, told = tmp_path / "motion.bvh", tmp_path / "take.npz", tmp_path / "told.npz"
    poses = moving_poses(FRAMES, np.random.default_rng(0))
    poses[:, :3] -= poses[0, :3] - [0.0, 0.95, 0.0]
    export_bvh(clip, subject_body("neutral"), poses, 30.0)
    assert run("simulate", clip, "--output", take, "--color", "--body", "neutral", "--empty") == 0
    recording = open_recording(take)
    assert recording.color(0) is not None and len(recording) == FRAMES
    exact = DetectorErrors(sigma=0.0, missed=0.0, swapped=0.0)
    rows = detected(np.asarray(recording.joints), recording.camera, np.random.default_rng(0), exact)
    folder = folder_of(tmp_path / "json", *(one(np.nan_to_num(frame)) for frame in rows))
    assert run("joints", take, "--joints", folder, "--output", told) == 0
    few = ["--set", "sizes=[0.4]", "--set", "shape.seconds=0", "--set", "swarm.particles=16"]
    assert run("track", told, "--config", "swarm", *few, "--output", tmp_path / "run") == 0
    info = RunInfo.load(tmp_path / "run")
    assert info.tracker == "swarm" and info.joints_2d.startswith("given") and info.database in ("", None)
    off = np.linalg.norm(Track.load(tmp_path / "run").joints - recording.joints, axis=2)
    assert np.median(off) < 0.08
    assert run("evaluate", tmp_path / "run", "--output", tmp_path / "scores") == 0
    assert json.loads((tmp_path / "scores" / "table.json").read_text())
    assert run("render", tmp_path / "run", "--output", tmp_path / "frame.png") == 0
    assert (tmp_path / "frame.png").stat().st_size > 1000
