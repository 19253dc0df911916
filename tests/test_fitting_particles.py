"""The particle filter of an upper body."""

import numpy as np
import pytest

from tests.poses import pose_at, upper_body_depth
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import TypedReader
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud
from toolkit.trackers.lopez2011 import filter as room
from toolkit.trackers.lopez2011.costs import ParticleFrame, mean_cost
from toolkit.trackers.lopez2011.effectors import Effectors, Fork
from toolkit.trackers.lopez2011.filter import ParticleSettings, UpperFilter, diffusion
from toolkit.trackers.lopez2011.initial import initial_pose, place_hands
from toolkit.trackers.lopez2011.sizing import shoulder_breadth, sized_body
from toolkit.trackers.lopez2011.tracker import ParticleTrackerSettings
from toolkit.trackers.lopez2011.upper import UpperBodies, UpperBody

LEVEL = np.diag([1.0, -1.0, -1.0])
CAMERA = Camera(285.6, 285.6, 159.5, 119.5, 320, 240)
NOTHING = np.empty((0, 3))


@pytest.fixture(scope="module")
def upper() -> UpperBody:
    return UpperBodies(LEVEL).of(load_body())


def pose_of(**angles: float) -> np.ndarray:
    """Return the pose (P,) of a person who faces the camera, arms down by default."""
    return pose_at((0.0, -0.45, -1.5), **{"left_shoulder_rz": -0.9, "right_shoulder_rz": 0.9} | angles)


def depth_of(upper: UpperBody, pose: np.ndarray) -> np.ndarray:
    return upper_body_depth(upper.body, pose, CAMERA, LEVEL)


def frame_of(depth: np.ndarray, candidates: np.ndarray = NOTHING) -> ParticleFrame:
    return ParticleFrame.of(depth[::2, ::2], None, CAMERA.subsampled(2), candidates)


