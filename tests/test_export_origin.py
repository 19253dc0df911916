"""Exports on the ground, blanks for absent frames, and AMASS round trip."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.run_helpers import write_run
from tests.test_export import random_poses
from toolkit.body import skeleton
from toolkit.body.rotations.matrices import matrices
from toolkit.body.sole import soles
from toolkit.io.errors import UsageError
from toolkit.mocap.amass import JOINTS
from toolkit.mocap.read import read_clip
from toolkit.output.export.amass import OURS
from toolkit.output.export.origin import origin_of
from toolkit.output.export.run import export_run
from toolkit.tracks import RunInfo
from toolkit.tracks.runs import load_persons


def standing(tmp_path: Path, *, floor: float | None = None, absent: int = 0) -> Path:
    """Write a run of a person who stands 3 m from a camera 1.2 m above the floor, which may be known."""
    run = tmp_path / "run"
    poses = np.zeros((8, skeleton.POSE_SIZE))
    write_run(run, poses, absent=absent)
    info = RunInfo.load(run)
    poses[:, :3] = [0.4, -1.2 - float(soles(info.body(), poses[:1])[0, ..., 1].min()), -3.0]
    write_run(run, poses, absent=absent)
    replace(info, floor=[] if floor is None else [floor]).save(run)
    return run


@pytest.mark.parametrize(("floor", "how"), [(1.2, "seen by the camera"), (None, "where the feet rest")])
def test_a_standing_person_stands_at_the_origin_of_the_file(tmp_path: Path, floor: float | None, how: str) -> None:
    run = standing(tmp_path, floor=floor, absent=2)
    people = load_persons(run)
    assert origin_of(people, "floor").ground == how
    export_run(run, tmp_path / "a.csv")
    rows = list(csv.DictReader((tmp_path / "a.csv").open(newline="")))
    assert rows[0]["pelvis_x_m"] == "" and rows[1]["left_foot_observed"] == ""
    assert [float(rows[3][f"pelvis_{axis}_m"]) for axis in "xz"] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert float(rows[3]["left_ankle_y_m"]) == pytest.approx(0.08, abs=0.03)
    assert float(rows[3]["head_y_m"]) > 1.4
    clip_path = tmp_path / "a.bvh"
    export_run(run, clip_path)
    np.testing.assert_allclose(read_clip(clip_path).root_positions[:, [0, 2]], 0.0, atol=1e-5)
    assert read_clip(clip_path).root_positions[:, 1].min() > 0.7


def test_a_bvh_repeats_the_nearest_pose_in_absent_frames_and_notes_it(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", random_poses(6), absent=2)
    export_run(run, tmp_path / "a.bvh")
    found = read_clip(tmp_path / "a.bvh").rotations
    np.testing.assert_allclose(found[0], found[2], atol=1e-6)
    assert np.abs(found[3] - found[2]).max() > 0.1
    notes = json.loads((tmp_path / "a.bvh.notes.json").read_text())
    assert notes["people"] == [{"name": "run", "nobody_there": [[0, 1]], "lost": []}]
    assert "ground at y = 0" in notes["axes"]


def test_an_always_absent_person_is_blank_in_tables_and_rejected_by_other_formats(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", random_poses(3), absent=3)
    export_run(run, tmp_path / "a.csv")
    assert all(row["head_x_m"] == "" for row in csv.DictReader((tmp_path / "a.csv").open(newline="")))
    export_run(run, tmp_path / "a.json")
    export_run(run, tmp_path / "a.trc")
    for name in ("a.bvh", "a.npz"):
        with pytest.raises(UsageError, match="in no frame"):
            export_run(run, tmp_path / name)


def test_an_amass_motion_comes_back_exactly(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", random_poses(5))
    export_run(run, tmp_path / "a.npz", format="amass", origin="camera")
    clip, person = read_clip(tmp_path / "a.npz"), load_persons(run)[0]
    assert clip.frame_rate == pytest.approx(25.0)
    vectors = np.zeros((5, len(skeleton.JOINT_NAMES), 3))
    vectors[:, skeleton.DOF_JOINT, skeleton.DOF_AXIS] = person.track.pose[:, 3:]
    names = [OURS.get(name, name.replace("collar", "clavicle")) for name, _ in JOINTS]
    for j, name in enumerate(names):
        if name in skeleton.JOINT_NAMES:
            expected = matrices(vectors[:, skeleton.JOINT_NAMES.index(name)])
            np.testing.assert_allclose(clip.rotations[:, j], expected, atol=1e-12)
        else:
            np.testing.assert_allclose(clip.rotations[:, j], np.broadcast_to(np.eye(3), (5, 3, 3)), atol=1e-15)
    hips = clip.world()[0][:, [clip.index("left_hip"), clip.index("right_hip")]].mean(axis=1)
    np.testing.assert_allclose(hips, person.track.pose[:, :3], atol=1e-12)


def test_an_origin_that_a_format_does_not_have_is_refused(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", random_poses(3))
    with pytest.raises(UsageError, match="--origin floor is not for k4abt"):
        export_run(run, tmp_path / "a.json", format="k4abt", origin="floor")
    with pytest.raises(UsageError, match="neither floor nor camera"):
        export_run(run, tmp_path / "a.csv", origin="moon")
    with pytest.raises(UsageError, match="--format k4abt is written to"):
        export_run(run, tmp_path / "a.csv", format="k4abt")
    with pytest.raises(UsageError, match="--format obj is unknown"):
        export_run(run, tmp_path / "a.csv", format="obj")
