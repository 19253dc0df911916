"""Joints of which the network is certain, as evidence."""

import numpy as np
import pytest

from tests.placed_bodies import normal, pose
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.fitting.joint_evidence import CAP, OUT_OF_VIEW, EstimatedJoints, links_out_of_view
from toolkit.fitting.placed import PlacedBody, Placer
from toolkit.landmarks.joint_network import RELIABLE_WITHIN, JointEstimate
from toolkit.sensing.camera import Camera, level_rotation

BODY = load_body("neutral")
LEVEL = level_rotation(np.array([0.1, -0.9, -0.3]))
PLACER = Placer(BODY, Camera(100.0, 100.0, 39.5, 49.5, 80, 100), LEVEL)
HEAD, HAND = skeleton.REPORTED.index("head"), skeleton.REPORTED.index("left_hand")


def placed(**angles: float) -> PlacedBody:
    return PLACER.place(BODY, pose(**angles))


def estimate(shift: dict[int, np.ndarray], reliability: float = 1.0) -> JointEstimate:
    """Return estimates of the joints of the standing body, some of them shifted, the others uncertain."""
    points = BODY.joint_positions(pose())
    sure = np.zeros(20)
    for joint, by in shift.items():
        points[joint] += by
        sure[joint] = reliability
    return JointEstimate(points, sure, np.ones(20), sure)


def test_within_ten_centimetres_an_estimate_has_no_pull() -> None:
    evidence = EstimatedJoints(estimate({HEAD: np.array([0.0, 0.9 * RELIABLE_WITHIN, 0.0])}), LEVEL, 30.0)
    assert evidence.cost(placed()) == 0.0
    assert not normal(evidence, placed()).vector.any()


def test_a_pose_costs_what_its_sure_joints_are_too_far_on_average() -> None:
    shifts = {HEAD: np.array([0.0, 0.15, 0.0]), HAND: np.array([2.0, 0.0, 0.0])}
    assert EstimatedJoints(estimate(shifts), LEVEL, 1.0).cost(placed()) == pytest.approx(
        (0.15 - RELIABLE_WITHIN + CAP) / 2
    )


def test_the_pull_of_an_estimate_is_the_gradient_of_its_cost() -> None:
    """Near 10 cm the Geman-McClure weight is 1: half the squared excess distance."""
    evidence = EstimatedJoints(estimate({HAND: np.array([0.02, 0.11, -0.03])}), LEVEL, 4.0)
    vector, step = normal(evidence, placed()).vector, 1e-5

    def energy(**entries: float) -> float:
        return 0.5 * 4.0 * evidence.cost(placed(**entries)) ** 2

    for name in ("root_tx", "root_ty", "root_tz", "root_rz", "left_shoulder_rz"):
        slope = (energy(**{name: step}) - energy(**{name: -step})) / (2 * step)
        assert vector[skeleton.POSE_NAMES.index(name)] == pytest.approx(slope, rel=0.02, abs=1e-4)
    assert np.linalg.norm(vector) > 0.01


@pytest.mark.parametrize(
    ("ends", "links"),
    [
        ((), set()),
        (("foot",), {"ankle"}),
        (("ankle", "foot"), {"knee", "ankle"}),
        (("knee", "ankle", "foot"), {"hip", "knee", "ankle"}),
        (("knee", "ankle"), set()),
        (("hand",), {"wrist"}),
    ],
)
def test_a_link_is_out_of_view_where_all_that_it_and_those_below_it_end_in_is(
    ends: tuple[str, ...], links: set[str]
) -> None:
    in_view = np.ones(20)
    in_view[[skeleton.REPORTED.index(f"left_{end}") for end in ends]] = OUT_OF_VIEW - 0.01
    hidden = links_out_of_view(in_view)
    found = {name for name, out in zip(skeleton.JOINT_NAMES, hidden, strict=True) if out}
    assert found == {f"left_{link}" for link in links}
