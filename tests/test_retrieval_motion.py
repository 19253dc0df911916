"""Named joints from clips, poses and reported joints, and errors for unsuitable skeletons."""

from pathlib import Path

import numpy as np
import pytest

from tests.retrieval_motions import random_motion
from tests.run_helpers import track_of
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.errors import MocapError, RigError
from toolkit.mocap.clip import Clip
from toolkit.mocap.procedural import procedural_clips
from toolkit.mocap.read import find_clips, read_clip
from toolkit.mocap.retarget import retarget
from toolkit.output.export.bvh import export_bvh
from toolkit.retrieval.features.lengths import BodyLengths
from toolkit.retrieval.features.motion import (
    NAMED_JOINTS,
    Motion,
    from_clip,
    from_joints,
    from_poses,
    from_track,
    joint_maps,
)
from toolkit.retrieval.features.relational import relational_features
from toolkit.tracks import EMPTY, LOST

FILES = {"asf": "mocap/hdm05/HDM_bd_squat1Reps_001_120.amc", "cmu_bvh": "mocap/cmu/02_01.bvh"}


def place(motion: Motion, joint: str, frame: int = -1) -> np.ndarray:
    return motion.joints[frame, NAMED_JOINTS.index(joint)]


def small_clip(names: tuple[str, ...]) -> Clip:
    count = len(names)
    return Clip(
        name="small",
        joint_names=names,
        parents=np.arange(count) - 1,
        offsets=np.ones((count, 3)),
        rotations=np.tile(np.eye(3), (2, count, 1, 1)),
        root_positions=np.zeros((2, 3)),
        frame_rate=30.0,
        end_sites={names[-1]: np.array([0.0, 2.0, 0.0])},
    )


def test_every_map_names_all_joints_and_weighs_each_to_one() -> None:
    for table in joint_maps().values():
        assert set(table) == set(NAMED_JOINTS)
        for parts in table.values():
            assert sum(parts.values()) == pytest.approx(1.0)


def test_a_skeleton_without_the_joints_is_refused_with_their_names() -> None:
    with pytest.raises(RigError, match=r"'small' lacks .*rfemur\.end.*joints\.yaml"):
        from_clip(small_clip(("root", "lhipjoint", "lfemur", "lowerback")))


def test_a_skeleton_known_to_retargeting_gives_the_features_of_its_poses(tmp_path: Path) -> None:
    body = load_body("neutral")
    clip = procedural_clips(["squat"], 60.0, body=body, variations=1)[0]
    export_bvh(tmp_path / "squat.bvh", body, clip.poses, clip.frame_rate)
    exported = from_clip(read_clip(tmp_path / "squat.bvh"))
    assert len(exported) == len(clip)
    original = relational_features(from_poses(clip.poses, body, clip.frame_rate, "squat"))
    assert np.mean(relational_features(exported).values != original.values) < 0.02


def test_a_track_has_the_features_of_its_poses_at_the_rate_of_its_time_stamps() -> None:
    body = load_body("neutral")
    clip = procedural_clips(["wave"], 30.0, body=body, variations=1)[0]
    track = track_of(body.joint_positions(clip.poses), clip.poses, np.arange(len(clip)) / 30.0)
    motion = from_track(track, body, "run")
    assert motion.frame_rate == pytest.approx(30.0)
    assert relational_features(motion).values[2:4].any()  # a hand waves above the neck
    np.testing.assert_array_equal(motion.joints, from_poses(clip.poses, body, 30.0, "run").joints)


def test_lost_frames_of_a_track_are_bridged_and_missing_ones_keep_their_time() -> None:
    body = load_body("neutral")
    clip = procedural_clips(["wave"], 30.0, body=body, variations=1)[0]
    frames = len(clip)
    whole = from_poses(clip.poses, body, 30.0, "run")
    lost = slice(20, 32)
    poses = clip.poses.copy()
    poses[lost] = poses[19]  # joints of a tracker while the person is lost
    poses[:2] = 0.0
    state = np.zeros(frames, np.uint8)
    state[lost], state[:2] = LOST, EMPTY
    kept = np.delete(np.arange(frames), np.arange(50, 56))
    track = track_of(body.joint_positions(poses[kept]), poses[kept], 5.0 + kept / 30.0, state[kept])
    motion = from_track(track, body, "run")
    assert len(motion) == frames
    seen = np.r_[2:20, 32:50, 56:frames]
    np.testing.assert_allclose(motion.joints[seen], whole.joints[seen], atol=1e-9)
    np.testing.assert_allclose(motion.joints[0], whole.joints[2], atol=1e-9)
    steps = np.linalg.norm(np.diff(motion.joints[19:33], axis=0), axis=-1)
    assert np.ptp(steps, axis=0).max() < 1e-9, "a straight line at one speed"


