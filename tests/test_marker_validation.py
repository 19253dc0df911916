"""Validation against marker files with exact truth."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.run_helpers import run as run_command
from tests.run_helpers import write_run
from toolkit.body.skeleton import REPORTED
from toolkit.evaluation.marker_files import read_markers, untangled
from toolkit.evaluation.marker_sets import hip_centres, joint_centres, marker_set_names
from toolkit.evaluation.marker_validation import Validation, validate
from toolkit.io.errors import RecordingError, UsageError
from toolkit.mocap.procedural import procedural_clips
from toolkit.tracks.runs import Person, load_persons

RATE, CLOCK = 25.0, 3.71
AXES = np.array([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0], [0.0, 0.8, -0.6]])
"""Rotation from the level frame to the laboratory's axes."""
ORIGIN = np.array([0.4, -2.0, 1.1])
PAIRS = {"elbow": ("ELB", "MEL"), "knee": ("KNE", "KNM"), "ankle": ("ANK", "ANM")}
SINGLE = {"SHO": "shoulder", "FIN": "hand", "TOE": "foot"}


@pytest.fixture(scope="module")
def person(tmp_path_factory: pytest.TempPathFactory) -> Person:
    poses = np.concatenate([clip.poses for clip in procedural_clips(["archery", "kick_front"], rate=RATE, seed=3)][:2])
    return load_persons(write_run(tmp_path_factory.mktemp("markers") / "run", poses[:200], rate=RATE))[0]


def markers_of(joints: np.ndarray) -> dict[str, np.ndarray]:
    """Return Plug-in Gait markers (T, 3) whose joint centres are `joints` (T, 20, 3), level frame."""
    row = {name: joints[:, i] for i, name in enumerate(REPORTED)}
    aside = np.array([0.05, 0.0, 0.01])
    found = {}
    for side, s in (("left", "L"), ("right", "R")):
        for joint, (lateral, medial) in PAIRS.items():
            centre = row[f"{side}_{joint}"]
            found[s + lateral], found[s + medial] = centre + aside, centre - aside
        found |= {s + marker: row[f"{side}_{joint}"] for marker, joint in SINGLE.items()}
        found[f"{s}WRA"], found[f"{s}WRB"] = row[f"{side}_wrist"] + aside, row[f"{side}_wrist"] - aside
        found[f"{s}FHD"], found[f"{s}BHD"] = row["head"] + aside, row["head"] - aside
    across = row["right_hip"] - row["left_hip"]
    half = np.linalg.norm(across, axis=1, keepdims=True) / 2
    right = across / (2 * half)
    up = row["spine"] - (row["left_hip"] + row["right_hip"]) / 2
    up -= (up * right).sum(axis=1, keepdims=True) * right
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    forwards = np.cross(up, right)
    width, depth = float((half[0, 0] - 0.0073) / 0.33), 0.15
    front = (row["left_hip"] + row["right_hip"]) / 2 + (0.24 * depth + 0.0099) * forwards + (0.30 * width + 0.0109) * up
    for s, sign in (("L", -1), ("R", 1)):
        found[f"{s}ASI"] = front + sign * width / 2 * right
        found[f"{s}PSI"] = front - depth * forwards + sign * 0.04 * right
    return found


def write_trc(
    path: Path, markers: dict[str, np.ndarray], times: np.ndarray, unit: str = "mm", prefix: str = ""
) -> Path:
    scale = {"mm": 1000.0, "m": 1.0}[unit]
    names = list(markers)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"100\t100\t{len(times)}\t{len(names)}\t{unit}\t100\t1\t{len(times)}",
        "Frame#\tTime\t" + "\t\t\t".join(names),
        "\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(len(names)) for axis in "XYZ"),
    ]
    points = np.stack(list(markers.values()), axis=1) * scale
    for t, time in enumerate(times):
        cells = ["" if np.isnan(value) else f"{value:.4f}" for value in points[t].ravel()]
        lines.append("\t".join([str(t + 1), f"{time:.4f}", *cells]))
    path.write_text("\n".join(lines) + "\n")
    return path


def in_laboratory(person: Person, *, noise: float = 0.0, seed: int = 0) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return markers at 100 Hz in the laboratory's axes and on its clock."""
    times = np.arange(person.times[0], person.times[-1], 0.01)
    joints = person.joints_level
    flat = joints.reshape(len(joints), -1)
    at = np.stack([np.interp(times, person.times, column) for column in flat.T], axis=1).reshape(-1, 20, 3)
    rng = np.random.default_rng(seed)
    found = {
        name: points @ AXES.T + ORIGIN + noise * rng.standard_normal(points.shape)
        for name, points in markers_of(at).items()
    }
    return found, times - CLOCK


def mean_of(found: Validation, joint: str) -> float:
    return next(row.mean for row in found.joints if row.joint == joint)


