"""Observation of a frame: effects of the person's size, time and previous frame."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.database.origin import ADULT_HEIGHT
from toolkit.fitting.joint_confidence import network_features
from toolkit.landmarks.facing import FacingEstimate, smoothed_facing
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.joints2d import Joints2D
from toolkit.tracking import observation as room
from toolkit.tracking.observation import VIEW_TIME, Observation, Observer
from toolkit.tracking.state import FIRST_STEP, PersonState, Previous

OBSERVER = Observer(LandmarkSettings(), 20, 100, None)
CENTRE = np.array([0.0, 0.1, -3.0])


@pytest.fixture
def cloud() -> Cloud:
    """Return a board of 2,000 points, 3 m away."""
    depth = np.zeros((60, 80), dtype=np.float32)
    depth[5:55, 20:60] = 3.0
    return Cloud.from_depth(depth, Camera(80.0, 80.0, 39.5, 29.5, 80, 60), np.diag([1.0, -1.0, -1.0]))


def state(name: str = "neutral", **known: Any) -> PersonState:
    return replace(PersonState.begin(load_body(name), sized=True, seed=0), **known)


def recorded(monkeypatch: pytest.MonkeyPatch, name: str, answer: Any) -> list[tuple[Any, ...]]:
    """Replace a function by one with a given answer; return its calls."""
    calls: list[tuple[Any, ...]] = []

    def call(*values: Any) -> Any:
        calls.append(values)
        return answer

    monkeypatch.setattr(room, name, call)
    return calls


@pytest.mark.parametrize("name", ["child", "neutral"])
def test_landmarks_use_the_size_of_the_person(cloud: Cloud, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    centres, facings = (
        recorded(monkeypatch, "cloud_centre", CENTRE),
        recorded(monkeypatch, "estimate_facing", FacingEstimate(0.2, 1.0)),
    )
    sources = recorded(monkeypatch, "source_node", 7)
    seen = OBSERVER.observe(cloud, 0.0, state(name))
    assert seen.extrema.source == 7 and seen.yaw == pytest.approx(0.2)
    scale = load_body(name).height / ADULT_HEIGHT
    assert [calls[0][-1] for calls in (centres, facings, sources)] == [scale] * 3
    assert (name == "child") == (scale < 0.85)


@pytest.mark.parametrize(("timestamp", "dt"), [(10.0, 0.25), (None, FIRST_STEP)])
def test_the_facing_follows_by_the_time_that_has_passed(
    cloud: Cloud, monkeypatch: pytest.MonkeyPatch, timestamp: float | None, dt: float
) -> None:
    recorded(monkeypatch, "cloud_centre", CENTRE)
    estimate = FacingEstimate(0.9, 0.5)
    recorded(monkeypatch, "estimate_facing", estimate)
    before = np.array([0.0, 1.0])
    seen = Observation(OBSERVER, cloud, 10.25, state(facing=before, timestamp=timestamp))
    assert seen.facing == pytest.approx(smoothed_facing(before.copy(), estimate, dt, CENTRE))
    assert before.tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("followed", "learning", "evidence"), [(False, False, True), (True, False, False), (True, True, True)]
)
def test_certain_votes_are_evidence_in_detection_and_body_learning(
    cloud: Cloud, monkeypatch: pytest.MonkeyPatch, followed: bool, learning: bool, evidence: bool
) -> None:
    observer = replace(OBSERVER, estimate_pull=30.0, learning=learning)
    monkeypatch.setattr(Observation, "estimate", JointEstimate(np.zeros((20, 3)), np.ones(20)))
    pose = np.zeros(skeleton.POSE_SIZE)
    previous = Previous.of_pose(load_body("neutral"), pose) if followed else None
    assert bool(observer.observe(cloud, 0.0, state(previous=previous)).evidence) == evidence


def test_a_pose_from_before_a_gap_has_no_weight_in_the_frame(cloud: Cloud, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Observation, "estimate", JointEstimate(np.zeros((20, 3)), np.ones(20)))
    last = Previous.of_pose(load_body("neutral"), np.zeros(skeleton.POSE_SIZE))
    observer = replace(OBSERVER, estimate_pull=30.0)
    out_of_view = np.where(np.arange(20) < 4, 0.0, 1.0)
    seen, after_gap = (
        observer.observe(cloud, 0.2, state(in_view=out_of_view, timestamp=0.1, last_seen_at=0.0, **known))
        for known in ({"previous": last}, {"last_seen": last})
    )
    assert seen.follows and not seen.evidence and seen.withheld is not None
    assert not after_gap.follows and after_gap.evidence and after_gap.withheld is None


class FakeNetwork:
    """Network with a fixed estimate of the joints in view."""

    def __init__(self, in_view: np.ndarray) -> None:
        self._in_view = in_view

    def estimate(self, *_: Any, **__: Any) -> JointEstimate:
        return JointEstimate(np.zeros((20, 3)), np.ones(20), self._in_view)


@pytest.fixture
def legless() -> np.ndarray:
    in_view = np.ones(20)
    in_view[[skeleton.REPORTED.index(f"left_{end}") for end in ("ankle", "foot")]] = 0.05
    return in_view


def test_links_out_of_view_get_no_measured_points(cloud: Cloud, legless: np.ndarray) -> None:
    before = Previous(np.zeros(43), *np.zeros((4, 1)), 0.1)
    scene = OBSERVER.observe(cloud, 0.1, state(previous=before, in_view=legless)).scene
    assert scene.withheld is not None
    assert {skeleton.JOINT_NAMES[joint] for joint in np.flatnonzero(scene.withheld)} == {"left_knee", "left_ankle"}
    for known in ({"previous": before}, {"in_view": legless}, {"previous": before, "in_view": np.ones(20)}):
        assert OBSERVER.observe(cloud, 0.1, state(**known)).scene.withheld is None
    learning = replace(OBSERVER, learning=True)
    assert learning.observe(cloud, 0.1, state(previous=before, in_view=legless)).withheld is None


def test_what_is_in_view_is_learnt_from_the_estimates_of_frames_that_cut_a_person_off(
    cloud: Cloud, monkeypatch: pytest.MonkeyPatch, legless: np.ndarray
) -> None:
    observer, all_of_them = replace(OBSERVER, network=FakeNetwork(legless)), np.ones(20)
    half = VIEW_TIME * math.log(2.0)

    def after(is_cut: bool, before: np.ndarray | None, elapsed: float = half) -> np.ndarray | None:
        monkeypatch.setattr(room, "on_cuts", lambda *_: np.array([False, is_cut]))
        return observer.observe(cloud, elapsed, state(in_view=before, timestamp=0.0)).in_view

    assert after(True, None) is legless
    assert after(True, all_of_them) == pytest.approx((1.0 + legless) / 2)
    assert after(True, all_of_them, 2 * half) == pytest.approx((1.0 + 3 * legless) / 4)
    assert after(False, legless) == pytest.approx((1.0 + legless) / 2)
    assert after(False, None) is None


def test_of_a_fast_camera_the_joints_in_view_are_estimated_in_one_of_some_frames_unless_the_person_is_lost(
    cloud: Cloud, monkeypatch: pytest.MonkeyPatch, legless: np.ndarray
) -> None:
    monkeypatch.setattr(room, "on_cuts", lambda *_: np.array([True]))
    observer, before = replace(OBSERVER, network=FakeNetwork(legless), period=3), np.ones(20)
    third = VIEW_TIME * math.log(2.0) / 3

    def after(elapsed: float = third, **known: Any) -> np.ndarray | None:
        return observer.observe(cloud, elapsed, state(in_view=before, timestamp=0.0, **known)).in_view

    assert after(turn=1) is before
    assert after(turn=2) == pytest.approx((1.0 + legless) / 2)
    assert after(turn=1, lost=0.1) == pytest.approx(1.0 + (1.0 - 0.5 ** (1 / 3)) * (legless - 1.0))
    assert after(2 * third, turn=1) == pytest.approx(1.0 + (1.0 - 0.5 ** (2 / 3)) * (legless - 1.0))


def test_the_joints_in_view_do_not_depend_on_a_search_using_the_estimate(
    cloud: Cloud, monkeypatch: pytest.MonkeyPatch, legless: np.ndarray
) -> None:
    monkeypatch.setattr(room, "on_cuts", lambda *_: np.array([True]))
    before, found = np.ones(20), []
    for asked in (False, True):
        seen = replace(OBSERVER, network=FakeNetwork(legless)).observe(cloud, 0.1, state(in_view=before, timestamp=0.0))
        if asked:
            assert seen.estimate is not None
        found.append(seen.in_view)
    assert np.array_equal(*found)
    without = OBSERVER.observe(cloud, 0.1, state(in_view=before))
    assert without.estimate is None and without.in_view is before


def test_the_evidence_of_the_network_is_kept_until_a_search_evaluates_it_again(
    cloud: Cloud, legless: np.ndarray
) -> None:
    joints, before = np.ones((20, 3)), np.full((20, 2), 0.3)
    seen = replace(OBSERVER, network=FakeNetwork(legless)).observe(cloud, 0.1, state())
    assert seen.network_evidence(joints, before) is before
    assert seen.estimate is not None
    new = network_features(joints, seen.estimate)
    np.testing.assert_array_equal(seen.network_evidence(joints, before), new)
    first = replace(OBSERVER, network=FakeNetwork(legless)).observe(cloud, 0.1, state())
    np.testing.assert_array_equal(first.network_evidence(joints, None), new)
    assert OBSERVER.observe(cloud, 0.1, state()).network_evidence(joints, None) is None


@pytest.mark.parametrize("learning", [False, True])
def test_an_upper_body_has_no_leg_landmarks_and_a_whole_body_has_all(cloud: Cloud, learning: bool) -> None:
    hidden = np.zeros(len(skeleton.REPORTED))
    known = state(previous=Previous.of_pose(load_body("neutral"), np.zeros(skeleton.POSE_SIZE)), in_view=hidden)
    withheld = {
        body: [
            replace(OBSERVER, body=body, learning=learning).observe(cloud, 0.0, s).withheld for s in (state(), known)
        ]
        for body in ("auto", "whole", "upper")
    }
    assert withheld["whole"] == [None, None] and withheld["auto"][0] is None
    assert (withheld["auto"][1] is None) == learning
    for legs in withheld["upper"]:
        assert legs is not None
        names = {name for name, away in zip(skeleton.JOINT_NAMES, legs, strict=True) if away}
        assert names == {f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", "ankle")}


@pytest.mark.parametrize(
    ("told", "on", "off", "believed"),
    [(True, 10, 10, 10), (True, 9, 11, None), (True, 20, 0, 20), (False, 20, 0, None)],
)
def test_joints_in_the_image_are_evidence_where_at_least_half_lie_on_the_persons_own_pixels(
    cloud: Cloud, monkeypatch: pytest.MonkeyPatch, told: bool, on: int, off: int, believed: int | None
) -> None:
    pixels = np.array([[40.0, 30.0]] * on + [[70.0, 30.0]] * off, dtype=np.float32)
    joints = Joints2D(pixels, np.full(20, 0.9, dtype=np.float32))
    calls = recorded(monkeypatch, "SightedJoints", "evidence")
    observed = Observation(replace(OBSERVER, told_joints=told), cloud, 0.0, state(), joints=joints)
    assert ("evidence" in observed.evidence) == (believed is not None)
    assert [int((seen.confidence > 0).sum()) for seen, _ in calls] == ([] if believed is None else [believed])
