"""Hands brought to where the cloud ends, as a search of the hybrid tracker."""

from __future__ import annotations

import numpy as np

from tests.fitting_helpers import Fit
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.fitting.arms import ArmSettings
from toolkit.fitting.settings import FittingSettings
from toolkit.fitting.upper import UpperBodies
from toolkit.kernels import particles as kernel
from toolkit.landmarks.settings import LandmarkSettings
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud
from toolkit.tracking.observation import Observation, Observer
from toolkit.tracking.search.particles import ParticleSearch
from toolkit.tracking.search.protocol import Hypothesis, Proposal, Rival
from toolkit.tracking.state import PersonState, Previous

LEVEL = np.diag([1.0, -1.0, -1.0])
CAMERA = Camera(142.8, 142.8, 79.5, 59.5, 160, 120)
BODY = load_body()
FIT = Fit(BODY, CAMERA, LEVEL, FittingSettings())
HAND = skeleton.REPORTED.index("left_hand")


def pose_of(**angles: float) -> np.ndarray:
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[:3] = [0.0, -0.45, -1.5]
    for name, value in ({"left_shoulder_rz": -1.1, "right_shoulder_rz": 1.1} | angles).items():
        pose[skeleton.POSE_NAMES.index(name)] = value
    return pose


RAISED = pose_of(left_shoulder_rz=0.5, left_elbow_ry=-0.5)


def observed(pose: np.ndarray) -> Observation:
    """A frame of somebody in a pose, without legs."""
    depth = np.empty(CAMERA.shape)
    kernel.draw(pose, UpperBodies(LEVEL).of(BODY).whole, np.array(CAMERA.intrinsics), depth)
    observer = Observer(LandmarkSettings(smallest_component=5), 20, 400, "pixels", None, 0)
    state = PersonState.begin(BODY, sized=True, seed=0)
    return Observation(observer, Cloud.from_depth(depth.astype(np.float32), CAMERA, LEVEL), 0.0, state)


def asked(truth: np.ndarray, best: np.ndarray | None, *, first: bool, body: Body = BODY) -> Proposal:
    """What the search says of a frame of `truth` where `best` is the best pose so far."""
    search, observation = ParticleSearch(FIT.objective, FIT.refiner, ArmSettings(), LEVEL), observed(truth)
    state = PersonState(
        body, True, observation.state.generator, previous=None if first else Previous.of_pose(BODY, pose_of())
    )
    rival = None if best is None else Rival(Hypothesis("local", best), BODY, FIT.compare(best, observation.scene))
    return search.propose(observation, state, np.random.default_rng(0), rival)


def hand_off(pose: np.ndarray) -> float:
    return float(np.linalg.norm((BODY.joint_positions(pose) - BODY.joint_positions(RAISED))[HAND]))


def test_a_hanging_arm_is_brought_to_a_raised_hand_on_a_first_frame() -> None:
    found = asked(RAISED, pose_of(), first=True).hypotheses[-1]
    assert found.source == "particles"
    assert hand_off(pose_of()) > 0.5 and hand_off(found.pose) < 0.12


def test_while_somebody_is_followed_it_says_nothing() -> None:
    assert asked(RAISED, pose_of(), first=False).hypotheses == ()


def test_a_hypothesis_of_another_size_is_left_alone() -> None:
    proposal = asked(RAISED, pose_of(), first=True, body=load_body("child"))
    assert not any(hypothesis.supersedes for hypothesis in proposal.hypotheses)


def test_on_a_first_frame_a_fork_gives_a_pose_of_its_own() -> None:
    both = pose_of(left_shoulder_rz=0.2, right_shoulder_rz=-0.2, left_elbow_ry=-0.8, right_elbow_ry=0.8)
    found = asked(both, None, first=True).hypotheses[-1].pose
    off = (BODY.joint_positions(found) - BODY.joint_positions(both))[[HAND, skeleton.REPORTED.index("right_hand")]]
    assert np.linalg.norm(off, axis=1).max() < 0.12
