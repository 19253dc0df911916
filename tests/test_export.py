"""Exported poses read back: by our reader, by pybvh, from a table."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from tests.mocap_helpers import stick_body
from tests.run_helpers import TURN, write_people
from toolkit.body import skeleton
from toolkit.io.errors import RigError, UsageError
from toolkit.mocap.procedural import perform
from toolkit.mocap.read import read_clip
from toolkit.mocap.retarget import retarget
from toolkit.mocap.rig import load_rig
from toolkit.output.export.bvh import export_bvh
from toolkit.output.export.run import export_run
from toolkit.tracks import EMPTY, Track
from toolkit.tracks.runs import load_persons, person_runs, save_people


def random_poses(count: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    low, high = np.clip(skeleton.POSE_LIMITS, -3.0, 3.0).T
    return rng.uniform(0.8 * low, 0.8 * high, (count, skeleton.POSE_SIZE))


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a run of two people, six frames at 25 a second; the second one enters after the first frame."""
    return write_people(tmp_path_factory.mktemp("runs") / "run", random_poses(6))


def placed_joints(poses: np.ndarray) -> np.ndarray:
    body = stick_body()
    return np.array([body.place(pose).origins for pose in poses])


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
    body = stick_body()
    poses = perform("boxing", body).poses
    export_bvh(tmp_path / "track.bvh", body, poses, 30.0)
    again = retarget(read_clip(tmp_path / "track.bvh"), body)
    error = np.linalg.norm(body.joint_positions(again.poses) - body.joint_positions(poses), axis=2)
    assert error.max() < 0.03
    assert error.mean() < 0.005


def test_a_csv_in_the_camera_frame_holds_the_track_and_blanks_who_is_not_there(runs: Path, tmp_path: Path) -> None:
    export_run(runs / "person_02", tmp_path / "joints.csv", origin="camera")
    with (tmp_path / "joints.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    track = Track.load(runs / "person_02")
    blank = {key for key, value in rows[0].items() if value == ""}
    assert blank == set(rows[0]) - {"time_s", "state"}, "nobody is there: no pose is invented"
    assert (rows[0]["state"], rows[1]["state"]) == ("empty", "tracked")
    assert float(rows[1]["time_s"]) == pytest.approx(track.timestamps[1], abs=1e-6)
    for i, name in enumerate(skeleton.REPORTED):
        found = [float(rows[4][f"{name}_{axis}_m"]) for axis in "xyz"]
        np.testing.assert_allclose(found, track.joints[4, i], atol=1e-6)
        assert float(rows[4][f"{name}_confidence"]) == pytest.approx(0.9, abs=1e-4)
        assert rows[4][f"{name}_observed"] == "1"
    assert rows[4]["left_foot_contact"] in ("0", "1")


@pytest.mark.parametrize("rig", ["mixamo", "cmu", "classic"])
def test_a_rig_is_known_again_by_its_names_and_moves_as_the_body_does(tmp_path: Path, rig: str) -> None:
    body, poses = stick_body(), random_poses(12)
    export_bvh(tmp_path / "track.bvh", body, poses, 30.0, rig=rig)
    clip = read_clip(tmp_path / "track.bvh")
    known = load_rig(clip)
    assert known.name.removesuffix("_bvh") == rig
    positions, placed = clip.world()[0], placed_joints(poses)
    ours = {*skeleton.JOINT_NAMES} - {"lumbar"}  # a rig with two joints below the chest may use either name
    for name in ours & set(known.joints):
        found = positions[:, clip.index(known.joints[name])]
        np.testing.assert_allclose(found, placed[:, skeleton.JOINT_NAMES.index(name)], atol=1e-5)


def test_an_unknown_rig_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RigError, match="cmu, mixamo"):
        export_bvh(tmp_path / "none.bvh", stick_body(), random_poses(2), 30.0, rig="puppet")


