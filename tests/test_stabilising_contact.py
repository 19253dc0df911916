"""Foot contact of occluded legs: contact frames of templates, floor terms, points of a sole."""

from dataclasses import replace

import numpy as np
import pytest

from tests.inertial_scenes import write_run
from tests.test_stabilising_priors import BODY
from toolkit.app.stabilise.floor_contact import contact_columns, contact_frames, floor_term
from toolkit.body import skeleton
from toolkit.body.sole import FEET, Sole
from toolkit.fitting.placed import NormalSystem
from toolkit.fitting.priors import ResidualTerm
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.priors.allocation import Allocation
from toolkit.retrieval.priors.limb_entries import ENTRIES
from toolkit.retrieval.templates import WILDCARD, QuantisedTemplate
from toolkit.tracks import RunInfo

STANDING = np.zeros(skeleton.POSE_SIZE)


def system_of(term: ResidualTerm, pose: np.ndarray) -> NormalSystem:
    system = NormalSystem()
    system.matrix[:], system.vector[:] = 0.0, 0.0
    term.add(system, pose)
    return system


def template(values: np.ndarray) -> QuantisedTemplate:
    return QuantisedTemplate(values.astype(np.int8), np.ones(values.shape[1]))


def test_a_foot_is_at_rest_in_long_runs_of_both_features() -> None:
    values = np.full((40, 12), WILDCARD)
    values[16, 1:9], values[24, 2:12] = 0, 0
    np.testing.assert_array_equal(np.flatnonzero(contact_columns(template(values), "right_leg")), np.arange(2, 9))
    values[16, 4] = 1  # runs of three and four columns are too short
    assert not contact_columns(template(values), "right_leg").any()
    assert not contact_columns(template(values), "left_leg").any()


def test_contact_follows_the_alignment_of_frames_with_columns() -> None:
    values = np.full((40, 6), WILDCARD)
    values[16, 1:], values[24] = 0, 0
    classes = [MotionClass("bend", template(values)), MotionClass("spread", template(np.full((40, 6), WILDCARD)))]
    allocation = replace(Allocation.nothing(8), label=np.array([-1, 0, 0, 0, 0, 0, 1, -1]),
                         column=np.array([-1, 0, 1, 2, 2, 4, 5, -1]))  # fmt: skip
    contact = contact_frames(allocation, classes, "right_leg")
    np.testing.assert_array_equal(np.flatnonzero(contact), [2, 3, 4, 5])
    assert not contact_frames(allocation, classes, "left_leg").any()


def descended(term: ResidualTerm, pose: np.ndarray) -> np.ndarray:
    """Return the pose after damped steps on this term alone."""
    pose = pose.copy()
    for _ in range(60):
        system = system_of(term, pose)
        own = np.ix_(term.entries, term.entries)
        pose[term.entries] -= np.linalg.solve(
            system.matrix[own] + 0.01 * np.eye(len(term.entries)), system.vector[term.entries]
        )
    return pose


@pytest.mark.parametrize("leg", FEET)
@pytest.mark.parametrize("known", (False, True))
def test_a_foot_that_rests_is_pulled_to_the_floor_and_to_its_place(leg, known):
    sole, floor = Sole.of(BODY, leg), float(BODY.vertices[:, 1].min())
    standing = sole.at(BODY, STANDING)
    np.testing.assert_allclose(standing[:, 1], floor, atol=0.02)
    floating = STANDING.copy()
    floating[ENTRIES[leg][0]], floating[ENTRIES[leg][3]] = -0.5, 0.6  # hip and knee bent
    term = floor_term(BODY, leg, floor, standing if known else None)
    system = system_of(term, floating)
    steps = 1e-6 * np.eye(skeleton.POSE_SIZE)
    numeric = [(term.energy(floating + step) - term.energy(floating - step)) / 2e-6 for step in steps[ENTRIES[leg]]]
    np.testing.assert_allclose(system.vector[ENTRIES[leg]], numeric, atol=2e-5)
    after = sole.at(BODY, descended(term, floating))
    np.testing.assert_allclose(after[:, 1], standing[:, 1], atol=0.02)
    if known:
        np.testing.assert_allclose(after, standing, atol=0.03)


@pytest.mark.parametrize("leg", list(FEET))
def test_heel_and_ball_lie_on_the_floor_behind_and_before_the_ankle(leg: str) -> None:
    sole = Sole.of(BODY, leg)
    ankle = BODY.joints[sole.joint]
    heel, ball = sole.points
    assert heel[2] < -0.03 and ball[2] > 0.08 and abs(heel[0]) < 1e-9
    np.testing.assert_allclose(sole.points[:, 1] + ankle[1], BODY.vertices[:, 1].min(), atol=0.005)


def test_a_resting_sole_is_held_along_the_ground_and_to_its_floor() -> None:
    sole = Sole.of(BODY, "left_leg")
    term = floor_term(BODY, "left_leg", -0.9, sole.at(BODY, STANDING))
    moved = STANDING.copy()
    moved[skeleton.ROOT_POSITION] = (0.1, 0.2, 0.3)
    np.testing.assert_allclose(term.residuals(moved) - term.residuals(STANDING), [0.2, 0.2, 0.1, 0.3, 0.1, 0.3])


def test_a_floor_is_kept_in_the_run(tmp_path):
    run = write_run(tmp_path / "run", np.zeros((3, skeleton.POSE_SIZE)))
    replace(RunInfo.load(run), floor=[0.9]).save(run)
    assert RunInfo.load(run).floor == [0.9]
