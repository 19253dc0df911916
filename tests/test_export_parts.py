"""What other programs read: BVH, GLB, CSV and TRC taken apart again, and the packed clouds of a report."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.run_helpers import write_people
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.errors import UsageError
from toolkit.output.export.bvh import export_bvh
from toolkit.output.export.c3d import export_c3d
from toolkit.output.export.glb import GlbDocument, quaternions, skinning
from toolkit.output.export.rerun import POINTS, log_points
from toolkit.output.export.tables import export_csv, export_trc
from toolkit.output.export.tree import JointTree, rest_places, tips_of, tree_of
from toolkit.output.report import clouds
from toolkit.sensing.camera import Camera
from toolkit.tracks.runs import load_persons

BODY = load_body("neutral")
TREE = tree_of(BODY)


def poses(count: int = 3) -> np.ndarray:
    """Poses within the limits, away from the origin."""
    rng = np.random.default_rng(3)
    low, high = np.nan_to_num(skeleton.POSE_LIMITS.T, posinf=1.0, neginf=-1.0)
    found = 0.3 * rng.uniform(low, high, (count, skeleton.POSE_SIZE))
    found[:, :3] = (0.5, 1.0, -2.0)
    return found


def test_offsets_of_a_tree_lead_from_joint_to_joint() -> None:
    places = np.zeros((len(TREE.names), 3))
    for i, parent in enumerate(TREE.parents):
        assert parent < i
        places[i] = TREE.offsets[i] + (places[parent] if parent >= 0 else 0.0)
    assert places == pytest.approx(BODY.joints[TREE.turns])


def test_rotation_vectors_of_a_tree_are_those_of_the_pose() -> None:
    pose = poses(1)
    vectors = TREE.vectors(pose)[0]
    assert vectors[0] == pytest.approx(pose[0, 3:6])
    elbow = vectors[TREE.names.index("left_elbow")]
    assert elbow == pytest.approx([0.0, pose[0, skeleton.POSE_NAMES.index("left_elbow_ry")], 0.0])


def test_joints_that_are_carried_do_not_turn_and_end_at_the_tips_of_what_carries_them() -> None:
    root, wrist = 0, skeleton.JOINT_NAMES.index("left_wrist")
    parents, turns = np.array([-1, 0, 1]), np.array([root, wrist, -1])
    carried = SimpleNamespace(turns=turns)
    assert JointTree.vectors(carried, poses(2))[:, 2].tolist() == [[0.0] * 3] * 2  # type: ignore[arg-type]
    tips = tips_of(BODY, parents, turns)
    hand = BODY.vertices[BODY.end_effectors[skeleton.END_EFFECTORS.index("left_hand")]]
    assert list(tips) == [2] and tips[2] == pytest.approx(hand)


def test_a_joint_between_two_places_lies_in_their_middle() -> None:
    places = rest_places(BODY, ["root", ["left_hip", "right_hip"]])
    hips = BODY.joints[[skeleton.JOINT_NAMES.index(f"{side}_hip") for side in ("left", "right")]]
    assert places[0] == pytest.approx(BODY.joints[0]) and places[1] == pytest.approx(hips.mean(axis=0))


def placed(text: str, row: int) -> np.ndarray:
    """Positions of all joints and end sites of a frame of a BVH file, metres: read as its format says."""
    head, motion = text.split("MOTION")
    values = np.array(motion.splitlines()[3 + row].split(), dtype=float)
    stack: list[tuple[np.ndarray, np.ndarray]] = []
    out, offset, use = [], np.zeros(3), 0
    for line in head.splitlines():
        words = line.split()
        if words[:1] == ["OFFSET"]:
            offset = np.array(words[1:], dtype=float)
            above, turn = stack[-1] if stack else (np.zeros(3), np.eye(3))
            place = above + turn @ offset
            out.append(place)
            stack.append((place, turn))
        elif words[:1] == ["CHANNELS"]:
            place, turn = stack.pop()
            if words[1] == "6":
                place, use = place + values[:3], 3
                out[-1] = place
            for channel in words[-3:]:
                turn = (
                    turn
                    @ Rotation.from_rotvec(np.deg2rad(values[use]) * np.eye(3)["XYZ".index(channel[0])]).as_matrix()
                )
                use += 1
            stack.append((place, turn))
        elif words[:1] == ["}"]:
            stack.pop()
    return np.array(out) / 100.0


def test_a_bvh_file_stands_where_the_pose_does(tmp_path: Path) -> None:
    wanted = poses()
    export_bvh(tmp_path / "m.bvh", BODY, wanted, 25.0)
    text = (tmp_path / "m.bvh").read_text()
    assert "Frames: 3" in text and "Frame Time: 0.040000000" in text
    names = [line.split()[1] for line in text.splitlines() if line.split()[:1] in (["ROOT"], ["JOINT"])]
    assert names == list(TREE.names)
    for row, pose in enumerate(wanted):
        found = placed(text, row)
        body = BODY.place(pose)
        for joint in body.origins:
            assert np.linalg.norm(found - joint, axis=1).min() < 1e-4
        assert len(found) == len(TREE.names) + len(TREE.tips)
    ends = placed(text, 0)
    assert np.linalg.norm(ends[:, None] - BODY.end_effector_positions(wanted[0]), axis=2).min(axis=0).max() < 0.15
    with pytest.raises(UsageError, match="0 poses at 25.0"):
        export_bvh(tmp_path / "m.bvh", BODY, np.empty((0, skeleton.POSE_SIZE)), 25.0)


def test_quaternions_of_a_film_do_not_flip_and_are_x_y_z_w() -> None:
    angles = np.linspace(2.0, 5.0, 12)
    angles = np.where(angles > np.pi, angles - 2.0 * np.pi, angles)  # as rotation vectors jump at half a turn
    vectors = angles[:, None, None] * np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
    found = quaternions(vectors)
    assert ((found[1:] * found[:-1]).sum(axis=2) > 0.0).all()
    for k in range(2):
        turns = Rotation.from_quat(found[:, k]).as_matrix()
        assert turns == pytest.approx(Rotation.from_rotvec(vectors[:, k]).as_matrix(), abs=1e-6)


def test_skin_hangs_on_each_joint_once_and_its_weights_are_whole() -> None:
    joints, weights = skinning(BODY, TREE)
    assert weights.sum(axis=1) == pytest.approx(np.ones(len(BODY.vertices)), abs=1e-5)
    assert all(
        len({j for j, w in zip(*row, strict=True) if w > 0}) == (row[1] > 0).sum()
        for row in zip(joints, weights, strict=True)
    )
    heaviest = TREE.turns[joints[:, 0]]
    own = np.zeros((len(joints), len(skeleton.JOINTS)))
    for slot in range(BODY.skin_joints.shape[1]):
        own[np.arange(len(own)), BODY.skin_joints[:, slot]] += BODY.skin_weights[:, slot]
    assert own[np.arange(len(own)), heaviest] == pytest.approx(own.max(axis=1), abs=1e-6)


def test_of_many_influences_the_four_largest_are_kept_and_made_whole() -> None:
    body = SimpleNamespace(
        vertices=np.zeros((1, 3)), skin_joints=np.arange(6)[None],
        skin_weights=np.array([[0.05, 0.3, 0.1, 0.2, 0.25, 0.1]], dtype=np.float32),
    )  # fmt: skip
    joints, weights = skinning(body, TREE)  # type: ignore[arg-type]
    place = {int(joint): i for i, joint in enumerate(TREE.turns)}
    assert joints[0].tolist()[:3] == [place[1], place[4], place[3]]
    assert weights[0] == pytest.approx(np.array([0.3, 0.25, 0.2, 0.1]) / 0.85, abs=1e-6)


def test_a_glb_file_holds_its_lengths_and_its_numbers(tmp_path: Path) -> None:
    scene = GlbDocument((1.0, 0.5, 0.25, 1.0))
    first = scene.accessor(np.array([1, 2, 3]), "<u2")
    second = scene.accessor(np.array([[1.0, -2.0, 3.0], [0.0, 5.0, -1.0]]), "<f4", bounds=True)
    scene.save(tmp_path / "m.glb")
    data = (tmp_path / "m.glb").read_bytes()
    magic, version, total, length, kind = np.frombuffer(data[:20], dtype="<u4")
    assert (magic, version, total, kind) == (0x46546C67, 2, len(data), 0x4E4F534A) and length % 4 == 0
    document = json.loads(data[20 : 20 + length])
    binary = data[28 + length :]
    assert (
        document["buffers"][0]["byteLength"] == len(binary) == np.frombuffer(data[20 + length : 24 + length], "<u4")[0]
    )
    views, accessors = document["bufferViews"], document["accessors"]
    assert [view["byteOffset"] for view in views] == [0, 8]
    assert np.frombuffer(binary[:6], "<u2").tolist() == [1, 2, 3]
    assert accessors[first]["count"] == 3 and accessors[second]["type"] == "VEC3"
    assert (accessors[second]["min"], accessors[second]["max"]) == ([0.0, -2.0, -1.0], [1.0, 5.0, 3.0])


def person() -> SimpleNamespace:
    """Two frames, the second without anybody."""
    joints = np.arange(120.0).reshape(2, 20, 3) / 8.0
    track = SimpleNamespace(
        joints=joints, timestamps=np.array([0.0, 0.5]), confidence=np.full((2, 20), 0.25), state=np.array([0, 2]),
        observed=np.arange(40).reshape(2, 20) % 3 == 0, contact=np.array([[True, False], [True, True]]),
    )  # fmt: skip
    return SimpleNamespace(track=track, there=np.array([True, False]), joints_level=-joints)


def test_a_table_says_what_was_found_and_leaves_blank_where_nobody_is(tmp_path: Path) -> None:
    export_csv(tmp_path / "t.csv", person())  # type: ignore[arg-type]
    header, here, away = (line.split(",") for line in (tmp_path / "t.csv").read_text().splitlines())
    row = dict(zip(header, here, strict=True))
    assert row["time_s"] == "0.000000" and row["state"] == "tracked"
    assert [row[f"spine_{axis}_m"] for axis in "xyz"] == ["0.375000", "0.500000", "0.625000"]
    assert row["head_confidence"] == "0.2500"
    assert [row[f"{name}_observed"] for name in skeleton.REPORTED[:4]] == ["1", "0", "0", "1"]
    assert (row["left_foot_contact"], row["right_foot_contact"]) == ("1", "0")
    assert away[:2] == ["0.500000", "empty"] and not any(away[2:])
    export_csv(tmp_path / "l.csv", person(), level=True)  # type: ignore[arg-type]
    level = (tmp_path / "l.csv").read_text().splitlines()[1].split(",")
    assert level[2 + 3] == "-0.375000"


def test_markers_stand_in_metres_in_the_order_of_the_joints(tmp_path: Path) -> None:
    joints = np.arange(120.0).reshape(2, 20, 3)
    joints[1, 3] = np.nan
    marked = SimpleNamespace(track=[0, 1], times=np.array([0.0, 0.04]), joints_level=joints, frame_rate=lambda: 25.0)
    export_trc(tmp_path / "m.trc", marked)  # type: ignore[arg-type]
    lines = (tmp_path / "m.trc").read_text().split("\n")
    assert lines[2].split("\t")[:5] == ["25", "25", "2", "20", "m"]
    assert lines[3].split("\t")[2::3][:3] == ["pelvis", "spine", "neck"]
    first, second = lines[6].split("\t"), lines[7].split("\t")
    assert first[:5] == ["1", "0.000000", "0.000000", "1.000000", "2.000000"]
    assert second[:2] == ["2", "0.040000"] and second[11:14] == ["", "", ""] and second[14] == "72.000000"


def test_packed_points_are_unpacked_by_sums_of_their_low_and_high_bytes() -> None:
    points = np.array([[5, -300, 1000], [6, -290, 32767], [-7, 0, -32768]], dtype=np.int16)
    data = np.frombuffer(clouds.pack(points), dtype=np.uint8)
    low, high = data[: points.size], data[points.size :]
    steps = (low.astype(np.uint16) | high.astype(np.uint16) << 8).view(np.int16).reshape(3, len(points))
    assert steps.cumsum(axis=1, dtype=np.int16).T.tolist() == points.tolist()


def test_points_near_a_person_are_those_within_reach_of_a_joint() -> None:
    rays = np.dstack([*np.meshgrid(np.linspace(-0.5, 0.5, 11), np.zeros(1)), np.ones((1, 11))])
    depth = np.full((1, 11), 2000.0)
    depth[0, 5] = 0.0
    joints = np.array([[0.0, 0.0, 2.0], [np.nan, 0.0, 2.0]])
    near = clouds.near_people(depth, rays, joints)
    expected = (np.abs(np.linspace(-1.0, 1.0, 11)) < clouds.REACH) & (depth[0] > 0)
    assert near[0].tolist() == expected.tolist() and near.any() and not near.all()
    assert not clouds.near_people(depth, rays, joints[1:]).any()
    both = clouds.near_people(depth, rays, np.array([[-0.8, 0.0, 2.0], [0.8, 0.0, 2.0]]))
    assert both[0, 1] and both[0, 9]
    close = clouds.near_people(depth, rays, np.array([[0.0, 0.0, 0.5 * clouds.REACH]]))
    assert not close[0, 5]


def test_a_room_is_the_median_of_what_was_measured() -> None:
    images = np.array([[[0, 5, 0]], [[4, 7, 0]], [[8, 9, 0]]])
    assert clouds.median_point(images).tolist() == [[6.0, 7.0, 0.0]]


def test_too_many_points_are_thinned_on_a_grid() -> None:
    rows, columns = clouds.thinned(np.ones((40, 60), dtype=bool), 100)
    assert 50 <= len(rows) <= 100
    assert len(set(rows.tolist())) > 4 and len(set(columns.tolist())) > 4
    every, _ = clouds.thinned(np.ones((3, 4), dtype=bool), 12)
    assert len(every) == 12


def test_points_of_a_c3d_are_millimetres_by_person_and_missing_where_nobody_is(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    people = load_persons(write_people(tmp_path / "run", poses()))
    export_c3d(tmp_path / "track.c3d", people)
    file = ezc3d.c3d(str(tmp_path / "track.c3d"))
    labels, points = file["parameters"]["POINT"]["LABELS"]["value"], file["data"]["points"]
    row = labels.index("person_02:left_hand")
    expected = 1000.0 * people[1].joints_level[:, skeleton.REPORTED.index("left_hand")]
    assert points[:3, row, 1:].T == pytest.approx(expected[1:], abs=0.01) and np.isnan(points[:3, row, 0]).all()
    assert file["parameters"]["POINT"]["RATE"]["value"][0] == pytest.approx(25.0)
    short = load_persons(write_people(tmp_path / "short", poses(2)))
    with pytest.raises(UsageError, match="people of one recording"):
        export_c3d(tmp_path / "two.c3d", [people[0], short[1]])


def test_points_for_rerun_are_thinned_evenly_and_stand_in_the_files_frame() -> None:
    camera = Camera(100.0, 100.0, 79.5, 59.5, 160, 120)
    depth = np.full(camera.shape, 2000, np.uint16)
    depth[:, :80] = 0
    told: list[tuple[str, np.ndarray]] = []
    viewer = SimpleNamespace(Points3D=lambda points, **_: points)
    stream = SimpleNamespace(log=lambda name, points: told.append((name, points)))
    recording: Any = SimpleNamespace(camera=camera)
    log_points(viewer, stream, depth, recording, np.diag([1.0, -1.0, -1.0]), np.array([0.0, -1.0, 0.0]))
    ((name, points),) = told
    assert name == "world/points" and POINTS // 2 < len(points) <= POINTS
    assert points[:, 2] == pytest.approx(-2.0) and (points[:, 0] > 0).all()
    assert [points[:, 1].min(), points[:, 1].max()] == pytest.approx([1.0 - 1.19, 1.0 + 1.19], abs=0.03)
