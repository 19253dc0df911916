"""Database lookup: labelings, scores, and the poses of the queries (Baak 2013, 5.4.3)."""

from dataclasses import dataclass, replace
from itertools import permutations
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.database_helpers import small_database
from tests.landmark_helpers import body_cloud
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.database import canonical
from toolkit.fitting.scene import Scene
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.extrema import Extrema
from toolkit.landmarks.facing import camera_yaw, estimate_facing, smoothed_facing
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.sensing.cloud import Cloud
from toolkit.tracking.search.estimate_query import EstimatedJointsQuery, facing_of_joints
from toolkit.tracking.search.extrema_query import ExtremaQuery
from toolkit.tracking.search.labelings import LookupSettings, admissible_labelings, fused_scores
from toolkit.tracking.state import FIRST_STEP, Previous

# person with the left hand beside the head: left hand, right hand, left foot, right foot, head
STANDING = np.array([[0.2, 0.5, 0.0], [-0.7, 0.3, 0.0], [0.15, -0.9, 0.1], [-0.15, -0.9, 0.1], [0.0, 0.6, 0.0]])


def as_set(rows: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(row) for row in rows.tolist()}


# Labelings


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.05, 0.3, 0.8]))
def test_the_labelings_of_eq_5_4_are_those_of_a_loop_over_all_permutations(seed: int, spread: float) -> None:
    rng = np.random.default_rng(seed)
    effectors = STANDING + rng.normal(0.0, 0.1, (5, 3))
    extrema = effectors[rng.permutation(5)] + rng.normal(0.0, spread, (5, 3))
    expected = set()
    for sigma in permutations(range(5)):
        if all(np.linalg.norm(extrema[sigma[n]] - effectors[n]) < 0.5 for n in range(5)):
            expected.add(sigma)
    found = admissible_labelings(extrema, effectors, 0.5)
    assert as_set(found) == expected and len(found) == len(expected)


# Scores


def test_candidates_are_scored_as_in_eq_5_5_and_5_6() -> None:
    rng = np.random.default_rng(0)
    candidates, before = rng.normal(size=(7, 20, 3)), rng.normal(size=(20, 3))
    delta = rng.random(7)
    scores = fused_scores(delta, candidates, before, 0.3)
    for c in range(7):
        stacked = np.concatenate([candidates[c, j] - before[j] for j in range(20)])
        assert scores[c] == pytest.approx(0.3 * delta[c] + 0.7 * np.sqrt((stacked**2).sum()) / 20)


# Proposers


@pytest.fixture(scope="module")
def body() -> Body:
    return load_body("neutral")


@dataclass(frozen=True)
class Seen:
    """Observation with given parts."""

    cloud: Cloud
    centre: np.ndarray
    yaw: float
    extrema: Extrema
    estimate: JointEstimate | None
    scene: Scene
    elapsed: float = FIRST_STEP

    @property
    def free_extrema(self) -> np.ndarray:
        return self.extrema.points.astype(np.float64)


def view_of(body: Body, pose: np.ndarray, order: np.ndarray) -> Seen:
    """Return the view of a pose (P,) with its true end effectors in any order as the extrema."""
    cloud = body_cloud(body, pose)
    scale = body.height / 1.7
    centre = cloud_centre(cloud.points, scale=scale)
    yaw = float(np.arctan2(*smoothed_facing(None, estimate_facing(cloud.points, centre, scale=scale), 1 / 30, centre)))
    tips = body.end_effector_positions(pose)[order].astype(np.float32)
    none = np.zeros(5)
    extrema = Extrema(none.astype(np.int32), tips, none, none.astype(np.int32), 0, none.astype(np.int32))
    return Seen(cloud, centre, yaw, extrema, None, Scene(cloud, tips.astype(np.float64), 0))


def standing_at(row: int, yaw: float = 0.0) -> np.ndarray:
    """Return pose `row` of the small database, 2.8 m from the camera, rotated by `yaw`."""
    place = np.array([0.15, -0.05, -2.8])
    return canonical.place(small_database().poses[row].astype(np.float64), np.zeros(4), place, camera_yaw(place) + yaw)


@pytest.mark.parametrize("row", [3, 41, 77, 120, 199])
def test_a_pose_of_the_database_that_a_camera_sees_comes_back_in_its_place(body: Body, row: int) -> None:
    pose = standing_at(row)
    view = view_of(body, pose, np.random.default_rng(row).permutation(5))
    query = ExtremaQuery(small_database(), LookupSettings())
    # The labels of a first frame are not known, so the best of a few labelings has to be the pose.
    candidates = query.poses(view, None, body, 4)
    assert candidates.shape == (4, skeleton.POSE_SIZE)
    errors = np.linalg.norm(body.joint_positions(candidates) - body.joint_positions(pose), axis=2).mean(axis=1)
    assert errors.min() < 0.03
    assert np.array_equal(query.poses(view, None, body, 1), candidates[:1])


