"""Procedural motions: on the floor, within limits, repeatable, and two disjoint sets."""

import numpy as np
import pytest

from tests.mocap_helpers import stick_body
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.errors import UsageError
from toolkit.mocap.choreography import MOTIONS
from toolkit.mocap.procedural import NAMES, SEATED_MOTIONS, SEATED_SUBJECT_MOTIONS, perform, procedural_clips


def joint(positions: np.ndarray, name: str) -> np.ndarray:
    return positions[..., skeleton.REPORTED.index(name), :]


@pytest.mark.parametrize("name", NAMES)
def test_a_motion_stays_within_the_limits_and_on_the_floor(name: str) -> None:
    body = load_body("neutral")
    clip = perform(name, body, 20.0, np.random.default_rng(1))
    low, high = skeleton.POSE_LIMITS.T
    assert ((clip.poses >= low - 1e-9) & (clip.poses <= high + 1e-9)).all()
    lowest = np.array([body.vertex_positions(pose)[:, 1].min() for pose in clip.poses[::10]])
    assert lowest.min() > -0.06
    assert lowest.max() < (0.2 if name == "jumping_jack" else 0.02)
    speed = np.linalg.norm(np.diff(body.joint_positions(clip.poses), axis=0), axis=2).max() * 20.0
    assert speed < 9.0


@pytest.mark.parametrize("name", (*SEATED_MOTIONS, *SEATED_SUBJECT_MOTIONS))
def test_sitters_have_level_thighs_and_an_upright_trunk(name: str) -> None:
    body = load_body("neutral")
    joints = body.joint_positions(perform(name, body, 5.0, np.random.default_rng(2)).poses)
    thighs = np.concatenate([joint(joints, f"{s}_knee") - joint(joints, f"{s}_hip") for s in ("left", "right")])
    slopes = np.degrees(np.arcsin(thighs[:, 1] / np.linalg.norm(thighs, axis=1)))
    assert -38.0 < np.median(slopes) < 45.0
    trunk = joint(joints, "neck") - joint(joints, "pelvis")
    assert (trunk[:, 1] / np.linalg.norm(trunk, axis=1)).min() > 0.35
    if MOTIONS[name].on_floor:
        lowest = [body.vertex_positions(pose)[:, 1].min() for pose in perform(name, body, 2.0).poses]
        assert lowest == pytest.approx(np.zeros(len(lowest)), abs=1e-9)
        assert joint(joints, "pelvis")[:, 1].max() < 0.45


def test_equal_seeds_give_equal_clips_and_variations_differ() -> None:
    names, body = ("wave", "squat", "random"), stick_body()
    first = procedural_clips(names, 15.0, body=body, variations=2, seed=4)
    again = procedural_clips(names, 15.0, body=body, variations=2, seed=4)
    assert [clip.name for clip in first] == [f"{name}_{i}" for name in names for i in (1, 2)]
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.poses, b.poses)
    assert first[0].poses.shape != first[1].poses.shape or not np.allclose(first[0].poses, first[1].poses)
    alone = procedural_clips(["squat"], 15.0, body=body, variations=1, seed=4)[0]
    np.testing.assert_array_equal(alone.poses, first[2].poses)


def test_the_supporting_foot_does_not_slide() -> None:
    body = load_body("neutral")
    for name in ("squat", "lunge", "raise_overhead"):
        clip = perform(name, body, 30.0)
        feet = body.joint_positions(clip.poses)[:, [skeleton.REPORTED.index(f"{s}_foot") for s in ("left", "right")]]
        steps = np.linalg.norm(np.diff(feet[..., [0, 2]], axis=0), axis=2)
        assert steps.min(axis=1).max() < 0.012


def test_an_unknown_motion_is_named_with_the_known_ones() -> None:
    with pytest.raises(UsageError, match="no motion 'fly'; there are idle, walk"):
        procedural_clips(["fly"], body=stick_body())
    with pytest.raises(UsageError, match="0 variations"):
        procedural_clips(["wave"], body=stick_body(), variations=0)
    with pytest.raises(UsageError, match="0.0 frames a second"):
        perform("wave", stick_body(), 0.0)