def test_a_motion_at_another_speed_passes_through_the_same_places() -> None:
    motion = random_motion(3)
    slow = motion.at_speed(0.5)
    assert len(slow) == 2 * (len(motion) - 1)
    np.testing.assert_allclose(slow.joints[::2], motion.joints[:-1])
    np.testing.assert_allclose(slow.joints[1::2], (motion.joints[1:] + motion.joints[:-1]) / 2)
    for factor in (1.4, 0.7, 1.25):
        assert len(motion.at_speed(factor)) == pytest.approx((len(motion) - 1) / factor, abs=1.01)
    one = motion.sliced(0, 1)
    assert one.at_speed(2.0) is one
    with pytest.raises(MocapError, match="0 times as fast"):
        motion.at_speed(0)


def test_the_rest_pose_of_the_body_is_a_person_whose_hands_are_above_the_base_of_the_neck() -> None:
    body = load_body("neutral")
    motion = from_poses(np.zeros((4, skeleton.POSE_SIZE)), body, 30.0, "rest")
    assert place(motion, "left_wrist")[0] > 0.4 and place(motion, "right_wrist")[0] < -0.4
    assert place(motion, "left_toes")[2] > place(motion, "left_ankle")[2] + 0.05
    heights = [place(motion, joint)[1] for joint in ("root", "belly", "chest", "neck", "head", "headtop")]
    assert heights == sorted(heights)
    assert -0.05 < place(motion, "neck")[1] - place(motion, "left_shoulder")[1] < 0.0
    raised = np.zeros(skeleton.POSE_SIZE)
    raised[skeleton.POSE_NAMES.index("left_shoulder_rz")] = 0.6
    held = relational_features(from_poses(np.tile(raised, (4, 1)), body, 30.0, "raised")).values[:, -1]
    found = {int(i) + 1 for i in np.flatnonzero(held)}
    assert {4, 27, 28} <= found and not {1, 2, 5, 6, 13, 14, 20, 21, 37} & found


def test_reported_joints_give_the_same_features_as_the_poses_they_come_from_but_for_the_tips() -> None:
    body = load_body("neutral")
    rng = np.random.default_rng(1)
    poses = np.zeros((240, skeleton.POSE_SIZE))
    swing = np.sin(np.arange(240)[:, None] / 30.0 * rng.uniform(1, 5, skeleton.POSE_SIZE - 6))
    poses[:, 6:] = 0.25 * swing * np.ptp(np.clip(skeleton.POSE_LIMITS[6:], -2, 2), axis=1)
    full = relational_features(from_poses(poses, body, 30.0, "full"))
    reported = relational_features(from_joints(body.joint_positions(poses), 30.0, "reported"))
    assert np.mean(full.values != reported.values) < 0.06


@pytest.mark.data("hdm05")
def test_retargeting_changes_few_entries_and_using_only_the_reported_joints_few_more(data_folder: Path) -> None:
    body = load_body("neutral")
    by_poses, by_joints = [], []
    for path in find_clips(data_folder / "mocap" / "hdm05")[::16]:
        clip = read_clip(path)
        poses = retarget(clip, body)
        original = relational_features(from_clip(clip)).values
        posed = relational_features(from_poses(poses.poses, body, poses.frame_rate, clip.name)).values
        joints = body.joint_positions(poses.poses)
        reported = relational_features(from_joints(joints, poses.frame_rate, clip.name)).values
        by_poses.append((posed != original[:, -posed.shape[1] :]).mean(axis=1))
        by_joints.append((reported != posed).mean(axis=1))
    assert np.mean(by_poses) < 0.04
    assert np.mean(by_joints) < 0.03


@pytest.mark.data("cmu-mocap", "hdm05")
@pytest.mark.parametrize("rig", FILES)
def test_real_skeletons_have_human_proportions_left_at_positive_x_when_facing_z(data_folder: Path, rig: str) -> None:
    motion = from_clip(read_clip(data_folder / FILES[rig]))
    lengths = BodyLengths.of(motion)
    assert 1.2 < lengths.body < 1.9 and 0.2 < lengths.humerus_left < 0.4 and 0.2 < lengths.shoulders < 0.5
    across = place(motion, "left_hip") - place(motion, "right_hip")
    forward = place(motion, "left_toes") - place(motion, "left_ankle")
    assert np.cross(across, [0.0, 1.0, 0.0]) @ forward > 0.0
    assert motion.root_axis is not None and motion.root_axis[-1] @ across > 0.0
