"""The Azure Kinect SDK's JSON: its joint frames against a second source, and its round trip."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.run_helpers import TURN, write_people, write_run
from tests.test_export import random_poses
from toolkit.body import k4abt, skeleton
from toolkit.body.shape import load_body
from toolkit.evaluation.k4abt import read_k4abt
from toolkit.io.errors import RecordingError
from toolkit.output.export.document import export_k4abt
from toolkit.output.export.run import export_run
from toolkit.sensing.camera import rotated_points
from toolkit.tracks import Track
from toolkit.tracks.runs import load_persons


def turn(axes: str, *degrees: float) -> np.ndarray:
    return Rotation.from_euler(axes, degrees, degrees=True).as_matrix()


K4ADOTNET = {
    "PELVIS": turn("Z", 90) @ turn("Y", -90),
    "HEAD": turn("Z", 90) @ turn("Y", -90),
    "KNEE_LEFT": turn("Z", 90) @ turn("Y", -90),
    "FOOT_LEFT": turn("Y", -90),
    "HIP_RIGHT": turn("Z", -90) @ turn("Y", -90),
    "FOOT_RIGHT": turn("Z", 180) @ turn("Y", -90),
    "ELBOW_LEFT": turn("X", 90),
    "WRIST_LEFT": turn("X", 180),
    "CLAVICLE_RIGHT": turn("X", -90),
    "WRIST_RIGHT": np.eye(3),
}
"""The inverse orientations in a T-pose that K4AdotNet's sample for Unity applies; its numbers are those of the depth
camera's frame, before which the person stands and faces it."""


@pytest.mark.parametrize("joint", K4ADOTNET)
def test_the_frames_at_rest_are_those_that_another_program_undoes(joint: str) -> None:
    frame_camera = TURN @ k4abt.REST_FRAMES[k4abt.NAMES.index(joint)]
    np.testing.assert_allclose(frame_camera, K4ADOTNET[joint].T, atol=1e-12)


def test_every_frame_is_right_handed_and_the_sides_are_mirrored_with_all_axes_reversed() -> None:
    np.testing.assert_allclose(np.linalg.det(k4abt.REST_FRAMES), 1.0)
    for i, name in enumerate(k4abt.NAMES):
        if name.endswith("_LEFT") and not name.startswith(("EYE", "EAR")):
            other = k4abt.REST_FRAMES[k4abt.NAMES.index(name.replace("LEFT", "RIGHT"))]
            np.testing.assert_allclose(other, -np.diag([-1, 1, 1]) @ k4abt.REST_FRAMES[i])


def test_the_joints_lie_on_the_body_as_their_names_say() -> None:
    body = load_body("neutral")
    at = dict(zip(k4abt.NAMES, k4abt.rest_points(body), strict=True))
    assert at["PELVIS"][1] < at["SPINE_NAVEL"][1] < at["SPINE_CHEST"][1] < at["NECK"][1] < at["HEAD"][1]
    assert at["NOSE"][2] > at["EYE_LEFT"][2] > at["EAR_LEFT"][2] and at["EYE_LEFT"][1] > at["NOSE"][1]
    assert at["EAR_LEFT"][0] > at["EYE_LEFT"][0] > 0 > at["EYE_RIGHT"][0] > at["EAR_RIGHT"][0]
    assert at["HANDTIP_LEFT"][0] > at["HAND_LEFT"][0] > at["WRIST_LEFT"][0]
    assert at["THUMB_LEFT"][2] > at["WRIST_LEFT"][2]
    assert at["FOOT_RIGHT"][2] > at["ANKLE_RIGHT"][2] and at["FOOT_RIGHT"][0] < 0
    placed = k4abt.place(body, np.zeros((1, skeleton.POSE_SIZE)))
    np.testing.assert_allclose(placed.positions[0], list(at.values()), atol=1e-12)


def test_the_joints_that_both_have_come_back_within_a_hundredth_of_a_millimetre(tmp_path: Path) -> None:
    run = write_people(tmp_path / "run", random_poses(6))
    export_run(run, tmp_path / "bodies.json", format="k4abt")
    found = read_k4abt(tmp_path / "bodies.json")
    for joints, person in zip(found.joints, load_persons(run), strict=True):
        np.testing.assert_allclose(joints[person.there], person.track.joints[person.there], atol=1e-5)
        assert np.isnan(joints[~person.there]).all()
    np.testing.assert_allclose(found.timestamps, load_persons(run)[0].track.timestamps, atol=1e-6)


