"""Confidence of joints: inputs of the regressions, their tables, and the distance between both passes."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from tests.fitting_helpers import Fit, whole_image
from tests.poses import pose_at
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.joint_confidence import (
    FEATURES,
    GROUPS,
    WITHOUT_NETWORK,
    JointConfidence,
    group_of,
    joint_confidence,
    joint_features,
    network_features,
)
from toolkit.fitting.scene import Scene
from toolkit.kernels.learning import joint_crop
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.cloud import Cloud

BODY = load_body("neutral")
CAMERA = Camera(100.0, 100.0, 39.5, 49.5, 80, 100)
LEVEL = level_rotation(np.array([0.0, -1.0, 0.0]))
LEFT, RIGHT = (skeleton.REPORTED.index(f"{side}_wrist") for side in ("left", "right"))


standing = partial(pose_at, (0.0, 0.0, -2.5))


def test_the_kernel_of_the_regressions_equals_numpy_and_ignores_further_features() -> None:
    rng = np.random.default_rng(0)
    table, features, found = rng.normal(size=(20, 5)), rng.normal(size=(20, 6)), np.empty(20)
    joint_crop.probabilities(table, features, found)
    odds = table[:, 0] + (table[:, 1:] * features[:, :4]).sum(axis=1)
    np.testing.assert_allclose(found, 1.0 / (1.0 + np.exp(-odds)), rtol=1e-12)
    joint_crop.probabilities(1e3 * table, features, found)
    assert (np.minimum(found, 1.0 - found) > 0.0).all(), "never certain"


@pytest.fixture(scope="module")
def fit() -> Fit:
    return Fit(BODY, CAMERA, LEVEL, FittingSettings())


def features_of(fit: Fit, pose: np.ndarray, shown: np.ndarray, **inputs: Any) -> dict[str, np.ndarray]:
    """Return the inputs of a pose in a frame that shows another pose, by name."""
    depth = whole_image(fit.placer.place(BODY, shown))[0].astype(np.float32)
    scene = Scene(Cloud.from_depth(depth, CAMERA, LEVEL), np.zeros((0, 3)), 400)
    joints = BODY.joint_positions(pose)
    values = joint_features(fit.compare(pose, scene), joints, inputs.pop("spread", np.zeros(20)), **inputs)
    return dict(zip(FEATURES, values.T, strict=True))


def constant(**rows: list[float]) -> JointConfidence:
    """Return regressions with the same coefficients for all groups."""
    return JointConfidence({name: dict.fromkeys(GROUPS, row) for name, row in rows.items()})


def test_each_joint_has_one_group() -> None:
    assert {group_of(joint) for joint in skeleton.REPORTED} == set(GROUPS)


def test_a_limb_that_is_not_covered_is_an_input_of_the_joints_in_reach(fit: Fit) -> None:
    right = features_of(fit, standing(), standing())
    wrong = features_of(fit, standing(left_shoulder_rz=-1.2), standing())
    assert right["uncovered"].max() < 0.05
    assert wrong["uncovered"][LEFT] > 0.3 > 0.1 > wrong["uncovered"][RIGHT]
    assert wrong["surface"][0] > right["surface"][0]
    assert wrong["support"][LEFT] < right["support"][LEFT]


def test_the_network_and_the_prior_are_inputs(fit: Fit) -> None:
    joints = BODY.joint_positions(standing())
    assert np.isnan(features_of(fit, standing(), standing())["estimate"]).all()
    moved, spread = joints.copy(), np.zeros(20)
    moved[LEFT] += (0.0, 0.1, 0.0)
    spread[RIGHT] = 0.1
    network = network_features(joints, JointEstimate(moved, np.full(20, 0.25)))
    found = features_of(fit, standing(), standing(), spread=spread, network=network)
    assert found["estimate"][[LEFT, RIGHT]] == pytest.approx([0.5, 0.0])
    assert found["precision"] == pytest.approx(0.5)
    assert found["spread"][[LEFT, RIGHT]] == pytest.approx([0.0, 0.5])


def test_the_odds_are_a_sum_and_without_a_network_another_table_is_used() -> None:
    depth = [0.5, *np.linspace(-1.0, 1.0, WITHOUT_NETWORK)]
    network = [1.0, *np.linspace(1.0, -1.0, len(FEATURES))]
    regressions = constant(network=network, depth=depth, passes=[0.0, 1.0, 0.0])
    values = np.random.default_rng(1).random((20, len(FEATURES)))
    odds = 1.0 + values @ network[1:]
    assert regressions.of(values) == pytest.approx(1.0 / (1.0 + np.exp(-odds)))
    values[:, WITHOUT_NETWORK:] = np.nan
    odds = 0.5 + values[:, :WITHOUT_NETWORK] @ depth[1:]
    assert regressions.of(values) == pytest.approx(1.0 / (1.0 + np.exp(-odds)))


def test_another_trajectory_lowers_the_odds_by_its_distance() -> None:
    regressions = constant(network=[0.0] * 9, depth=[0.0] * 7, passes=[0.5, 1.0, -2.0])
    confidence, apart = np.full(20, 0.8, np.float32), np.linspace(0.0, 0.4, 20)
    odds = 0.5 + np.log(0.8 / 0.2) - 2.0 * apart / (apart + 0.1)
    assert regressions.of_both(confidence, apart) == pytest.approx(1.0 / (1.0 + np.exp(-odds)), abs=1e-6)
    sure = regressions.of_both(np.array([0.0, 1.0] * 10, np.float32), apart)
    assert np.isfinite(sure).all()


def test_with_the_package_regressions_what_speaks_against_a_joint_makes_it_less_sure(fit: Fit) -> None:
    names = dict(zip(FEATURES, range(len(FEATURES)), strict=True))
    usual = np.full((20, len(FEATURES)), 0.0)
    usual[:, [names["surface"], names["support"], names["observed"], names["precision"]]] = 0.5, 1.0, 1.0, 0.7
    usual[:, names["estimate"]] = 0.2
    regressions = joint_confidence()
    sure = regressions.of(usual)
    assert sure[[LEFT, RIGHT]].min() > 0.8
    for name, value in (("precision", 0.2), ("surface", 0.7), ("support", 0.3), ("estimate", 0.8), ("energy", 0.8)):
        doubtful = usual.copy()
        doubtful[:, names[name]] = value
        assert (regressions.of(doubtful)[[LEFT, RIGHT]] < sure[[LEFT, RIGHT]]).all(), name
    assert (regressions.of(usual + 0.4 * np.eye(len(FEATURES))[names["uncovered"]]) <= sure).all()
    apart = regressions.of_both(sure, np.full(20, 0.3))
    assert (1.0 - apart > 3.0 * (1.0 - sure))[[LEFT, RIGHT]].all()