def test_another_clock_axes_rate_and_unit_are_recovered(person: Person, tmp_path: Path) -> None:
    markers, times = in_laboratory(person, noise=0.001)
    found = validate([person], write_trc(tmp_path / "lab.trc", markers, times))
    assert found.marker_set == "plug_in_gait" and not found.notes or "skin" in found.notes[-1]
    assert found.lag == pytest.approx(CLOCK, abs=0.006) and found.correlation > 0.95
    assert found.alignment is not None
    np.testing.assert_allclose(found.alignment.rotation, AXES.T, atol=0.01)
    assert found.mean_mm < 6.0 and mean_of(found, "left_hip") < 6.0
    assert all(row.rms < 2.0 and row.correlation > 0.99 for row in found.angles if row.range_reference > 10)


def test_an_injected_bias_is_the_bias_that_is_reported(person: Person, tmp_path: Path) -> None:
    markers, times = in_laboratory(person)
    shift = np.array([0.01, 0.03, -0.02])
    joints = person.track.joints.copy()
    joints[:, REPORTED.index("right_knee")] += (shift @ person.R_level_camera).astype(np.float32)
    moved = replace(person, track=replace(person.track, joints=joints))
    found = validate([moved], write_trc(tmp_path / "lab.trc", markers, times), lag=CLOCK)
    knee = next(row for row in found.joints if row.joint == "right_knee")
    np.testing.assert_allclose(knee.bias, 1000 * shift, atol=4.0)
    assert mean_of(found, "left_knee") < 5.0 < knee.mean


def test_gaps_and_exchanged_labels_cost_no_accuracy(person: Person, tmp_path: Path) -> None:
    markers, times = in_laboratory(person)
    markers["LKNE"][100:180] = np.nan
    for name, other in (("RANK", "RELB"), ("LWRA", "RWRA")):
        markers[name][300:], markers[other][300:] = markers[other][300:].copy(), markers[name][300:].copy()
    found = validate([person], write_trc(tmp_path / "lab.trc", markers, times))
    assert found.mean_mm < 6.0
    assert any("exchanged" in note for note in found.notes)


def test_a_file_in_metres_of_several_subjects_gives_the_one_who_fits(person: Person, tmp_path: Path) -> None:
    markers, times = in_laboratory(person)
    rng = np.random.default_rng(1)
    other = {f"Bob:{name}": points + rng.normal(0, 0.3, points.shape) for name, points in markers.items()}
    both = {f"Ann:{name}": points for name, points in markers.items()} | other
    found = validate([person], write_trc(tmp_path / "lab.trc", both, times, unit="m"))
    assert found.subject == "Ann" and found.mean_mm < 6.0
    assert any("2 subjects" in note for note in found.notes)


def test_mirrored_markers_are_named(person: Person, tmp_path: Path) -> None:
    markers, times = in_laboratory(person)
    mirrored = {name: points * [-1, 1, 1] for name, points in markers.items()}
    found = validate([person], write_trc(tmp_path / "lab.trc", mirrored, times))
    assert any("mirrored" in note for note in found.notes)


def test_another_time_another_movement_and_a_still_person_are_refused(person: Person, tmp_path: Path) -> None:
    markers, times = in_laboratory(person)
    still = {name: np.repeat(points[:1], len(times), axis=0) for name, points in markers.items()}
    with pytest.raises(RecordingError, match="same movement"):
        validate([person], write_trc(tmp_path / "still.trc", still, times))
    with pytest.raises(RecordingError, match="no joint in common at any time"):
        validate([person], write_trc(tmp_path / "lab.trc", markers, times), lag=500.0)


def test_an_unknown_set_lists_the_nearest_names(person: Person, tmp_path: Path) -> None:
    markers, times = in_laboratory(person)
    renamed = {f"my{name}": points for name, points in markers.items()}
    with pytest.raises(RecordingError, match=r"myLELB \(LELB"):
        validate([person], write_trc(tmp_path / "lab.trc", renamed, times))
    with pytest.raises(UsageError, match="plug_in_gait"):
        validate([person], write_trc(tmp_path / "lab2.trc", markers, times), marker_set="vicon")


def test_a_set_of_the_user_s_own_is_read(person: Person, tmp_path: Path) -> None:
    markers, times = in_laboratory(person)
    renamed = {f"my{name}": points for name, points in markers.items()}
    own = tmp_path / "own.yaml"
    joints = {"left_elbow": ["myLELB", "myLMEL"], "right_elbow": ["myRELB", "myRMEL"], "head": ["myLFHD", "myLBHD"]}
    joints |= {"left_knee": ["myLKNE", "myLKNM"], "right_knee": ["myRKNE", "myRKNM"]}
    own.write_text("joints:\n" + "".join(f"  {name}: [[{', '.join(each)}]]\n" for name, each in joints.items()))
    found = validate([person], write_trc(tmp_path / "lab.trc", renamed, times), marker_set=own)
    assert {row.joint for row in found.joints} == set(joints) and found.mean_mm < 6.0


