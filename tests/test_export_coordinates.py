"""Coordinates and markers of OpenSim's model, and JSON of tracks."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.run_helpers import write_run
from toolkit.body import skeleton
from toolkit.motion.angles import COLUMNS, joint_angles
from toolkit.motion.opensim_coordinates import coordinates
from toolkit.output.export.angles import marker_set
from toolkit.output.export.document import DECIMALS, export_json
from toolkit.output.export.origin import origin_of
from toolkit.tracks.runs import Person, load_persons


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
    export_json(tmp_path / "track.json", [person], origin_of([person], "camera"))
    document = json.loads((tmp_path / "track.json").read_text())
    (own,) = document["people"]
    assert own["state"] == ["empty", "empty", "tracked", "tracked", "tracked"]
    for name in ("joints", "pose", "confidence", "observed", "contact"):
        assert own[name][:2] == [None, None]
        np.testing.assert_allclose(own[name][2:], getattr(person.track, name)[2:], atol=0.6 * 10.0**-DECIMALS)
    assert own["source"] == ["local"] * 5 and own["timestamps"] == person.track.timestamps.tolist()
    assert document["joint_names"] == list(skeleton.REPORTED) and document["units"]["length"] == "m"
