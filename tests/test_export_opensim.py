"""Scaled models, markers and inverse kinematics by OpenSim itself."""

from pathlib import Path

import numpy as np
import pytest

from tests.run_helpers import write_run
from tests.support.walking import Walk, walking
from toolkit.body.shape import load_body
from toolkit.evaluation.marker_files import read_markers
from toolkit.io.errors import UsageError
from toolkit.motion.opensim_coordinates import coordinates
from toolkit.output.export.opensim import body_mass, solve, virtual_markers
from toolkit.output.export.run import export_run
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
    solved = solve(person, data_folder / "opensim" / model, tmp_path, mass=70.0)
    assert solved.rms < 0.015
    found, own = read_markers(solved.motion).angles, coordinates(person, np.arange(len(person.track)))
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
