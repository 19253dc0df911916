"""OpenSim's coordinates, markers, scaled models and inverse kinematics; JSON of tracks."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.run_helpers import write_run
from tests.support.walking import Walk, walking
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.evaluation.marker_files import read_markers
from toolkit.io.errors import UsageError
from toolkit.motion.angles import COLUMNS, coordinates, joint_angles
from toolkit.output.export.document import DECIMALS, export_json
from toolkit.output.export.opensim import body_mass, solve, virtual_markers
from toolkit.output.export.run import export_run
from toolkit.output.export.tables import marker_set
from toolkit.tracks.runs import Person, load_persons

MODELS = {"rajagopal/RajagopalLaiUhlrich2023.osim": True, "gait2392/gait2392_thelen2003muscle.osim": False}
"""Models, and True for those with arms."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    poses, _ = walking(load_body("neutral"), Walk(), 1.0, 30.0)
    return write_run(tmp_path_factory.mktemp("opensim") / "run", poses, shape=0.0, rate=30.0)


@pytest.fixture(scope="module")
def person(run: Path) -> Person:
    return load_persons(run)[0]


def test_a_person_of_average_build_has_an_average_mass(person: Person) -> None:
    assert 50 < body_mass(person) < 95


def test_markers_are_rigid_on_their_segments(person: Person) -> None:
    markers = virtual_markers(
        person,
        {"humerus_r", "humerus_l", "ulna_r", "ulna_l"}
        | {f"{b}_{s}" for b in ("femur", "tibia", "calcn") for s in "rl"},
    )
    for name, points in markers.items():
        if name.endswith("__x"):
            apart = np.linalg.norm(points - markers[name.replace("__x", "__z")], axis=1)
            np.testing.assert_allclose(apart, apart[0], rtol=1e-3)


def test_without_a_model_the_files_and_the_commands_are_given(
    run: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    export_run(run, tmp_path / "osim", format="opensim")
    assert {path.name for path in (tmp_path / "osim").iterdir()} == {"markers.trc", "motion.mot", "motion_markers.xml"}
    assert "pip install 'depthmocap[opensim]'" in caplog.text
    with pytest.raises(UsageError, match="--format opensim"):
        export_run(run, tmp_path / "walk.bvh", model="a.osim")


@pytest.mark.data("opensim")
@pytest.mark.parametrize("model", MODELS)
def test_opensim_recovers_markers_and_angles(model: str, person: Person, data_folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("opensim")
    rms = solve(person, data_folder / "opensim" / model, tmp_path)
    assert rms < 0.015
    found, own = read_markers(tmp_path / "motion.mot").angles, coordinates(person, np.arange(len(person.track)))
    for side in "rl":
        for angle, within in (("knee_angle", 2.0), ("hip_flexion", 2.0), ("hip_adduction", 2.0)):
            sign = -1.0 if angle == "knee_angle" and "gait2392" in model else 1.0
            difference = sign * found[f"{angle}_{side}"] - own[f"{angle}_{side}"]
            assert np.sqrt(np.mean(difference**2)) < within, (angle, side)


@pytest.mark.data("opensim")
def test_what_is_no_model_is_refused(person: Person, tmp_path: Path, data_folder: Path) -> None:
    pytest.importorskip("opensim")
    (tmp_path / "bad.osim").write_text("<none/>")
    with pytest.raises(UsageError, match=r"bad\.osim"):
        solve(person, tmp_path / "bad.osim", tmp_path)


def poses_of(count: int, seed: int = 0) -> np.ndarray:
    """Return poses (count, P) within half of the limits, about 2.5 m from the camera."""
    rng = np.random.default_rng(seed)
    low, high = 0.5 * skeleton.POSE_LIMITS.T
    poses = rng.uniform(np.where(np.isfinite(low), low, 0.0), np.where(np.isfinite(high), high, 0.0), (count, len(low)))
    poses[:, :3] = [0.1, -0.2, -2.5] + rng.normal(scale=0.1, size=(count, 3))
    poses[:, 3:6] = rng.uniform(-0.4, 0.4, (count, 3))
    return poses


def person_of(run: Path) -> Person:
    return load_persons(run)[0]


@pytest.mark.parametrize(
    ("name", "angle", "sign"),
    [
        ("knee_angle_r", "right_knee_flexion_ZXY_deg", 1),
        ("hip_flexion_l", "left_hip_flexion_ZXY_deg", 1),
        ("hip_adduction_r", "right_hip_adduction_ZXY_deg", 1),
        ("elbow_flex_l", "left_elbow_flexion_ZXY_deg", 1),
        ("ankle_angle_l", "left_ankle_dorsiflexion_ZXY_deg", 1),
        ("pelvis_tilt", "pelvis_backward_tilt_ZXY_deg", 1),
        ("lumbar_extension", "trunk_flexion_ZXY_deg", -1),
        ("lumbar_bending", "trunk_lateral_bending_right_ZXY_deg", 1),
    ],
)
def test_coordinates_with_an_isb_angle_of_their_own_are_that_angle(
    name: str, angle: str, sign: int, tmp_path: Path
) -> None:
    person = person_of(write_run(tmp_path / "run", poses_of(12), shape=0.0))
    found = joint_angles(person.body, person.track.pose, person.there).degrees[:, COLUMNS.index(angle)]
    np.testing.assert_allclose(coordinates(person, np.arange(12))[name], sign * found, atol=1e-6)
    assert found.std() > 1.0


def test_every_reported_joint_is_a_marker_and_left_ones_lie_to_the_left() -> None:
    lines = marker_set().splitlines()
    places = {
        line.split('"')[1]: [float(v) for v in lines[k + 2].split(">")[1].split("<")[0].split()]
        for k, line in enumerate(lines)
        if "<Marker name" in line
    }
    assert list(places) == list(skeleton.REPORTED)
    for name, (x, y, z) in places.items():
        if name.startswith("left_"):
            assert places[name.replace("left", "right")] == [x, y, -z]
    assert places["left_hip"][2] < 0 and places["left_shoulder"][2] < 0, "the model's z leads to the right"


def test_json_equals_the_track_with_null_for_absent_frames(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", poses_of(5), absent=2)
    person = person_of(run)
    export_json(tmp_path / "track.json", [person])
    document = json.loads((tmp_path / "track.json").read_text())
    (own,) = document["people"]
    assert own["state"] == ["empty", "empty", "tracked", "tracked", "tracked"]
    for name in ("joints", "pose", "confidence", "observed", "contact"):
        assert own[name][:2] == [None, None]
        np.testing.assert_allclose(own[name][2:], getattr(person.track, name)[2:], atol=0.6 * 10.0**-DECIMALS)
    assert own["source"] == ["local"] * 5 and own["timestamps"] == person.track.timestamps.tolist()
    assert document["joint_names"] == list(skeleton.REPORTED) and document["units"]["length"] == "m"
