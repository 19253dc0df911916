"""Retargeting: rigs of any names, rest pose and axes move our body as they move."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.mocap_helpers import in_world, renamed, stick_body, with_rest_pose
from toolkit.body import skeleton
from toolkit.body.rotations.matrices import matrices, unit
from toolkit.body.shape import load_body
from toolkit.mocap.clip import Clip, PoseClip
from toolkit.mocap.procedural import perform
from toolkit.mocap.read import find_clips, read_clip
from toolkit.mocap.retarget import retarget
from toolkit.mocap.rig import load_rig
from toolkit.mocap.source import KeyedClip
from toolkit.output.export.bvh import export_bvh

LIMBS = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))


def sided(names: dict[str, str]) -> dict[str, str]:
    """Return names for both sides from names for the left one (`Left` or a leading `l` becomes right)."""
    out = {}
    for key, name in names.items():
        out[f"left_{key}"] = name
        out[f"right_{key}"] = name.replace("Left", "Right") if "Left" in name else "r" + name[1:]
    return out


MIXAMO = {
    "root": "mixamorig:Hips", "lumbar": "mixamorig:Spine1", "thorax": "mixamorig:Spine2", "cervical": "mixamorig:Neck",
    **sided({
        "clavicle": "mixamorig:LeftShoulder", "shoulder": "mixamorig:LeftArm", "elbow": "mixamorig:LeftForeArm",
        "wrist": "mixamorig:LeftHand", "hip": "mixamorig:LeftUpLeg", "knee": "mixamorig:LeftLeg",
        "ankle": "mixamorig:LeftFoot",
    }),
}  # fmt: skip
MIXAMO_TIPS = {
    "cervical": "mixamorig:Head",
    "left_wrist": "mixamorig:LeftHandMiddle1", "right_wrist": "mixamorig:RightHandMiddle1",
    "left_ankle": "mixamorig:LeftToeBase", "right_ankle": "mixamorig:RightToeBase",
}  # fmt: skip
DAZ = {
    "root": "pelvis", "lumbar": "abdomenLower", "thorax": "chestUpper", "cervical": "neckLower",
    **sided({
        "clavicle": "lCollar", "shoulder": "lShldrBend", "elbow": "lForearmBend", "wrist": "lHand", "hip": "lThighBend",
        "knee": "lShin", "ankle": "lFoot",
    }),
}  # fmt: skip
DAZ_TIPS = {
    "cervical": "head", "left_wrist": "lMid1", "right_wrist": "rMid1", "left_ankle": "lToe", "right_ankle": "rToe",
}  # fmt: skip
CLASSIC = {
    "root": "Hips", "lumbar": "Chest", "thorax": "Chest2", "cervical": "Neck",
    **sided({
        "clavicle": "LeftCollar", "shoulder": "LeftShoulder", "elbow": "LeftElbow", "wrist": "LeftWrist",
        "hip": "LeftHip", "knee": "LeftKnee", "ankle": "LeftAnkle",
    }),
}  # fmt: skip


def own_clip(tmp_path: Path, motion: str) -> tuple[Clip, np.ndarray]:
    """Return a motion of the stick body as a clip of its skeleton in T-pose, and its poses."""
    body = stick_body()
    poses = perform(motion, body, 30.0).poses
    export_bvh(tmp_path / f"{motion}.bvh", body, poses, 30.0)
    return read_clip(tmp_path / f"{motion}.bvh"), poses


def a_pose(clip: Clip) -> np.ndarray:
    """Return world rotations (J, 3, 3) of an A-pose: arms 45 degrees down and 10 forward, legs 8 degrees apart."""
    turned = np.broadcast_to(np.eye(3), (len(clip.joint_names), 3, 3)).copy()
    for j, name in enumerate(clip.joint_names):
        s = 1.0 if "left" in name else -1.0
        if "shoulder" in name or "elbow" in name or "wrist" in name:
            turned[j] = matrices(np.array([[0.0, -s * 0.17, 0.0]]))[0] @ matrices(np.array([[0.0, 0.0, -s * 0.78]]))[0]
        elif "hip" in name or "knee" in name or "ankle" in name:
            turned[j] = matrices(np.array([[0.0, 0.0, s * 0.14]]))[0]
    return turned


def direction_errors(source: KeyedClip, joints: np.ndarray, side: str, bone: tuple[str, str]) -> np.ndarray:
    """Return degrees (T,) between a limb bone of the reported joints (T, 20, 3) and the source's."""
    start, stop = (joints[:, skeleton.REPORTED.index(f"{side}_{part}")] for part in bone)
    _, wanted = source.bone(f"{side}_{bone[0]}", f"{side}_{bone[1]}")
    return np.degrees(np.arccos(np.clip((unit(stop - start) * wanted).sum(axis=1), -1.0, 1.0)))


