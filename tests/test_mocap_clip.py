"""Clips: resampling, slicing, mirroring, and the rotations behind the retargeting."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation, Slerp

from toolkit.body import skeleton
from toolkit.body.rotations.matrices import hinge_angles, matrices, swing, unit, unwrapped, vectors_of, without_twist
from toolkit.io.errors import MocapError
from toolkit.mocap.clip import Clip, PoseClip, mirror_partners

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


@pytest.mark.parametrize("moving", [False, True])
def test_a_clip_mirrored_twice_is_itself(moving: bool) -> None:
    clip = sample_clip(moving=moving)
    twice = clip.mirrored().mirrored()
    np.testing.assert_allclose(twice.world()[0], clip.world()[0], atol=1e-12)
    np.testing.assert_allclose(twice.world()[1], clip.world()[1], atol=1e-12)
    assert set(clip.mirrored().end_sites) == {"RightLeg", "Spine"}


@pytest.mark.parametrize("moving", [False, True])
def test_mirroring_reflects_every_joint_and_swaps_left_and_right(moving: bool) -> None:
    clip = sample_clip(moving=moving)
    partner = [clip.index(n) for n in ("Hips", "RightUpLeg", "RightLeg", "LeftUpLeg", "LeftLeg", "Spine")]
    expected = clip.world()[0][:, partner] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(clip.mirrored().world()[0], expected, atol=1e-12)


def test_mirror_partners_are_known_in_the_common_namings() -> None:
    names = [
        "root",
        "lfemur",
        "rfemur",
        "LHipJoint",
        "RHipJoint",
        "mixamorig:LeftArm",
        "mixamorig:RightArm",
        "lowerback",
    ]
    assert mirror_partners(names) == [0, 2, 1, 4, 3, 6, 5, 7]


def test_a_lopsided_tree_cannot_be_mirrored() -> None:
    clip = replace(sample_clip(), parents=np.array([-1, 0, 1, 0, 0, 0]))
    with pytest.raises(MocapError, match="not the same tree"):
        clip.mirrored()


def test_resampling_agrees_with_scipys_slerp() -> None:
    clip = sample_clip()
    fine = clip.resampled(75.0)
    times = np.arange(len(fine)) / 75.0
    assert times[-1] <= 8 / 30.0 < times[-1] + 1 / 75.0
    for j in range(len(NAMES)):
        oracle = Slerp(np.arange(9) / 30.0, Rotation.from_matrix(clip.rotations[:, j]))(times).as_matrix()
        np.testing.assert_allclose(fine.rotations[:, j], oracle, atol=1e-9)
    np.testing.assert_allclose(fine.resampled(30.0).root_positions[0], clip.root_positions[0])


def test_resampling_to_its_own_rate_changes_nothing() -> None:
    clip = sample_clip(moving=True)
    np.testing.assert_allclose(clip.resampled(30.0).world()[0], clip.world()[0], atol=1e-9)


def test_a_slice_keeps_its_frames() -> None:
    clip = sample_clip(moving=True)
    np.testing.assert_allclose(clip.sliced(2, 5).world()[0], clip.world()[0][2:5])
    with pytest.raises(MocapError, match="no frames"):
        clip.sliced(5, 5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frame_rate": 0.0}, "frame rate 0.0"),
        ({"offsets": np.zeros((2, 3))}, "offsets of shape"),
        ({"root_positions": np.full((9, 3), np.nan)}, "not finite"),
    ],
)
def test_a_clip_that_makes_no_sense_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(MocapError, match=message):
        replace(sample_clip(), **change)


def test_an_unknown_joint_is_named_with_the_known_ones() -> None:
    with pytest.raises(MocapError, match="no joint 'Tail'; it has: Hips, LeftUpLeg"):
        sample_clip().index("Tail")


def test_thinned_pose_clips_keep_whole_frames() -> None:
    poses = np.zeros((121, skeleton.POSE_SIZE))
    poses[:, 0] = np.arange(121)
    thin = PoseClip("walk", poses, 120.0, "walk.bvh").every(30.0)
    np.testing.assert_array_equal(thin.poses[:, 0], np.arange(0, 121, 4))
    assert thin.frame_rate == 30.0
    assert PoseClip("walk", poses, 120.0, "walk.bvh").every(500.0).frame_rate == 120.0


directions = arrays(np.float64, (5, 3), elements=st.floats(-1.0, 1.0)).filter(
    lambda a: bool((np.linalg.norm(a, axis=1) > 0.1).all())
)


@settings(max_examples=60, deadline=None)
@given(directions, directions)
def test_a_swing_turns_one_direction_to_the_other_by_the_least_angle(start: np.ndarray, stop: np.ndarray) -> None:
    start, stop = unit(start), unit(stop)
    turn = swing(start, stop)
    np.testing.assert_allclose((turn @ start[..., None])[..., 0], stop, atol=1e-6)
    np.testing.assert_allclose(turn @ np.swapaxes(turn, -1, -2), np.broadcast_to(np.eye(3), turn.shape), atol=1e-6)
    angle = np.linalg.norm(vectors_of(turn), axis=1)
    np.testing.assert_allclose(np.cos(angle), (start * stop).sum(axis=1), atol=1e-6)


def test_opposite_directions_are_swung_by_half_a_turn() -> None:
    for axis in np.eye(3):
        turn = swing(axis, -axis)[0]
        np.testing.assert_allclose(turn @ axis, -axis, atol=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1.0)


@settings(max_examples=60, deadline=None)
@given(arrays(np.float64, (5, 3), elements=st.floats(-1.7, 1.7)), st.integers(0, 2))
def test_swing_and_twist_make_the_rotation_again(vectors: np.ndarray, axis: int) -> None:
    rotations = matrices(vectors)
    swung = without_twist(rotations, axis)
    assert np.abs(vectors_of(swung)[:, axis]).max() < 1e-6
    twist = vectors_of(np.swapaxes(swung, -1, -2) @ rotations)
    assert np.abs(np.delete(twist, axis, axis=1)).max() < 1e-6


@settings(max_examples=60, deadline=None)
@given(st.floats(0.05, 2.8), st.sampled_from([-1.0, 1.0]), st.integers(0, 1000))
def test_a_hinge_reaches_the_angle_it_made(angle: float, sign: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = unit(np.array([1.0, 0.0, 0.0]) + rng.normal(0.0, 0.1, 3))
    second = unit(np.array([1.0, 0.0, 0.0]) + rng.normal(0.0, 0.1, 3))
    bent = matrices(np.array([[0.0, sign * angle, 0.0]]))[0] @ second
    found = hinge_angles(first, second, 1, np.array([first @ bent]), sign)[0]
    reached = matrices(np.array([[0.0, found, 0.0]]))[0] @ second
    assert first @ reached == pytest.approx(first @ bent, abs=1e-9)
    # At rest the directions are up to 0.6 from parallel: nearer to straight or to folded the other solution is as good.
    if 0.6 < angle < np.pi - 0.6:
        assert found == pytest.approx(sign * angle, abs=1e-6)


def test_unwrapped_rotation_vectors_keep_their_rotations_and_do_not_jump() -> None:
    yaw = np.linspace(0.0, 1.8 * np.pi, 200)
    tilted = matrices(np.stack([0 * yaw, yaw, 0 * yaw], axis=1)) @ matrices(np.array([[0.1, 0.0, 0.05]]))
    wrapped = vectors_of(tilted)
    assert np.abs(np.diff(wrapped, axis=0)).max() > 5.0
    half = unwrapped(wrapped[:150])
    np.testing.assert_allclose(matrices(half), tilted[:150], atol=1e-9)
    assert np.abs(np.diff(half, axis=0)).max() < 0.2
