"""Procedural motions: on the floor, within the limits, repeatable, and two sets that share nothing."""

from __future__ import annotations

import numpy as np
import pytest

from tests.mocap_helpers import stick_body
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.errors import UsageError
from toolkit.mocap.choreography import BASE, MOTIONS
from toolkit.mocap.procedural import (
    CONTROLS,
    NAMES,
    SEATED_MOTIONS,
    SEATED_SUBJECT_MOTIONS,
    perform,
    poses_from_controls,
    procedural_clips,
)


def joint(positions: np.ndarray, name: str) -> np.ndarray:
    return positions[..., skeleton.REPORTED.index(name), :]


def posed(**controls: float) -> np.ndarray:
    """The 20 joints of one pose made from controls."""
    row = np.array([[{**BASE, **controls}[name] for name in CONTROLS]])
    return stick_body().joint_positions(poses_from_controls(row))[0]


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


def test_controls_mean_what_they_say_on_both_sides() -> None:
    for side, s in (("left", 1.0), ("right", -1.0)):
        sideways = posed(**{f"{side}_lift": 90.0, f"{side}_plane": 0.0, f"{side}_elbow": 0.0})
        arm = joint(sideways, f"{side}_wrist") - joint(sideways, f"{side}_shoulder")
        assert s * arm[0] > 0.45 and abs(arm[1]) < 0.1
        forward = posed(**{f"{side}_lift": 90.0, f"{side}_plane": 90.0, f"{side}_elbow": 0.0})
        assert (joint(forward, f"{side}_wrist") - joint(forward, f"{side}_shoulder"))[2] > 0.45
        up = posed(**{f"{side}_lift": 175.0})
        assert (joint(up, f"{side}_wrist") - joint(up, f"{side}_shoulder"))[1] > 0.4
        curled = posed(**{f"{side}_lift": 5.0, f"{side}_plane": 0.0, f"{side}_elbow": 90.0})
        assert (joint(curled, f"{side}_wrist") - joint(curled, f"{side}_elbow"))[2] > 0.2
        kicked = posed(**{f"{side}_flex": 80.0, f"{side}_knee": 0.0})
        assert (joint(kicked, f"{side}_ankle") - joint(kicked, f"{side}_hip"))[2] > 0.7
        opened = posed(**{f"{side}_open": 40.0})
        assert s * (joint(opened, f"{side}_ankle") - joint(opened, f"{side}_hip"))[0] > 0.4
        knelt = posed(**{f"{side}_flex": 0.0, f"{side}_knee": 90.0})
        assert (joint(knelt, f"{side}_ankle") - joint(knelt, f"{side}_knee"))[2] < -0.35
    assert (joint(posed(bend=50.0), "neck") - joint(posed(bend=50.0), "pelvis"))[2] > 0.2
    assert (joint(posed(lean=25.0), "neck") - joint(posed(lean=25.0), "pelvis"))[0] > 0.05
    assert joint(posed(turn=40.0), "left_shoulder")[2] < -0.05


@pytest.mark.parametrize("name", (*SEATED_MOTIONS, *SEATED_SUBJECT_MOTIONS))
def test_whoever_sits_has_the_thighs_level_the_trunk_upright_and_stays_seated(name: str) -> None:
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