@pytest.mark.parametrize("row", [3, 41, 77])
@pytest.mark.parametrize("turn", [-20.0, 0.0, 20.0])
def test_with_the_frame_before_the_pose_is_the_first_to_come_back(body: Body, row: int, turn: float) -> None:
    pose = standing_at(row, np.deg2rad(turn))
    view = view_of(body, pose, np.random.default_rng(row).permutation(5))
    if turn:  # labels of a first frame are unknown, so the best of a few labelings has to be the pose
        facing = float(canonical.body_facing(pose)) + float(small_database().offsets[row, 3])
        view = replace(view, yaw=facing)
    earlier = pose + np.random.default_rng(row).normal(0.0, 0.02, skeleton.POSE_SIZE)
    tips = body.end_effector_positions(earlier)
    previous = Previous.of_pose(body, earlier, tips)
    (found,) = ExtremaQuery(small_database(), LookupSettings()).poses(view, previous, body, 1)
    assert found[6:] == pytest.approx(pose[6:], abs=1e-6)
    error = np.linalg.norm(body.joint_positions(found) - body.joint_positions(pose), axis=1).mean()
    assert error < (0.03 if turn == 0.0 else 0.06)


@pytest.mark.parametrize("size", [0.7, 1.3])
@pytest.mark.parametrize("row", [41, 77, 120])
def test_a_person_of_another_size_gets_the_pose_in_the_right_place(body: Body, row: int, size: float) -> None:
    person, pose = body.scaled(size), standing_at(row)
    view = view_of(person, pose, np.arange(5))
    tips = person.end_effector_positions(pose)
    previous = Previous.of_pose(person, pose, tips)
    database = small_database()
    (found,) = ExtremaQuery(database, LookupSettings()).poses(view, previous, person, 1)
    assert found[6:] == pytest.approx(pose[6:], abs=1e-6)
    assert np.linalg.norm(person.joint_positions(found) - person.joint_positions(pose), axis=1).mean() < 0.03 * size
    # a filtered facing includes the turn of earlier frames
    asked = []
    recorder = SimpleNamespace(
        poses=database.poses, joints=database.joints, offsets=database.offsets, torso_length=database.torso_length,
        query=lambda features, *rest: asked.append(features) or database.query(features, *rest),
    )  # fmt: skip
    ExtremaQuery(recorder, LookupSettings()).poses(view, previous, person, 1)
    nearest = np.linalg.norm(asked[0] - database.features[row], axis=1).min()
    assert nearest < 0.1


def test_fewer_than_five_extrema_without_estimated_joints_propose_nothing(body: Body) -> None:
    view = view_of(body, standing_at(3), np.arange(5))
    few = replace(view.extrema, points=view.extrema.points[:4])
    query = ExtremaQuery(small_database(), LookupSettings())
    assert query.poses(replace(view, extrema=few), None, body, 3).shape == (0, skeleton.POSE_SIZE)


def test_three_labelled_end_effectors_are_enough_with_estimated_joints(body: Body) -> None:
    pose = standing_at(77)
    view = view_of(body, pose, np.arange(5))
    few = replace(view.extrema, points=view.extrema.points[[4, 1, 2]])
    estimate = JointEstimate(body.joint_positions(pose), np.ones(20))
    query = ExtremaQuery(small_database(), LookupSettings(candidate_distance=0.25))
    found = query.poses(replace(view, extrema=few, estimate=estimate), None, body, 3)
    errors = np.linalg.norm(body.joint_positions(found) - body.joint_positions(pose), axis=2).mean(axis=1)
    assert errors.min() < 0.03
    silent = ExtremaQuery(small_database(), LookupSettings(candidate_distance=0.0))
    assert len(silent.poses(replace(view, extrema=few, estimate=estimate), None, body, 3)) == 0


@pytest.mark.parametrize("turn", [-120.0, 0.0, 60.0])
def test_the_joints_of_a_pose_bring_it_back_whichever_way_it_faces(body: Body, turn: float) -> None:
    pose = standing_at(120, np.deg2rad(turn))
    estimate = JointEstimate(body.joint_positions(pose), np.ones(20))
    view = replace(view_of(body, pose, np.arange(5)), estimate=estimate)
    found = EstimatedJointsQuery(small_database(), 0.0).poses(view, None, body, 3)
    assert found.shape == (3, skeleton.POSE_SIZE)
    assert found[0, 6:] == pytest.approx(pose[6:], abs=1e-6)
    # the query is that of the database's person in this pose
    assert np.linalg.norm(body.joint_positions(found[0]) - estimate.points, axis=1).mean() < 0.03


@pytest.mark.parametrize("yaw", [-3.0, -1.0, 0.0, 0.5, 2.0])
def test_the_facing_of_joints_is_that_of_the_body(body: Body, yaw: float) -> None:
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[4] = yaw
    assert facing_of_joints(body.joint_positions(pose)) == pytest.approx(yaw)
