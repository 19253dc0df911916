"""Joints seen in the image as evidence."""

import math

import numpy as np
import pytest

from tests.placed_bodies import normal, pose
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.fitting.joint_evidence import CAP, PULL, RAY_TOLERANCE, SightedJoints
from toolkit.fitting.placed import PlacedBody, Placer
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.joints2d import MIN_JOINT_CONFIDENCE, Joints2D

BODY = load_body("neutral")
LEVEL = level_rotation(np.array([0.1, -0.9, -0.3]))
CAMERA = Camera(100.0, 110.0, 39.5, 49.5, 80, 100)
PLACER = Placer(BODY, CAMERA, LEVEL)
HAND = skeleton.REPORTED.index("left_hand")
DERIVED = ("pelvis", "spine", "neck")


def placed(**angles: float) -> PlacedBody:
    return PLACER.place(BODY, pose(**angles))


def joints(**angles: float) -> np.ndarray:
    """Return the joints in a pose, (20, 3), camera frame."""
    return BODY.joint_positions(pose(**angles)) @ LEVEL


def seen(points: np.ndarray, confidence: np.ndarray | float = 1.0) -> Joints2D:
    """Return the pixels of points (20, 3)."""
    pixels = CAMERA.project(points).astype(np.float32)
    return Joints2D(pixels, np.full(20, confidence, dtype=np.float32) * np.ones(20, dtype=np.float32))


def only(chosen: list[int], confidence: float = 1.0) -> np.ndarray:
    """Return confidence (20,) in some joints only."""
    return np.where(np.isin(np.arange(20), chosen), confidence, 0.0)


def plain_cost(points: np.ndarray, sighted: Joints2D) -> float:
    """Return the cost of joints (20, 3), joint by joint, by the angle between ray and joint; the better of both
    sides.
    """
    costs = []
    for side in (range(20), skeleton.OTHER_SIDE):
        total = weights = 0.0
        for joint, other in enumerate(side):
            weight = float(sighted.confidence[other])
            if weight < MIN_JOINT_CONFIDENCE or skeleton.REPORTED[joint] in DERIVED:
                continue
            u, v = sighted.pixels[other].astype(np.float64)
            ray = np.array([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, 1.0])
            cosine = ray @ points[joint] / np.linalg.norm(ray) / np.linalg.norm(points[joint])
            away = np.linalg.norm(points[joint]) * math.sin(math.acos(min(cosine, 1.0)))
            total += weight * min(max(away - RAY_TOLERANCE, 0.0), CAP)
            weights += weight
        costs.append(total / weights if weights else 0.0)
    return min(costs)


def test_a_pose_costs_what_its_joints_are_beside_their_rays_joint_by_joint() -> None:
    rng = np.random.default_rng(3)
    sighted = seen(joints() + rng.normal(0.0, 0.1, (20, 3)), rng.uniform(0.0, 1.0, 20))
    for angle in (0.0, 0.5, 1.0):
        body, points = placed(left_shoulder_rz=angle), joints(left_shoulder_rz=angle)
        assert SightedJoints(sighted, CAMERA).cost(body) == pytest.approx(plain_cost(points, sighted), abs=1e-6)
    assert SightedJoints(sighted, CAMERA).cost(placed()) > 0.01


@pytest.mark.parametrize("confidence", [0.0, MIN_JOINT_CONFIDENCE - 0.01])
def test_an_uncertain_detection_has_no_weight(confidence: float) -> None:
    evidence = SightedJoints(seen(joints() + [0.3, 0.0, 0.0], confidence), CAMERA)
    assert evidence.cost(placed()) == 0.0
    assert not normal(evidence, placed()).vector.any()


def test_a_detector_that_took_the_back_for_the_front_costs_nothing() -> None:
    raised = {"left_shoulder_rz": 0.8, "left_hip_rx": 0.4}
    sighted = seen(joints(**raised)[list(skeleton.OTHER_SIDE)])
    assert SightedJoints(sighted, CAMERA).cost(placed(**raised)) == pytest.approx(0.0, abs=1e-9)
    assert not normal(SightedJoints(sighted, CAMERA), placed(**raised)).vector.any()
    assert SightedJoints(sighted, CAMERA).cost(placed()) > 0.005


def test_the_pull_of_a_joint_is_the_gradient_of_its_cost() -> None:
    """Near 5 cm the Geman-McClure weight is 1: half the squared excess distance."""
    points = joints() + [0.035, 0.045, 0.0]
    chosen = [HAND, skeleton.REPORTED.index("head")]
    evidence, step = SightedJoints(seen(points, only(chosen, 0.7)), CAMERA), 1e-5
    alone = [SightedJoints(seen(points, only([joint], 0.7)), CAMERA) for joint in chosen]
    vector = normal(evidence, placed()).vector

    def energy(**entries: float) -> float:
        return sum(0.5 * PULL * 0.7 * each.cost(placed(**entries)) ** 2 for each in alone)

    for name in ("root_tx", "root_ty", "root_tz", "root_rz", "left_shoulder_rz"):
        slope = (energy(**{name: step}) - energy(**{name: -step})) / (2 * step)
        assert vector[skeleton.POSE_NAMES.index(name)] == pytest.approx(slope, rel=0.03, abs=1e-4)
    assert np.linalg.norm(vector) > 0.01
