"""configs/baak2013.yaml against Baak 2013, 5.4: medians of 5.4.1, and Eq. 5.7 to 5.9 against plain references."""

from functools import lru_cache

import numpy as np
import pytest

from tests.database_helpers import small_database
from tests.support.subjects import LEVEL, camera_for, draw, moving_poses
from toolkit.app.config import load_settings
from toolkit.body.shape import load_body
from toolkit.fitting.objective import Objective
from toolkit.fitting.placed import Placer
from toolkit.fitting.refiner import pair_terms
from toolkit.fitting.terms import SurfaceTerm
from toolkit.people.sighting import Sighting
from toolkit.sensing.cloud import Cloud
from toolkit.trackers.baak2013 import Baak2013Tracker
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import Follower
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.search_protocol import SearchInParts
from toolkit.tracks import EMPTY

SETTINGS = load_settings(HybridSettings, "baak2013")
BODY = load_body("neutral")
POSES = moving_poses(3, np.random.default_rng(1))
CAMERA = camera_for(3000.0)


@lru_cache(maxsize=1)
def follower() -> Follower:
    tracker = Baak2013Tracker(small_database(), SETTINGS, body=BODY)
    return tracker.follower(CAMERA, LEVEL)


def sighting(pose: np.ndarray) -> Sighting:
    return Sighting(1, draw(BODY, pose, CAMERA, np.random.default_rng(0)).astype(np.float32), None, CAMERA)


def observed(pose: np.ndarray) -> Observation:
    one = follower()
    cloud = Cloud.from_depth(sighting(pose).depth, CAMERA, LEVEL)
    return one.observer.observe(cloud, 0.0, one.state)


def front_vertices(objective: Objective) -> list[int]:
    return [int(v) for v in objective.placer.chosen if BODY.normals[v, 2] > 0.0]


def test_the_config_builds_the_papers_tracker() -> None:
    assert SETTINGS.tracker == "baak2013"
    tracker = follower()
    assert [search.name for search in tracker.searches] == ["local", "lookup"]
    assert SETTINGS.hypotheses == ("local", "extrema") and SETTINGS.extrema == 20 and SETTINGS.shape.seconds == 0.0


@pytest.mark.parametrize("pose", POSES[1:])
def test_the_selection_compares_by_equations_5_7_to_5_9(pose: np.ndarray) -> None:
    objective, observation = follower().objective, observed(POSES[0])
    scene, placed = observation.scene, objective.placer.place(BODY, pose)
    points = observation.cloud.points @ observation.cloud.rotation
    to_cloud = [min(np.linalg.norm(points - placed.vertices[v], axis=1)) for v in front_vertices(objective)]
    extrema = [LEVEL.T @ e for e in observation.extrema.points.astype(np.float64)]
    to_mesh = [min(np.linalg.norm(placed.vertices - e, axis=1)) for e in extrema]
    assert len(extrema) == 20
    found = objective.compare(BODY, pose, scene)
    assert found.distance == pytest.approx(np.mean(to_cloud) + np.mean(to_mesh), abs=1e-6)
    assert found.energy == 0.0


def test_a_far_body_counts_its_whole_distance() -> None:
    away = POSES[0].copy()
    away[0] += 1.5
    objective = follower().objective
    assert objective.compare(BODY, away, observed(POSES[0]).scene).distance > 1.5


def test_correspondences_are_the_medians_of_five_neighbours_and_pull_alike() -> None:
    observation = observed(POSES[0])
    (term,) = pair_terms(SETTINGS.fitting)
    assert isinstance(term, SurfaceTerm)
    placed = Placer(BODY, CAMERA, LEVEL).place(BODY, POSES[1])
    pairs = term.pairs(placed, observation.scene)
    assert pairs.vertex.tolist() == [int(v) for v in placed.placer.chosen if BODY.normals[v, 2] > 0.0]
    np.testing.assert_allclose(pairs.weight, 1.0, atol=1e-6)
    points = (observation.cloud.points @ observation.cloud.rotation).astype(np.float64)
    for vertex, residual in zip(pairs.vertex[::9], pairs.residual[::9], strict=True):
        near = points[np.argsort(np.linalg.norm(points - placed.vertices[vertex], axis=1))[:5]]
        np.testing.assert_allclose(placed.vertices[vertex] - residual, np.median(near, axis=0), atol=2e-3)


def test_nothing_that_the_paper_lacks_decides() -> None:
    one, observation = follower(), observed(POSES[0])
    assert not observation.cut.any()
    (query,) = Baak2013Tracker(small_database(), SETTINGS).queries()
    np.testing.assert_array_equal(query.centre(observation, 1.0), observation.centre)  # type: ignore[attr-defined]
    assert Baak2013Tracker(small_database(), SETTINGS).occluded_limbs is None
    one.step(sighting(POSES[0]), 0.0, StageClock(("prepare", "landmarks", "local", "arms", "lookup", "select")))
    clock = StageClock(("prepare", "landmarks", "local", "arms", "lookup", "select"))
    assert one.step(None, 0.1, clock).state == EMPTY
    hypotheses: list[str] = []
    for search in one.searches:
        name = "propose_parts" if isinstance(search, SearchInParts) else "propose"
        asked = getattr(search, name)
        setattr(search, name, lambda *a, asked=asked: hypotheses.append(str(a[1].previous)) or asked(*a))
    one.step(sighting(POSES[1]), 0.2, clock)
    assert hypotheses == ["None"] * len(one.searches)
