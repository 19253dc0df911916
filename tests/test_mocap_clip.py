"""Clips: resampling, slicing, mirroring, and the rotations behind the retargeting."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from toolkit.body import skeleton
from toolkit.io.errors import MocapError
from toolkit.mocap.clip import Clip, PoseClip

NAMES = ("Hips", "LeftUpLeg", "LeftLeg", "RightUpLeg", "RightLeg", "Spine")
PARENTS = np.array([-1, 0, 1, 0, 3, 0])


def sample_clip(frames: int = 9, *, moving: bool = False) -> Clip:
    rng = np.random.default_rng(3)
    vectors = np.cumsum(rng.normal(0.0, 0.2, (frames, len(NAMES), 3)), axis=0)
    offsets = rng.normal(size=(len(NAMES), 3))
    return Clip(
        name="sample",
        joint_names=NAMES,
        parents=PARENTS,
        offsets=offsets,
        rotations=Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(frames, len(NAMES), 3, 3),
        root_positions=np.cumsum(rng.normal(0.0, 0.1, (frames, 3)), axis=0),
        frame_rate=30.0,
        translations=offsets + rng.normal(0.0, 0.1, (frames, len(NAMES), 3)) if moving else None,
        end_sites={"LeftLeg": np.array([0.1, -0.4, 0.0]), "Spine": np.array([0.0, 0.5, 0.1])},
    )


def test_resampling_agrees_with_scipys_slerp() -> None:
    clip = sample_clip()
    fine = clip.resampled(75.0)
    times = np.arange(len(fine)) / 75.0
    assert times[-1] <= 8 / 30.0 < times[-1] + 1 / 75.0
    for j in range(len(NAMES)):
        oracle = Slerp(np.arange(9) / 30.0, Rotation.from_matrix(clip.rotations[:, j]))(times).as_matrix()
        np.testing.assert_allclose(fine.rotations[:, j], oracle, atol=1e-9)
    np.testing.assert_allclose(fine.resampled(30.0).root_positions[0], clip.root_positions[0])


@pytest.mark.parametrize("value", [np.nan, 1e6])
def test_a_clip_that_makes_no_sense_is_refused(value: float) -> None:
    with pytest.raises(MocapError, match="farther than 100000 m or holds values that are not finite"):
        replace(sample_clip(), root_positions=np.full((9, 3), value))


def test_thinned_pose_clips_keep_whole_frames() -> None:
    poses = np.zeros((121, skeleton.POSE_SIZE))
    poses[:, 0] = np.arange(121)
    thin = PoseClip("walk", poses, 120.0, "walk.bvh").every(30.0)
    np.testing.assert_array_equal(thin.poses[:, 0], np.arange(0, 121, 4))
    assert thin.frame_rate == 30.0
    assert PoseClip("walk", poses, 120.0, "walk.bvh").every(500.0).frame_rate == 120.0