def test_a_trc_holds_the_markers_of_the_level_frame(runs: Path, tmp_path: Path) -> None:
    run = runs / "person_02"
    export_run(run, tmp_path / "track.trc", origin="camera")
    lines = [line.split("\t") for line in (tmp_path / "track.trc").read_text().splitlines()]
    assert lines[0] == ["PathFileType", "4", "(X/Y/Z)", "track.trc"]
    header = dict(zip(lines[1], lines[2], strict=True))
    assert (header["DataRate"], header["NumFrames"], header["NumMarkers"], header["Units"]) == ("25", "6", "20", "m")
    assert [name for name in lines[3][2:] if name] == list(skeleton.REPORTED)
    rows = lines[6:]
    assert [len(row) for row in rows] == [2 + 3 * 20] * 6
    person = load_persons(run)[0]
    assert set(rows[0][2:]) == {""}, "nobody is there in the first frame"
    assert float(rows[3][1]) == pytest.approx(3 / 25)
    found = np.array(rows[3][2:], dtype=float).reshape(20, 3)
    np.testing.assert_allclose(found, person.body.joint_positions(person.track.pose[3]), atol=1e-5)
    assert found[skeleton.REPORTED.index("head"), 1] > found[skeleton.REPORTED.index("pelvis"), 1] - 2


def test_a_c3d_contains_all_people_and_marks_absences(runs: Path, tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    assert export_run(runs, tmp_path / "track.c3d", origin="camera") == (tmp_path / "track.c3d",)
    file = ezc3d.c3d(str(tmp_path / "track.c3d"))
    labels = file["parameters"]["POINT"]["LABELS"]["value"]
    assert labels[:2] == ["person_01:pelvis", "person_01:spine"] and len(labels) == 40
    assert file["header"]["points"]["frame_rate"] == pytest.approx(25.0)
    points = file["data"]["points"][:3].transpose(2, 1, 0) / 1000
    for k, person in enumerate(load_persons(runs)):
        np.testing.assert_allclose(points[1:, 20 * k : 20 * k + 20], person.joints_level[1:], atol=1e-6)
    assert np.isnan(points[0, 20:]).all() and np.isfinite(points[0, :20]).all()


def test_a_json_contains_the_whole_track(runs: Path, tmp_path: Path) -> None:
    export_run(runs, tmp_path / "track.json")
    document = json.loads((tmp_path / "track.json").read_text())
    assert document["joint_names"] == list(skeleton.REPORTED)
    for found, person in zip(document["people"], load_persons(runs), strict=True):
        there = person.track.state != EMPTY
        assert found["name"] == person.name
        assert [row is None for row in found["joints"]] == [not here for here in there]
        for key in ("joints", "pose", "confidence"):
            kept = np.array([row for row in found[key] if row is not None])
            np.testing.assert_allclose(kept, getattr(person.track, key)[there], atol=1e-5)
    assert document["people"][1]["state"][0] == "empty"


def test_a_run_of_several_people_becomes_a_file_each_where_a_format_holds_one(runs: Path, tmp_path: Path) -> None:
    for suffix in (".bvh", ".trc", ".csv"):
        written = export_run(runs, tmp_path / f"track{suffix}")
        assert [path.name for path in written] == [f"track_person_01{suffix}", f"track_person_02{suffix}"]
        assert all(path.stat().st_size > 100 for path in written)


def test_an_exported_track_has_the_fitted_body_and_the_tracks_own_times(runs: Path, tmp_path: Path) -> None:
    run = runs / "person_01"
    assert export_run(run, tmp_path / "track.bvh", origin="camera") == (tmp_path / "track.bvh",)
    clip, track = read_clip(tmp_path / "track.bvh"), Track.load(run)
    assert clip.frame_rate == pytest.approx(25.0)
    for name in ("left_elbow", "right_knee", "left_wrist"):
        found = clip.world()[0][:, clip.index(name)] @ TURN
        np.testing.assert_allclose(found, track.joints[:, skeleton.REPORTED.index(name)], atol=1e-3)
    export_run(run, tmp_path / "track.csv")
    assert len((tmp_path / "track.csv").read_text().splitlines()) == 7


def test_an_unknown_suffix_and_a_rig_for_a_table_are_refused(runs: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"\.glb, \.bvh"):
        export_run(runs, tmp_path / "track.txt")
    with pytest.raises(UsageError, match="--rig mixamo is for .glb, .bvh"):
        export_run(runs, tmp_path / "track.csv", rig="mixamo")


def test_a_run_without_people_cannot_be_exported(tmp_path: Path) -> None:
    save_people(tmp_path, [])
    assert person_runs(tmp_path) == ()
    with pytest.raises(UsageError, match="no person was found"):
        load_persons(tmp_path)
