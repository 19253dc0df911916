"""Balls of a body, and arms moved to estimated joints."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.fitting_helpers import Fit
from tests.test_fitting import CAMERA, HORIZONTAL, SETTINGS, joint_error, scene_of, standing
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.placed import balls_of
from toolkit.fitting.refiner import Refiner
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.tracking.search.arm_search import ArmSettings, NetworkArms
from toolkit.tracking.search.search_protocol import Hypothesis, ScoredHypothesis

ARM = skeleton.ARM_ENTRIES[0]


@pytest.fixture(scope="module")
def body() -> Body:
    return load_body("neutral")


@pytest.fixture(scope="module")
def fit(body: Body) -> Fit:
    return Fit(body, CAMERA, HORIZONTAL, SETTINGS)


# Balls


def test_balls_lie_within_the_body(body: Body) -> None:
    balls = balls_of(body)
    centres = body.joints[balls.joint] + balls.offset
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    assert ((centres > low - 0.02) & (centres < high + 0.02)).all()
    assert ((balls.radius > 0.02) & (balls.radius < 0.2)).all()
    radius = {skeleton.JOINT_NAMES[j]: r for j, r in zip(balls.joint, balls.radius, strict=True)}
    assert radius["left_elbow"] < radius["left_hip"] < radius["lumbar"]
    assert radius["left_elbow"] == pytest.approx(radius["right_elbow"], rel=0.1)


def test_an_arm_in_the_trunk_is_pushed_out(body: Body) -> None:
    def overlap(pose: np.ndarray) -> float:
        placed, balls = soft.placer.place(body, pose), balls_of(body)
        centres = placed.origins[balls.joint] + np.einsum("bij,bj->bi", placed.rotations[balls.joint], balls.offset)
        first, second = balls.apart.T
        gap = np.linalg.norm(centres[first] - centres[second], axis=1) - 0.8 * (
            balls.radius[first] + balls.radius[second]
        )
        return float(-np.minimum(gap, 0.0).sum())

    soft, hard = (Fit(body, CAMERA, HORIZONTAL, FittingSettings(contact_weight=w)) for w in (0.0, 50.0))
    candidates = np.repeat(standing()[None], 200, axis=0)
    candidates[:, ARM] = np.random.default_rng(0).uniform(*skeleton.POSE_LIMITS[ARM].T, (200, len(ARM)))
    inside = max(candidates, key=overlap)
    scene = scene_of(body, inside)
    assert overlap(inside) > 0.05
    assert overlap(hard.refine(inside, scene)) < 0.5 * overlap(soft.refine(inside, scene))


# The search


def test_an_arm_in_the_wrong_place_is_moved_to_its_estimated_joints(body: Body, fit: Fit) -> None:
    truth = standing(left_shoulder_rz=0.9, left_elbow_ry=-1.2)
    scene = scene_of(body, truth)
    wrong = fit.refine(standing(left_shoulder_rz=-1.4, left_shoulder_ry=0.6, left_elbow_ry=-0.2), scene)
    assert joint_error(body, wrong, truth) > 0.06
    first, given = fit.compare(wrong, scene), wrong.copy()
    off = np.random.default_rng(0).normal(0.0, 0.03, (20, 3))  # metres: error of the network
    seen = JointEstimate(body.joint_positions(truth) + off, np.full(20, 0.5))
    kinematics = Refiner(fit.placer, SETTINGS, fit.refiner.pose_terms, terms=())
    arms = NetworkArms(fit.objective, fit.refiner, kinematics, ArmSettings())
    best = ScoredHypothesis.of(Hypothesis("local", wrong), body, first, redetected=False)
    observation = SimpleNamespace(scene=scene, estimate=seen, cloud=SimpleNamespace(rotation=HORIZONTAL))
    found = arms.better(best, observation)
    assert found is not None and found.comparison is not None
    assert joint_error(body, found.pose, truth) < 0.5 * joint_error(body, wrong, truth)
    assert found.comparison.sample_gaps.mean() < first.sample_gaps.mean()
    assert (wrong == given).all() and (wrong[ARM] != found.pose[ARM]).any()
