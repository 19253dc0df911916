"""First frames: arms moved to the joints of the network, both headings, refined alike."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fitting_helpers import Fit
from tests.poses import pose_at, upper_body_depth
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.database.canonical import body_facing
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.refiner import Refiner
from toolkit.io.parts import whole
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud
from toolkit.trackers.hybrid.initial_pose import (
    InitialPoseVerifier,
    best_of_each_body,
    facing_elsewhere,
    other_ways_round,
)
from toolkit.tracking.observation import Observation, Observer
from toolkit.tracking.search.arm_search import ArmSettings, NetworkArms
from toolkit.tracking.search.search_protocol import Hypothesis, ScoredHypothesis
from toolkit.tracking.state import PersonState

LEVEL = np.diag([1.0, -1.0, -1.0])
CAMERA = Camera(142.8, 142.8, 79.5, 59.5, 160, 120)
BODY = load_body()
FIT = Fit(BODY, CAMERA, LEVEL, FittingSettings())
KINEMATICS = Refiner(FIT.placer, FittingSettings(), FIT.refiner.pose_terms, terms=())
ARMS = NetworkArms(FIT.objective, FIT.refiner, KINEMATICS, ArmSettings())
HAND = skeleton.REPORTED.index("left_hand")


def pose_of(**angles: float) -> np.ndarray:
    return pose_at((0.0, -0.45, -1.5), **{"left_shoulder_rz": -1.1, "right_shoulder_rz": 1.1} | angles)


RAISED = pose_of(left_shoulder_rz=0.5, left_elbow_ry=-0.5)
FORWARD = pose_of(left_elbow_ry=-1.6, right_elbow_ry=1.6, left_shoulder_rz=-0.9, right_shoulder_rz=0.9)


def observed(pose: np.ndarray) -> Observation:
    """Return a frame of a person in a pose, without legs."""
    depth = upper_body_depth(BODY, pose, CAMERA, LEVEL)
    observer = Observer(LandmarkSettings(smallest_component=5), 20, 400, None)
    state = PersonState.begin(BODY, sized=True, seed=0)
    return Observation(observer, Cloud.from_depth(depth, CAMERA, LEVEL), 0.0, state)


def rival(pose: np.ndarray, observation: Observation) -> ScoredHypothesis:
    return ScoredHypothesis.of(Hypothesis("joints", pose), BODY, FIT.compare(pose, observation.scene), redetected=True)


def hand_off(pose: np.ndarray) -> float:
    return float(np.linalg.norm((BODY.joint_positions(pose) - BODY.joint_positions(RAISED))[HAND]))


def test_a_hanging_arm_is_brought_to_a_raised_hand() -> None:
    observation = observed(RAISED)
    observation.estimate = JointEstimate(BODY.joint_positions(RAISED), np.full(20, 0.5))
    (found, *_) = finished(observation, rival(pose_of(), observation))
    assert found.hypothesis.source == "arms"
    assert hand_off(pose_of()) > 0.5 and hand_off(found.hypothesis.pose) < 0.12


def test_without_an_estimate_the_pose_stays() -> None:
    observation = observed(RAISED)
    hanging = rival(pose_of(), observation)
    assert finished(observation, hanging) == [hanging]


@settings(max_examples=25, deadline=None)
@given(yaw=st.floats(-3.0, 3.0), lean=st.floats(-0.5, 0.5), elbow=st.floats(0.0, 2.0))
def test_the_other_way_round_is_half_a_turn_in_the_same_place_and_again_the_pose_itself(
    yaw: float, lean: float, elbow: float
) -> None:
    pose = pose_of(root_ry=yaw, lumbar_rx=lean, left_elbow_ry=-elbow)
    for turned, way in zip(other_ways_round(pose), (0, 1), strict=True):
        turn = np.angle(np.exp(1j * (body_facing(turned) - body_facing(pose))))
        assert abs(turn) == pytest.approx(np.pi, abs=1e-6)
        assert turned[:3] == pytest.approx(pose[:3])
        assert BODY.joint_positions(other_ways_round(turned)[way]) == pytest.approx(
            BODY.joint_positions(pose), abs=1e-6
        )


def test_the_nearest_of_every_body_and_the_nearest_that_faces_elsewhere_are_finished() -> None:
    observation = observed(FORWARD)
    rivals = [rival(pose_of(root_ry=yaw), observation) for yaw in (0.0, 0.4, np.pi, 1.6)]
    child = replace(rivals[1], body=load_body("child"))
    best = min(rivals, key=lambda one: one.comparison.distance)
    assert {id(one) for one in best_of_each_body([*rivals, child])} == {id(best), id(child)}
    (elsewhere,) = facing_elsewhere(rivals[0], rivals)
    assert elsewhere is min(rivals[2:], key=lambda one: one.comparison.distance)
    assert facing_elsewhere(rivals[0], rivals[:2]) == []


def finished(observation: Observation, rival: ScoredHypothesis) -> list[ScoredHypothesis]:
    return whole(InitialPoseVerifier(FIT.objective, FIT.refiner, ARMS).verified(observation, [rival]))


def test_who_was_taken_back_to_front_is_turned_round_where_joints_were_estimated() -> None:
    observation = observed(FORWARD)
    wrong = rival(other_ways_round(FORWARD)[1], observation)
    assert not any(abs(float(body_facing(one.hypothesis.pose))) < 1.0 for one in finished(observation, wrong))
    observation.estimate = JointEstimate(np.zeros((20, 3)), np.zeros(20))
    found = finished(observation, wrong)
    best = min([wrong, *found], key=lambda one: one.comparison.distance)
    assert abs(float(body_facing(best.hypothesis.pose))) < 0.3
    assert abs(float(body_facing(wrong.hypothesis.pose))) > 3.0


def test_a_correct_heading_is_not_turned() -> None:
    observation = observed(FORWARD)
    observation.estimate = JointEstimate(np.zeros((20, 3)), np.zeros(20))
    right = rival(FORWARD, observation)
    found = finished(observation, right)
    best = min([right, *found], key=lambda one: one.comparison.distance)
    assert abs(float(body_facing(best.hypothesis.pose))) < 0.1
