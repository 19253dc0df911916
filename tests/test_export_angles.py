"""Angles, OpenSim motions and gait as files, and their page."""

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.run_helpers import write_run
from tests.support.walking import Walk, walking
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.motion.angles import COLUMNS
from toolkit.motion.motion_summary import as_plain, summary_of
from toolkit.motion.resting import at_rest
from toolkit.output.export.run import export_run
from toolkit.output.report.gait import gait_section
from toolkit.tracks.runs import load_persons


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a run of a person who walks for 3 s, absent in the first two frames."""
    poses, _ = walking(load_body("neutral"), Walk(), 3.0, 30.0)
    return write_run(tmp_path_factory.mktemp("walk") / "run", poses, shape=0.0, absent=2, rate=30.0)


def test_the_csv_of_angles_names_the_sequence_and_blanks_absence(run: Path, tmp_path: Path) -> None:
    export_run(run, tmp_path / "angles.csv", format="angles", as_tracked=True)
    with (tmp_path / "angles.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert "left_hip_flexion_ZXY_deg" in rows[0] and "right_shoulder_elevation_YXY_deg" in rows[0]
    assert {rows[0][column] for column in COLUMNS} == {""} and rows[0]["state"] == "empty"
    pose = load_persons(run)[0].track.pose[20]
    expected = np.degrees(pose[skeleton.POSE_NAMES.index("left_knee_rx")])
    assert float(rows[20]["left_knee_flexion_ZXY_deg"]) == pytest.approx(expected, abs=1e-3)
    assert rows[20]["left_shoulder_locked"] in ("0", "1")


def read_mot(path: Path) -> dict[str, np.ndarray]:
    lines = path.read_text().splitlines()
    start = lines.index("endheader")
    table = np.array([[float(value) for value in line.split("\t")] for line in lines[start + 2 :]])
    assert f"nRows={len(table)}" in lines and f"nColumns={table.shape[1]}" in lines and "inDegrees=yes" in lines
    return dict(zip(lines[start + 1].split("\t"), table.T, strict=True))


def test_a_mot_has_the_coordinates_of_the_generic_model(run: Path, tmp_path: Path) -> None:
    export_run(run, tmp_path / "walk.mot", as_tracked=True)
    found, person = read_mot(tmp_path / "walk.mot"), load_persons(run)[0]
    assert len(found["time"]) == 88 and (np.diff(found["time"]) > 0).all()
    assert found["pelvis_tx"][-1] - found["pelvis_tx"][0] == pytest.approx(1.1 * 87 / 30, abs=0.01)
    assert 0.85 < found["pelvis_ty"].mean() < 1.1 and abs(found["pelvis_tz"]).max() < 0.2
    knee = np.degrees(person.track.pose[2:, skeleton.POSE_NAMES.index("right_knee_rx")])
    np.testing.assert_allclose(found["knee_angle_r"], knee, atol=1e-4)
    assert found["hip_flexion_l"].max() > 15 and found["hip_flexion_l"].min() < 0
    assert found["arm_add_r"].mean() == pytest.approx(found["arm_add_l"].mean(), abs=2.0)


def test_the_gait_of_a_run_is_a_file_of_figures(run: Path, tmp_path: Path) -> None:
    export_run(run, tmp_path / "gait.json", format="gait")
    (person,) = json.loads((tmp_path / "gait.json").read_text())["people"]
    assert person["gait"]["stride_length_m"] == pytest.approx(Walk().stride_length, abs=0.03)
    assert len(person["strides"]) == person["gait"]["strides"] and person["rises"] == []


@pytest.fixture(scope="module")
def sliding(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a run of a walking person with sliding, trembling stance feet."""
    poses, contact = walking(load_body("neutral"), Walk(), 3.0, 30.0)
    poses[:, 3:] += np.random.default_rng(0).normal(scale=0.015, size=poses[:, 3:].shape)
    return write_run(tmp_path_factory.mktemp("sliding") / "run", poses, shape=0.0, rate=30.0, contact=contact)


def test_the_gait_of_a_file_and_of_a_page_is_that_of_the_track_with_what_rests_held_once(
    sliding: Path, tmp_path: Path
) -> None:
    (person,) = load_persons(sliding)
    held, found = as_plain(summary_of(at_rest(person))), as_plain(summary_of(person))
    for flag, expected in ((False, held), (True, found)):
        export_run(sliding, tmp_path / "gait.json", format="gait", as_tracked=flag)
        (own,) = json.loads((tmp_path / "gait.json").read_text())["people"]
        assert own == {"name": person.name} | expected
    assert held["gait"] != found["gait"] and held["strides"] != found["strides"]
    shown = set(re.findall(r"<td>(-?\d+ to -?\d+)</td>", gait_section("walk", [person])))
    assert shown <= ranges(held) and not shown <= ranges(found)
    assert "<td>-0</td>" not in gait_section("walk", [person])


def ranges(figures: dict[str, Any]) -> set[str]:
    """Return all ranges of motion as written on a page."""
    sides = [row[side] for row in figures["ranges_deg"] for side in ("left", "right")]
    return {f"{low:.0f} to {high:.0f}" for low, high in sides}


def test_a_page_shows_gait_and_says_where_there_is_none(run: Path, tmp_path: Path) -> None:
    text = gait_section("walk <b>", load_persons(run))
    assert "stride length" in text and "1.22 m" in text and "<polyline" in text and "<b>" not in text
    still = write_run(tmp_path / "still", np.zeros((1, skeleton.POSE_SIZE)))
    assert "too short for a stride" in gait_section("still", load_persons(still))
    nobody = write_run(tmp_path / "nobody", np.zeros((4, skeleton.POSE_SIZE)), absent=4)
    assert "the person does not walk" in gait_section("nobody", load_persons(nobody))
