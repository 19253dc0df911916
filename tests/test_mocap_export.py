"""Exported poses come back: through our reader, through pybvh, through a table."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pybvh
import pytest

from tests.mocap_helpers import stick_body
from toolkit.body import skeleton
from toolkit.errors import BodyError, OutputError, UsageError
from toolkit.mocap.export import export_bvh, export_csv, export_track
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from toolkit.track import TRACKED, FrameResult, RunInfo, TrackWriter


def random_poses(count: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    low, high = np.clip(skeleton.POSE_LIMITS, -3.0, 3.0).T
    return rng.uniform(0.8 * low, 0.8 * high, (count, skeleton.POSE_SIZE))


def placed_joints(poses: np.ndarray) -> np.ndarray:
    body = stick_body()
    return np.array([body.place(pose).origins for pose in poses])


def test_an_exported_bvh_is_read_back_within_a_millimetre(tmp_path: Path) -> None:
    body, poses = stick_body(), random_poses(40)
    export_bvh(tmp_path / "track.bvh", body, poses, 29.97)
    clip = read_clip(tmp_path / "track.bvh")
    columns = [clip.index(name) for name in skeleton.JOINT_NAMES]
    np.testing.assert_allclose(clip.world()[0][:, columns], placed_joints(poses), atol=1e-5)
    assert clip.frame_rate == pytest.approx(29.97, abs=1e-3)
    np.testing.assert_allclose(clip.rest[columns], body.joints, atol=1e-6)


def test_pybvh_reads_the_exported_joints_within_a_millimetre(tmp_path: Path) -> None:
    poses = random_poses(40)
    export_bvh(tmp_path / "track.bvh", stick_body(), poses, 30.0)
    oracle = pybvh.read_bvh_file(tmp_path / "track.bvh")
    names = [node.name for node in oracle.nodes]
    found = oracle.node_positions()[:, [names.index(name) for name in skeleton.JOINT_NAMES]] / 100.0
    np.testing.assert_allclose(found, placed_joints(poses), atol=1e-5)


def test_the_end_sites_of_an_exported_bvh_are_the_reported_tips(tmp_path: Path) -> None:
    body, poses = stick_body(), random_poses(10)
    export_bvh(tmp_path / "track.bvh", body, poses, 30.0)
    clip = read_clip(tmp_path / "track.bvh")
    positions, rotations = clip.world()
    joints = body.joint_positions(poses)
    for site, carrier in skeleton.SITES:
        j = clip.index(carrier)
        tip = positions[:, j] + rotations[:, j] @ clip.end_sites[carrier]
        np.testing.assert_allclose(tip, joints[:, skeleton.REPORTED.index(site)], atol=1e-5)


def test_an_exported_track_retargets_to_itself(tmp_path: Path) -> None:
    from toolkit.mocap.procedural import perform

    body = stick_body()
    poses = perform("boxing", body).poses
    export_bvh(tmp_path / "track.bvh", body, poses, 30.0)
    again = retarget(read_clip(tmp_path / "track.bvh"), body)
    error = np.linalg.norm(body.joint_positions(again.poses) - body.joint_positions(poses), axis=2)
    assert error.max() < 0.03
    assert error.mean() < 0.005


def test_one_pose_is_a_track_too_and_none_is_refused(tmp_path: Path) -> None:
    body = stick_body()
    export_bvh(tmp_path / "one.bvh", body, np.zeros(skeleton.POSE_SIZE), 30.0)
    assert len(read_clip(tmp_path / "one.bvh")) == 1
    with pytest.raises(UsageError, match="0 poses"):
        export_bvh(tmp_path / "none.bvh", body, np.zeros((0, skeleton.POSE_SIZE)), 30.0)
    with pytest.raises(BodyError, match="43 entries"):
        export_bvh(tmp_path / "none.bvh", body, np.zeros((2, 10)), 30.0)
    assert not (tmp_path / "none.bvh").exists()


def test_the_csv_of_joints_is_read_back_and_unknown_joints_stay_empty(tmp_path: Path) -> None:
    joints = stick_body().joint_positions(random_poses(6)).astype(np.float32)
    joints[2, 5] = np.nan
    export_csv(tmp_path / "joints.csv", joints, np.arange(6) / 30.0)
    with (tmp_path / "joints.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows[2]["left_elbow_x_m"] == ""
    assert float(rows[1]["time_s"]) == pytest.approx(1 / 30.0, abs=1e-6)
    for i, name in enumerate(skeleton.REPORTED):
        found = [float(rows[4][f"{name}_{axis}_m"]) for axis in "xyz"]
        np.testing.assert_allclose(found, joints[4, i], atol=1e-6)


def test_a_csv_needs_one_time_per_frame_and_a_writable_folder(tmp_path: Path) -> None:
    with pytest.raises(BodyError, match="timestamps"):
        export_csv(tmp_path / "joints.csv", np.zeros((3, 20, 3)), np.zeros(4))
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="cannot write"):
        export_csv(tmp_path / "file" / "joints.csv", np.zeros((3, 20, 3)), np.zeros(3))


def test_an_exported_track_has_the_fitted_body_and_the_tracks_own_times(tmp_path: Path) -> None:
    turn = np.diag([1.0, -1.0, -1.0])
    info = RunInfo("/r.npz", "ab", {}, skeleton.fingerprint(), [0.5], 1.1, "", turn.ravel().tolist(), {}, "0")
    info.save(tmp_path)
    body, poses = info.body(), random_poses(6)
    joints = (body.joint_positions(poses) @ turn).astype(np.float32)
    writer = TrackWriter(tmp_path, ("fit",), ("local",))
    for i, pose in enumerate(poses):
        writer.append(FrameResult(pose, joints[i], np.ones(20, np.float32), TRACKED, 0, np.ones(1)), i / 25.0)
    writer.finish()
    export_track(tmp_path, tmp_path / "track.bvh")
    clip = read_clip(tmp_path / "track.bvh")
    assert clip.frame_rate == pytest.approx(25.0)
    for name in ("left_elbow", "right_knee", "left_wrist"):
        found = clip.world()[0][:, clip.index(name)] @ turn
        np.testing.assert_allclose(found, joints[:, skeleton.REPORTED.index(name)], atol=1e-3)
    export_track(tmp_path, tmp_path / "track.csv")
    assert len((tmp_path / "track.csv").read_text().splitlines()) == 7
    with pytest.raises(UsageError, match=r"neither .bvh nor .csv"):
        export_track(tmp_path, tmp_path / "track.txt")
