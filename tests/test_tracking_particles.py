"""Particle filter as a tracker, on drawn sequences of an upper body."""

from dataclasses import replace

import numpy as np
import pytest

from tests.poses import pose_at, upper_body_depth
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.kernels.fit import aiming
from toolkit.people.sighting import Sighting
from toolkit.sensing.camera import Camera
from toolkit.trackers.lopez2011.tracker import ParticleFollower, ParticleTracker, ParticleTrackerSettings
from toolkit.trackers.lopez2011.upper import UNSEEN, UpperBodies
from toolkit.tracking.clock import StageClock
from toolkit.tracks import EMPTY, LOST, TRACKED, FrameResult

LEVEL = np.diag([1.0, -1.0, -1.0])
CAMERA = Camera(142.8, 142.8, 79.5, 59.5, 160, 120)
UPPER = UpperBodies(LEVEL).of(load_body())
HANDS = [skeleton.REPORTED.index(f"{side}_hand") for side in ("left", "right")]
LEGS = [i for i, name in enumerate(skeleton.POSE_NAMES) if name.rpartition("_")[0] in skeleton.LEGS]
SETTINGS = ParticleTrackerSettings(measured_seconds=0.0)
"""Settings with a known body."""


def pose_of(turn: float = 0.0, **angles: float) -> np.ndarray:
    """Return a person 1.5 m away who faces the camera, both hands up; `turn` bends the elbows further."""
    elbows = {"left_elbow_ry": -0.7 - turn, "right_elbow_ry": 0.7 + turn}
    return pose_at((0.0, -0.5, -1.5), **{"left_shoulder_rz": -0.2, "right_shoulder_rz": 0.2} | elbows | angles)


def sighting_of(pose: np.ndarray, camera: Camera = CAMERA) -> Sighting:
    return Sighting(1, upper_body_depth(UPPER.body, pose, camera, LEVEL), None, camera)


def of_depth(depth: np.ndarray) -> Sighting:
    return Sighting(1, depth.astype(np.float32), None, CAMERA)


def follower(settings: ParticleTrackerSettings = SETTINGS, seed: int = 0) -> ParticleFollower:
    return ParticleTracker(replace(settings, seed=seed)).follower(CAMERA, LEVEL)


def step(person: ParticleFollower, sighting: Sighting | None, at: float) -> FrameResult:
    return person.step(sighting, at, StageClock(ParticleTracker.stage_names))


def followed(
    person: ParticleFollower, poses: list[np.ndarray], rate: float = 30.0, start: float = 0.0
) -> list[FrameResult]:
    return [step(person, sighting_of(pose), start + i / rate) for i, pose in enumerate(poses)]


def hands_off(result: FrameResult, pose: np.ndarray) -> float:
    truth = load_body().joint_positions(pose)[HANDS] @ LEVEL
    return float(np.linalg.norm(result.joints[HANDS] - truth, axis=1).max())


WAVING = [pose_of(0.5 * np.sin(0.2 * i)) for i in range(12)]


def test_a_person_is_found_and_tracked_and_unseen_legs_stay() -> None:
    results = followed(follower(), WAVING)
    assert [ParticleTracker.source_names[r.source] for r in results[:2]] == ["detected", "particles"]
    assert all(r.state == TRACKED for r in results)
    assert max(hands_off(r, pose) for r, pose in zip(results, WAVING, strict=True)) < 0.15
    for result in results:
        assert np.isfinite(result.joints).all() and (result.pose[LEGS] == 0.0).all()
        assert (result.confidence[UNSEEN] == 0.0).all() and result.confidence[0] > 0.0


def test_a_frame_without_people_is_empty() -> None:
    person = follower()
    results = [step(person, None, 0.0), step(person, of_depth(np.zeros(CAMERA.shape)), 0.1)]
    depth = np.zeros(CAMERA.shape)
    depth[60, 80] = 1.5
    results.append(step(person, of_depth(depth), 0.2))
    assert all(r.state == EMPTY and np.isfinite(r.joints).all() and not r.confidence.any() for r in results)


FOLDED = pose_of(left_shoulder_rz=-1.2, right_shoulder_rz=1.2, left_elbow_ry=-2.0, right_elbow_ry=2.0,
                 left_shoulder_rx=0.8, right_shoulder_rx=0.8)  # fmt: skip
BEHIND = pose_of(left_shoulder_rz=-1.3, right_shoulder_rz=1.3, left_shoulder_ry=0.9, right_shoulder_ry=-0.9)


CLASPED = pose_of(left_shoulder_ry=-1.0, right_shoulder_ry=1.0, left_elbow_ry=-1.2, right_elbow_ry=1.2)


def test_with_the_fork_alone_people_are_found_after_its_first_appearance() -> None:
    person = follower()
    waiting = followed(person, [CLASPED] * 2)
    assert all(r.state == LOST and np.isfinite(r.joints).all() for r in waiting)
    assert followed(person, [pose_of()] * 3, start=1.0)[-1].state == TRACKED


def turned_away() -> np.ndarray:
    back = pose_of()
    back[skeleton.POSE_NAMES.index("root_ry")] = np.pi
    return back


@pytest.mark.parametrize(
    "pose",
    [FOLDED, BEHIND, CLASPED, pose_of(right_shoulder_ry=-1.0, right_shoulder_rz=1.4), turned_away()],
    ids=["folded", "behind the back", "clasped", "one hand only", "back to the camera"],
)
def test_arms_that_are_hidden_are_inferred_or_the_frame_is_lost(pose: np.ndarray) -> None:
    for result in followed(follower(), [pose] * 2):
        assert result.state in (LOST, TRACKED) and np.isfinite(result.joints).all()