def test_c3d_and_csv_hold_the_same_as_trc(person: Person, tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    markers, times = in_laboratory(person)
    trc = read_markers(write_trc(tmp_path / "lab.trc", markers, times))
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(markers)
    points = 1000.0 * np.stack(list(markers.values()), axis=1)
    file["data"]["points"] = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2).transpose(2, 1, 0)
    file.write(str(tmp_path / "lab.c3d"))
    head = ["time", *(f"{name}_{axis}" for name in markers for axis in "xyz")]
    rows = [",".join(map(str, [time, *row.ravel()])) for time, row in zip(times, points, strict=True)]
    (tmp_path / "lab.csv").write_text("\n".join([",".join(head), *rows]))
    for suffix in ("c3d", "csv"):
        other = read_markers(tmp_path / f"lab.{suffix}")
        assert other.labels == trc.labels
        np.testing.assert_allclose(other.points, trc.points, atol=1e-5)
    assert "millimetres" in read_markers(tmp_path / "lab.csv").notes[0]


def test_own_exports_agree_with_their_run(person: Person, tmp_path: Path) -> None:
    from toolkit.output.export.bvh import export_bvh
    from toolkit.output.export.tables import export_mot

    export_mot(tmp_path / "run.mot", person)
    found = validate([person], tmp_path / "run.mot")
    assert found.lag == pytest.approx(0.0, abs=0.02)
    assert max(row.rms for row in found.angles) < 1.0 and {"knee_angle_r", "hip_flexion_l"} <= found.curves.keys()
    export_bvh(tmp_path / "run.bvh", person.body, person.track.pose, RATE)
    found = validate([person], tmp_path / "run.bvh")
    assert found.mean_mm < 15.0


def test_hip_centres_are_those_of_the_regression() -> None:
    left, right = (np.array([[s * 0.12, 1.0, 0.0]]) for s in (1, -1))  # facing +z, left at +x
    back_left, back_right = (np.array([[s * 0.05, 1.0, -0.15]]) for s in (1, -1))
    hip_left, hip_right = hip_centres(left, right, back_left, back_right)
    np.testing.assert_allclose(hip_left, [[0.33 * 0.24 + 0.0073, 1 - 0.30 * 0.24 - 0.0109, -0.24 * 0.15 - 0.0099]])
    np.testing.assert_allclose(hip_right, hip_left * [-1, 1, 1])


def test_markers_that_do_not_jump_keep_their_labels() -> None:
    rng = np.random.default_rng(0)
    points = np.cumsum(rng.normal(0, 0.01, (50, 6, 3)), axis=0) + rng.normal(0, 1, (1, 6, 3))
    same, count = untangled(points)
    assert count == 0
    np.testing.assert_array_equal(same, points)


@pytest.mark.parametrize(
    "text", ["", "PathFileType\n", "PathFileType\t4\nDataRate\tUnits\n100\tfurlong\n\n\n\n", "\x00" * 40, "a\tb\n" * 9]
)
def test_damaged_files_are_refused_in_a_sentence(text: str, tmp_path: Path) -> None:
    for suffix in ("trc", "csv", "mot", "c3d", "bvh"):
        (tmp_path / f"bad.{suffix}").write_text(text)
        with pytest.raises(Exception) as caught:
            read_markers(tmp_path / f"bad.{suffix}")
        assert type(caught.value).__module__ == "toolkit.io.errors", repr(caught.value)


def test_the_command_writes_page_table_and_figures(
    person: Person, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    run = write_run(tmp_path / "run", person.track.pose, rate=RATE)
    markers, times = in_laboratory(person)
    lab = write_trc(tmp_path / "lab.trc", markers, times)
    assert run_command("evaluate", run, "--reference", lab, "--output", tmp_path / "page") == 0
    html = (tmp_path / "page" / "validation.html").read_text()
    assert "limits of agreement" in html and "left_knee" in html and html.count("<img") == 2
    figures = json.loads((tmp_path / "page" / "validation.json").read_text())
    assert figures["marker_set"] == "plug_in_gait" and figures["mean_mm"] < 6.0
    assert "left_knee" in (tmp_path / "page" / "validation.csv").read_text()


@pytest.mark.data("opensim")
@pytest.mark.parametrize(
    ("file", "joints"),
    [
        ("gait2392/subject01_static.trc", 15),
        ("rajagopal/static_run.trc", 15),
        ("rajagopal/motion_capture_walk.trc", 12),
    ],
)
def test_real_marker_files_fit_a_shipped_set(file: str, joints: int, data_folder: Path) -> None:
    recording = read_markers(data_folder / "opensim" / file)
    centres = joint_centres(recording)
    known = np.isfinite(centres.points).all(axis=2).any(axis=0)
    assert known.sum() >= joints and centres.set_name in marker_set_names()
    thigh = np.linalg.norm(
        centres.points[:, REPORTED.index("left_hip")] - centres.points[:, REPORTED.index("left_knee")], axis=1
    )
    assert 0.33 < np.nanmedian(thigh) < 0.50