def hands_off(upper: UpperBody, found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    return np.linalg.norm(place_hands(upper, found) - place_hands(upper, truth), axis=1)


def test_the_true_pose_costs_least_among_a_thousand(upper: UpperBody) -> None:
    rng = np.random.default_rng(0)
    truth = pose_of(left_elbow_ry=-0.8, right_elbow_ry=1.4)
    frame = frame_of(depth_of(upper, truth))
    best, spread = mean_cost(upper, truth, frame), diffusion()
    for _ in range(1000):
        other = np.clip(truth + spread * rng.standard_normal(len(truth)), *skeleton.POSE_LIMITS.T)
        assert mean_cost(upper, other, frame) > best


def filtered(upper: UpperBody, start: np.ndarray, frame: ParticleFrame, frames: int, **settings: float) -> np.ndarray:
    """Return the estimate after some frames of the same image."""
    filtering, rng = UpperFilter(ParticleSettings(**settings)), np.random.default_rng(0)  # type: ignore[arg-type]
    particles, pose = np.repeat(start[None], filtering.settings.count, axis=0), start
    for _ in range(frames):
        particles = filtering.trunk(upper, particles, pose, frame, 1 / 30, rng)
        result = filtering.arms(upper, particles, pose, frame, 1 / 30, rng)
        particles, pose = result.particles, result.estimate
    return pose


def test_the_filter_follows_the_trunk_and_both_arms(upper: UpperBody) -> None:
    truth = pose_of(left_elbow_ry=-0.9, right_elbow_ry=0.9)
    start = truth.copy()
    start[:3] += [0.04, 0.02, 0.05]
    start[[skeleton.POSE_NAMES.index("left_elbow_ry"), skeleton.POSE_NAMES.index("right_elbow_ry")]] = [-0.4, 0.4]
    found = filtered(upper, start, frame_of(depth_of(upper, truth)), 15)
    assert np.linalg.norm(found[:3] - truth[:3]) < 0.04
    assert hands_off(upper, found, truth).max() < 0.09


def test_a_raised_hand_is_found_by_a_hanging_arm_through_its_candidate(upper: UpperBody) -> None:
    truth = pose_of(left_shoulder_rz=0.6, left_elbow_ry=-0.6)
    candidates = place_hands(upper, truth)[:1]
    frame = frame_of(depth_of(upper, truth), candidates)
    aimed = filtered(upper, pose_of(), frame, 3)
    blind = filtered(upper, pose_of(), frame, 3, alpha=1.0)
    assert hands_off(upper, aimed, truth)[0] < 0.12
    assert hands_off(upper, blind, truth)[0] > 0.3


def effectors_of(points: np.ndarray) -> Effectors:
    return Effectors(points, points.mean(axis=0), tuple(points[None, i] for i in range(len(points))))


def test_a_first_pose_has_head_and_hands_where_they_were_found(upper: UpperBody) -> None:
    truth = pose_of(left_shoulder_rz=0.4, right_shoulder_rz=-0.2, left_elbow_ry=-0.9, right_elbow_ry=1.2)
    crown = upper.body.end_effector_positions(truth)[skeleton.END_EFFECTORS.index("head")]
    effectors = effectors_of(np.stack([crown, *place_hands(upper, truth)]))
    frame = frame_of(depth_of(upper, truth), effectors.points)
    first = initial_pose(upper, effectors, Fork(0, 1, 2), frame)
    found = upper.body.end_effector_positions(first.pose)[skeleton.END_EFFECTORS.index("head")]
    assert np.linalg.norm(found - crown) < 0.08
    assert hands_off(upper, first.pose, truth).max() < 0.12
    assert first.score > -ParticleTrackerSettings().lost_cost


def test_the_estimate_is_what_both_arms_layers_explain_best(upper: UpperBody, monkeypatch: pytest.MonkeyPatch) -> None:
    filtering = UpperFilter(ParticleSettings(count=4))
    monkeypatch.setattr(room, "SHARPNESS", 0.0)
    layers = iter([np.array([3.0, 0.0, 1.0, 3.0]), np.array([0.0, 3.0, 1.0, 3.0])])
    monkeypatch.setattr(room, "costs_of_arm", lambda *_: next(layers))
    monkeypatch.setattr(filtering, "move_arm", lambda _, poses, *__, **___: np.zeros(len(poses), dtype=bool))
    particles = np.stack([pose_of(root_tx=0.01 * k) for k in range(4)])
    frame, rng = frame_of(depth_of(upper, pose_of())), np.random.default_rng(0)
    found = filtering.arms(upper, particles, pose_of(), frame, 1 / 30, rng)
    np.testing.assert_array_equal(found.estimate, particles[2])


def test_a_first_pose_of_hands_that_are_nowhere_is_not_accepted(upper: UpperBody) -> None:
    depth = depth_of(upper, pose_of())
    head = upper.body.end_effector_positions(pose_of())[skeleton.END_EFFECTORS.index("head")]
    effectors = effectors_of(head + np.array([[0.0, 0.9, 0.0], [1.5, 0.9, 0.0], [-1.5, 0.9, 0.0]]))
    first = initial_pose(upper, effectors, Fork(0, 1, 2), frame_of(depth))
    assert first.score < -ParticleTrackerSettings().lost_cost


def test_shoulders_and_arms_are_measured_and_give_a_body_of_that_size(upper: UpperBody) -> None:
    pose = pose_of()
    breadth = shoulder_breadth(Cloud.from_depth(depth_of(upper, pose), CAMERA, LEVEL))
    shoulders = upper.body.joint_positions(pose)[[skeleton.REPORTED.index(f"{s}_shoulder") for s in ("left", "right")]]
    assert breadth == pytest.approx(np.linalg.norm(shoulders[0] - shoulders[1]), abs=0.08)
    assert sized_body([], []) is None
    small, large = sized_body([0.30], [0.5]), sized_body([0.42], [0.65])
    assert small is not None and large is not None
    assert small.height < load_body().height < large.height


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"count": 0}, "particles.count is 0"),
        ({"alpha": 1.5}, "particles.alpha is 1.5"),
        ({"alpha": -0.1}, "particles.alpha is -0.1"),
        ({"columns": 0}, "particles.columns is 0"),
    ],
)
def test_impossible_settings_are_named(values: dict[str, float], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        TypedReader(SettingsError).read(values, ParticleSettings, "particles")