def test_a_hand_too_near_to_be_measured_does_not_lose_the_person() -> None:
    person = follower()
    followed(person, WAVING[:3])
    sighting = sighting_of(WAVING[3])
    hole = sighting.depth.copy()
    hole[:, 125:] = 0.0
    unobserved = np.zeros(CAMERA.shape, dtype=np.bool_)
    unobserved[:, 125:] = True
    result = step(person, Sighting(1, hole, unobserved, CAMERA), 0.1)
    assert result.state == TRACKED and hands_off(result, WAVING[3]) < 0.4


def test_a_hand_that_leaves_the_image_does_not_lose_the_person() -> None:
    left_of = Camera(CAMERA.fx, CAMERA.fy, 40.0, CAMERA.cy, 160, 120)
    outside = ParticleTracker(SETTINGS).follower(left_of, LEVEL)
    for i, pose in enumerate(WAVING[:6]):
        sighting = sighting_of(pose, left_of)
        assert sighting.depth[:, 0].any()
        result = step(outside, sighting, i / 30)
        assert np.isfinite(result.joints).all()
    assert result.state == TRACKED and trunk_off(result, pose) < 0.15


def test_a_hand_that_lies_on_a_desk_leaves_the_trunk_where_it_is() -> None:
    lying = reaching("left", CROWN + np.array([0.25, -0.62, 0.3]))
    desk = np.zeros(CAMERA.shape, dtype=np.bool_)
    desk[95:] = True
    person = follower()
    followed(person, WAVING[:3])
    for i in range(8):
        depth = np.where(desk, 0.0, sighting_of(lying).depth).astype(np.float32)
        result = step(person, Sighting(1, depth, desk, CAMERA), 0.1 + i / 30)
        assert result.state == TRACKED and trunk_off(result, lying) < 0.1
    assert hands_off(result, lying) < 0.25


def replace_place(pose: np.ndarray, x: float) -> np.ndarray:
    pose = pose.copy()
    pose[0] = x
    return pose


def trunk_off(result: FrameResult, pose: np.ndarray) -> float:
    """Return the mean distance of neck, head and shoulders from the truth, metres."""
    rows = [skeleton.REPORTED.index(name) for name in ("neck", "head", "left_shoulder", "right_shoulder")]
    truth = load_body().joint_positions(pose)[rows] @ LEVEL
    return float(np.linalg.norm(result.joints[rows] - truth, axis=1).mean())


def reaching(side: str, target: np.ndarray) -> np.ndarray:
    """Return a person with both hands up, one of them at `target` (3,), metres, level frame."""
    poses, scores = pose_of()[None].copy(), np.empty(1)
    arm = UPPER.arms[("left", "right").index(side)]
    anything = aiming.Aim(0.03, 0.0, -np.inf)
    aiming.aim_arms(poses, arm, np.ones(1, dtype=np.bool_), target[None], np.zeros(1), anything, scores)
    assert np.isfinite(scores).all()
    return poses[0]


CROWN = load_body().end_effector_positions(pose_of())[skeleton.END_EFFECTORS.index("head")]


def test_a_mirrored_recording_gives_the_mirrored_track_within_the_spread_over_seeds() -> None:
    one_up = [pose_of(0.4 * np.sin(0.2 * i), right_shoulder_rz=0.9) for i in range(8)]
    mirror = [pose_of(0.4 * np.sin(0.2 * i), left_shoulder_rz=-0.9) for i in range(8)]
    plain = np.array([followed(follower(seed=k), one_up)[-1].joints[HANDS] for k in range(3)])
    flipped = np.array([followed(follower(seed=k), mirror)[-1].joints[HANDS[::-1]] for k in range(3)])
    spread = max(plain.std(axis=0).max(), flipped.std(axis=0).max())
    assert np.abs(plain.mean(axis=0) - flipped.mean(axis=0) * [-1.0, 1.0, 1.0]).max() < 3.0 * spread + 0.03


def test_a_person_who_returns_elsewhere_is_detected_again() -> None:
    person = follower()
    followed(person, WAVING[:3])
    assert step(person, None, 0.1).state == EMPTY
    elsewhere = [replace_place(pose, 0.25) for pose in WAVING[:3]]
    results = followed(person, elsewhere, start=1.0)
    assert ParticleTracker.source_names[results[0].source] == "detected"
    assert hands_off(results[-1], elsewhere[-1]) < 0.25


def test_the_size_is_measured_from_the_first_frames() -> None:
    tracker = ParticleTracker()
    learner = tracker.learner(CAMERA, LEVEL)
    for i, pose in enumerate(WAVING):
        learner.observe(sighting_of(pose), i / 30)
    assert learner.body is not None and 1.5 < learner.body.height < 2.0
    learner = tracker.learner(CAMERA, LEVEL)
    learner.observe(of_depth(np.zeros(CAMERA.shape)), 0.0)
    assert learner.body is None and not learner.found
    for i, pose in enumerate(WAVING):
        assert list(learner.observe_parts(sighting_of(pose), i / 30)) == [None]
    assert learner.body is not None and learner.preview(sighting_of(WAVING[0]), 1.0) is None
    assert ParticleTracker(body=load_body("neutral")).learning_seconds == 0.0
