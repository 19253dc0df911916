"""MT priors: what is marked in templates, what it says of a track, and the terms that hold limbs to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.test_stabilising_priors import BODY, classes_of
from toolkit.app.stabilise.demands import Demands, floor_term
from toolkit.body import skeleton
from toolkit.body.sole import FEET, Sole
from toolkit.fitting.placed import NormalSystem
from toolkit.fitting.priors import ResidualTerm
from toolkit.io.errors import RetrievalError
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.features.motion import from_poses
from toolkit.retrieval.features.relational import FEATURES, native_features
from toolkit.retrieval.priors.allocation import Allocation
from toolkit.retrieval.priors.limb_entries import ENTRIES, LIMBS_OF_FEATURE
from toolkit.retrieval.priors.marks import (
    DEMANDED,
    load_marks,
    marks_of_classes,
    rests,
    tracking_priors,
)
from toolkit.retrieval.templates import WILDCARD, QuantisedTemplate

STANDING = np.zeros(skeleton.POSE_SIZE)


def some_pose(seed: int) -> np.ndarray:
    low, high = (np.clip(side, -2.4, 2.4) * (0.1, 0.4, 0.9)[seed % 3] for side in skeleton.POSE_LIMITS.T)
    return np.random.default_rng(seed).uniform(low, high)


def system_of(term: ResidualTerm, pose: np.ndarray) -> NormalSystem:
    system = NormalSystem()
    system.matrix[:], system.vector[:] = 0.0, 0.0
    term.add(system, pose)
    return system


def demanded(number: int, value: int) -> np.ndarray:
    priors = np.full(len(FEATURES), WILDCARD, dtype=np.int8)
    priors[number - 1] = value
    return priors


def template(values: np.ndarray) -> QuantisedTemplate:
    return QuantisedTemplate(values.astype(np.int8), np.ones(values.shape[1]))


def descended(term: ResidualTerm, pose: np.ndarray) -> np.ndarray:
    """The pose after damped steps on this term alone."""
    pose = pose.copy()
    for _ in range(60):
        system = system_of(term, pose)
        own = np.ix_(term.entries, term.entries)
        pose[term.entries] -= np.linalg.solve(
            system.matrix[own] + 0.01 * np.eye(len(term.entries)), system.vector[term.entries]
        )
    return pose


def test_marks_go_to_the_frames_that_were_aligned_with_their_columns():
    values = np.full((40, 6), WILDCARD)
    values[6, 1:6], values[16], values[24] = 1, 0, 0
    abducted = np.full((40, 6), WILDCARD)
    abducted[7] = 1
    classes = [MotionClass("bend", template(values)), MotionClass("spread", template(abducted))]
    allocation = replace(Allocation.nothing(8), label=np.array([-1, 0, 0, 0, 0, 0, 0, -1]),
                         column=np.array([-1, 0, 1, 2, 2, 4, 5, -1]))  # fmt: skip
    priors = tracking_priors(allocation, classes, marks_of_classes(classes))
    np.testing.assert_array_equal(priors[6], [-1, -1, 1, 1, 1, 1, 1, -1])
    assert (priors[7] == WILDCARD).all(), "no frame bears the label of the other class"
    np.testing.assert_array_equal(rests(priors, "right_leg"), [False, *[True] * 6, False])
    assert not rests(priors, "left_leg").any()


@pytest.mark.parametrize("number", DEMANDED)
@pytest.mark.parametrize("value", (0, 1))
def test_a_demand_is_the_gradient_of_its_energy_and_holds_where_the_feature_does(monkeypatch, number, value):
    monkeypatch.setattr("toolkit.app.stabilise.demands.SIGMA", 1.0)
    limb = LIMBS_OF_FEATURE[number - 1][0]
    demands, violated = Demands(BODY, STANDING[None], np.zeros(1)), 0
    for seed in range(60):
        pose = some_pose(seed)
        term = demands.term(limb, demanded(number, value), 0)
        assert term is not None
        poses = np.stack([STANDING, pose])
        on = native_features(from_poses(poses, BODY, 30.0, "two"))[0][number - 1, 1]
        if term.violation(pose) == 0.0:
            continue
        violated += 1
        assert on != value
        system = system_of(term, pose)
        steps = 1e-6 * np.eye(skeleton.POSE_SIZE)[term.entries]
        numeric = [(term.energy(pose + step) - term.energy(pose - step)) / 2e-6 for step in steps]
        np.testing.assert_allclose(system.vector[term.entries], numeric, atol=2e-5)
        others = np.setdiff1d(np.arange(skeleton.POSE_SIZE), ENTRIES[limb])
        assert not system.vector[others].any() and not system.matrix[others].any()
        better = descended(term, pose)
        assert term.violation(better) < 0.9 * term.violation(pose)
        if violated == 3:
            break
    assert violated


@pytest.mark.parametrize("leg", FEET)
@pytest.mark.parametrize("known", (False, True))
def test_a_foot_that_rests_is_pulled_to_the_floor_and_to_its_place(leg, known):
    sole, floor = Sole.of(BODY, leg), float(BODY.vertices[:, 1].min())
    standing = sole.at(BODY, STANDING)
    np.testing.assert_allclose(standing[:, 1], floor, atol=0.02)
    floating = STANDING.copy()
    floating[ENTRIES[leg][0]], floating[ENTRIES[leg][3]] = -0.5, 0.6  # hip and knee bent
    term = floor_term(BODY, leg, ENTRIES[leg], floor, standing if known else None)
    system = system_of(term, floating)
    steps = 1e-6 * np.eye(skeleton.POSE_SIZE)
    numeric = [(term.energy(floating + step) - term.energy(floating - step)) / 2e-6 for step in steps[ENTRIES[leg]]]
    np.testing.assert_allclose(system.vector[ENTRIES[leg]], numeric, atol=2e-5)
    after = sole.at(BODY, descended(term, floating))
    np.testing.assert_allclose(after[:, 1], standing[:, 1], atol=0.02)
    if known:
        np.testing.assert_allclose(after, standing, atol=0.03)


@pytest.mark.parametrize(
    ("text", "match"),
    (
        ("- 1", "it is a list; it must be names with values"),
        ("a: [", "is no YAML"),
        ("walk: []", "marks the class 'walk'; there are: bend"),
        ("bend: [{feature: 7, value: 1}]", "lacks columns"),
        ("bend: 2.5", "bend is 2.5; it must be a list"),
        ("bend: [{feature: 9, value: 1, columns: [1, 2]}]", "names feature 9; used are 1, 2, 3, 4, 7"),
        ("bend: [{feature: 7, value: 2, columns: [1, 2]}]", "has the value 2; give 0 or 1"),
        ("bend: [{feature: 7, value: 1, columns: [1, 99]}]", "columns 1 to 99; give first and last within 1 to 9"),
    ),
)
def test_marks_that_cannot_be_are_refused(tmp_path, text: str, match: str):
    (tmp_path / "marks.yaml").write_text(text)
    with pytest.raises(RetrievalError, match=match):
        load_marks(tmp_path / "marks.yaml", [MotionClass("bend", template(np.ones((40, 9))))])


def test_classes_learnt_from_clips_mark_themselves():
    marks = marks_of_classes(classes_of("semaphore"))
    assert len(marks["semaphore"]) > 3