def test_the_file_has_the_keys_of_the_offline_processor(tmp_path: Path) -> None:
    run = write_people(tmp_path / "run", random_poses(3))
    export_run(run, tmp_path / "bodies.json", format="k4abt")
    document = json.loads((tmp_path / "bodies.json").read_text())
    assert {"k4abt_sdk_version", "source_file", "joint_names", "bone_list", "frames"} == set(document)
    assert len(document["bone_list"]) == 31 and document["bone_list"][0] == ["SPINE_CHEST", "SPINE_NAVEL"]
    assert [frame["num_bodies"] for frame in document["frames"]] == [1, 2, 2]
    assert [frame["frame_id"] for frame in document["frames"]] == [0, 1, 2]
    assert isinstance(document["frames"][0]["timestamp_usec"], int)
    body = document["frames"][1]["bodies"][1]
    assert body["body_id"] == 2 and np.shape(body["joint_positions"]) == (32, 3)
    assert np.shape(body["joint_orientations"]) == (32, 4)


def test_the_orientation_of_a_bent_knee_turns_about_its_own_z_axis(tmp_path: Path) -> None:
    pose = np.zeros((2, skeleton.POSE_SIZE))
    pose[1, skeleton.POSE_NAMES.index("left_knee_rx")] = 0.5
    placed = k4abt.place(load_body("neutral"), pose)
    knee, hip = k4abt.NAMES.index("KNEE_LEFT"), k4abt.NAMES.index("HIP_LEFT")
    relative = Rotation.from_matrix(placed.frames[1, hip].T @ placed.frames[1, knee]).as_rotvec()
    np.testing.assert_allclose(relative, [0.0, 0.0, 0.5], atol=1e-9)  # z points to the left, as our x


def kinect_file(path: Path, frames: list[list[dict[str, Any]]], **changes: Any) -> Path:
    rows = [
        {"timestamp_usec": 33333 * i, "frame_id": i, "bodies": b, "num_bodies": len(b)} for i, b in enumerate(frames)
    ]
    path.write_text(json.dumps({"joint_names": k4abt.NAMES, "frames": rows, **changes}))
    return path


def body_at(x: float, **more: Any) -> dict[str, Any]:
    points = 1000 * (k4abt.rest_points(load_body("neutral")) @ TURN + [x, 0.0, 3.0])
    return {"joint_positions": points.tolist(), **more}


def test_a_skeleton_of_other_frames_finds_the_recordings_by_their_times(tmp_path: Path) -> None:
    found = read_k4abt(kinect_file(tmp_path / "a.json", [[body_at(0.1 * i, body_id=1)] for i in range(5)]))
    times = 100.0 + np.arange(4) / 30.0
    np.testing.assert_allclose(found.at(times)[0, :, 0, 0], [0.0, 0.1, 0.2, 0.3], atol=1e-6)
    with pytest.raises(RecordingError, match="times do not fit"):
        found.at(np.arange(9) * 7.0)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[]", "has no frames"), ("{", "a.json"), ('{"frames": []}', "has no frames"),
        ('{"frames": [{"bodies": []}]}', "frame 0"),
        ('{"frames": [{"timestamp_usec": 1, "bodies": [{"joint_positions": [[1, 2, 3]]}]}]}', "frame 0"),
        ('{"frames": [{"timestamp_usec": 1}], "joint_names": ["NOSE"]}', "no joint PELVIS"),
        ('{"frames": [{"timestamp_usec": 1}], "joint_names": 5}', "joint_names"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_skeleton_is_an_error_of_one_sentence(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(RecordingError, match=reason):
        read_k4abt(tmp_path / "a.json")


def test_of_a_camera_on_its_side_the_file_has_the_frame_of_the_camera_as_it_stood(tmp_path: Path) -> None:
    person = load_persons(write_run(tmp_path / "run", random_poses(2)))[0]
    export_k4abt(tmp_path / "turned.json", [replace(person, turns=1)])
    again = rotated_points(read_k4abt(tmp_path / "turned.json").joints[0], 1)
    np.testing.assert_allclose(again, person.track.joints, atol=1e-5)


def test_a_person_alone_has_the_number_one_and_is_not_written_while_absent(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", random_poses(4), absent=2)
    export_run(run, tmp_path / "bodies.json", format="k4abt")
    document = json.loads((tmp_path / "bodies.json").read_text())
    assert [frame["num_bodies"] for frame in document["frames"]] == [0, 0, 1, 1]
    assert document["frames"][3]["bodies"][0]["body_id"] == 1
    assert document["source_file"] == "r.npz"
    assert len(Track.load(run)) == 4