def distances(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return metres (T, 20) between the reported joints of two pose sequences of the stick body."""
    body = stick_body()
    return np.linalg.norm(body.joint_positions(first) - body.joint_positions(second), axis=2)


@pytest.mark.parametrize("motion", ["boxing", "kick_side", "arms_crossed", "lunge"])
@pytest.mark.parametrize(
    ("rig", "names", "tips"),
    [("mixamo", MIXAMO, MIXAMO_TIPS), ("daz", DAZ, DAZ_TIPS), ("classic_bvh", CLASSIC, {"cervical": "Head"})],
)
@pytest.mark.parametrize("rest", ["T-pose", "A-pose"])
def test_a_rig_of_other_names_and_rest_pose_gives_the_same_joints(
    tmp_path: Path, rig: str, names: dict[str, str], tips: dict[str, str], motion: str, rest: str
) -> None:
    clip, poses = own_clip(tmp_path, motion)
    posed = clip if rest == "T-pose" else with_rest_pose(clip, a_pose(clip))
    foreign = renamed(posed, names, tips)
    assert load_rig(foreign).name == rig
    again = retarget(foreign, stick_body())
    error = distances(again.poses, poses)
    major = [i for i, name in enumerate(skeleton.REPORTED) if not name.endswith(("hand", "foot"))]
    assert error[:, major].max() < 0.06
    assert error.mean() < 0.012


def test_a_rig_that_stands_along_z_is_brought_upright(tmp_path: Path) -> None:
    clip, poses = own_clip(tmp_path, "throw")
    z_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    assert distances(retarget(in_world(clip, z_up), stick_body()).poses, poses).max() < 0.05


def test_a_rest_pose_that_faces_away_keeps_the_facing_of_the_motion(tmp_path: Path) -> None:
    clip, poses = own_clip(tmp_path, "throw")
    about = np.diag([-1.0, 1.0, -1.0])
    turned = with_rest_pose(clip, np.broadcast_to(about, (len(clip.joint_names), 3, 3)))
    assert distances(retarget(turned, stick_body()).poses, poses).max() < 0.05


def test_left_stays_left(tmp_path: Path) -> None:
    clip, poses = own_clip(tmp_path, "wave")
    body = stick_body()
    plain = body.joint_positions(retarget(clip, body).poses)
    raised = body.joint_positions(poses)
    highest = {side: raised[:, skeleton.REPORTED.index(f"{side}_wrist"), 1].max() for side in ("left", "right")}
    assert highest["right"] > highest["left"] + 0.3
    assert plain[:, skeleton.REPORTED.index("right_wrist"), 1].max() == pytest.approx(highest["right"], abs=0.03)


def test_a_bend_beyond_a_lumbar_spine_keeps_its_depth_by_tilting_the_pelvis(tmp_path: Path) -> None:
    body, poses = stick_body(), np.zeros((5, skeleton.POSE_SIZE))
    bend, root = skeleton.POSE_NAMES.index("lumbar_rx"), skeleton.POSE_NAMES.index("root_rx")
    limit = skeleton.POSE_LIMITS[bend, 1]
    poses[:, 1], poses[:, bend] = 1.0, limit + np.array([-0.2, 0.0, 0.2, 0.4, 0.5])
    export_bvh(tmp_path / "bow.bvh", body, poses, 30.0)
    bow = retarget(read_clip(tmp_path / "bow.bvh"), body).poses
    np.testing.assert_allclose(bow[:, bend], np.minimum(poses[:, bend], limit), atol=1e-3)
    np.testing.assert_allclose(bow[:, root], np.maximum(poses[:, bend] - limit, 0.0), atol=1e-3)


def test_a_taller_source_moves_in_proportion_to_its_legs(tmp_path: Path) -> None:
    clip, poses = own_clip(tmp_path, "walk")
    tall = replace(
        clip,
        offsets=clip.offsets * 1.25,
        root_positions=clip.root_positions * 1.25,
        end_sites={joint: tip * 1.25 for joint, tip in clip.end_sites.items()},
    )
    assert distances(retarget(tall, stick_body()).poses, poses).max() < 0.06


@pytest.fixture(scope="module")
def real(data_folder: Path) -> list[tuple[Clip, PoseClip]]:
    """Return some real clips of both collections with their poses on the neutral body."""
    clips = [read_clip(path) for path in find_clips(data_folder / "mocap")[::14]]
    return [(clip, retarget(clip, load_body("neutral"))) for clip in clips]


@pytest.mark.data("cmu-mocap", "hdm05")
def test_limbs_of_real_clips_point_as_in_the_source(real: list[tuple[Clip, PoseClip]]) -> None:
    errors: dict[tuple[str, str], list[np.ndarray]] = {bone: [] for bone in LIMBS}
    for clip, found in real:
        source, joints = KeyedClip.of(clip, load_rig(clip)), load_body("neutral").joint_positions(found.poses)
        for bone in LIMBS:
            errors[bone] += [direction_errors(source, joints, side, bone) for side in ("left", "right")]
    for bone, values in errors.items():
        degrees = np.concatenate(values)
        assert degrees.mean() < 2.5, bone
        assert np.quantile(degrees, 0.95) < 8.0, bone


@pytest.mark.data("cmu-mocap", "hdm05")
def test_real_clips_keep_facing_sides_and_floor(real: list[tuple[Clip, PoseClip]]) -> None:
    body = load_body("neutral")
    heights = []
    for clip, found in real:
        source = KeyedClip.of(clip, load_rig(clip))
        joints = body.joint_positions(found.poses)
        across = joints[:, skeleton.REPORTED.index("left_hip")] - joints[:, skeleton.REPORTED.index("right_hip")]
        wanted = source.positions["left_hip"] - source.positions["right_hip"]
        assert np.quantile((unit(across) * unit(wanted)).sum(axis=1), 0.02) > 0.9
        feet = joints[:, [skeleton.REPORTED.index(f"{side}_foot") for side in ("left", "right")], 1].min(axis=1)
        heights.append(np.quantile(feet, 0.1))
    assert -0.02 < np.median(heights) < 0.05
    assert np.quantile(np.abs(heights), 0.8) < 0.08


@pytest.mark.data("cmu-mocap", "hdm05")
def test_poses_of_real_clips_respect_the_limits_and_move_smoothly(real: list[tuple[Clip, PoseClip]]) -> None:
    low, high = skeleton.POSE_LIMITS.T
    jumps, steps = 0, 0
    clamped: list[float] = []
    for _, found in real:
        assert ((found.poses >= low - 1e-9) & (found.poses <= high + 1e-9)).all()
        clamped.append(found.clamped.mean())
        turned = np.abs(np.diff(found.poses[:, 6:], axis=0)).max(axis=1)
        jumps, steps = jumps + int((turned > 0.5).sum()), steps + len(turned)
    assert np.mean(clamped) < 0.02 and max(clamped) < 0.1
    assert jumps / steps < 0.004  # some sources flip a thigh by half a turn between frames


@pytest.mark.data("cmu-mocap", "hdm05")
def test_calibration_frames_of_cmu_clips_are_dropped_and_none_of_hdm05(data_folder: Path) -> None:
    for folder, dropped in (("cmu", 1), ("hdm05", 0)):
        for path in find_clips(data_folder / "mocap" / folder)[::15]:
            clip = read_clip(path)
            assert len(clip) - KeyedClip.of(clip, load_rig(clip)).frames == dropped
    twice = read_clip(data_folder / "mocap" / "cmu" / "07_12.bvh")
    assert len(twice) - KeyedClip.of(twice, load_rig(twice)).frames == 2
