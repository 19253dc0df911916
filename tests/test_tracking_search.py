"""Searches with fake parts: starting points, queries, refinement, and answers."""

import inspect
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.database_helpers import small_database
from tests.fake_tracker_parts import FakeObjective, FakeRefiner, compared, observation, pose_at, says
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.database.database import PoseDatabase
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.terms import JointTerm
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.sensing.camera import Camera
from toolkit.trackers.hybrid import tracker as hybrid
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracking import searching
from toolkit.tracking.body_learning import RateLimiter
from toolkit.tracking.search.arm_search import ITERATIONS, JOINT_WEIGHT, ArmSearch, ArmSettings, NetworkArms
from toolkit.tracking.search.database_lookup import FIRST_ROUNDS, DatabaseLookup
from toolkit.tracking.search.estimate_query import ESTIMATE_SIGMA, EstimatedJointsQuery
from toolkit.tracking.search.extrema_query import ExtremaQuery
from toolkit.tracking.search.labelings import LookupSettings
from toolkit.tracking.search.local_search import LocalSearch
from toolkit.tracking.search.search_protocol import NOTHING, ScoredHypothesis
from toolkit.tracking.state import PersonState, Previous

RNG = np.random.default_rng(0)
BODY = load_body("neutral")
BUDGET: dict[str, Any] = {"candidates": 2, "restarts": 3, "promising": 2.0, "period": 2}


def state(previous: np.ndarray | None = None, before: np.ndarray | None = None, **others: Any) -> PersonState:
    known = None if previous is None else Previous.of_pose(BODY, previous, None, before)
    return replace(PersonState.begin(BODY, sized=True, seed=0), previous=known, **others)


def rival(pose: np.ndarray, distance: float, **how: float) -> ScoredHypothesis:
    return ScoredHypothesis.of(says("local", pose), BODY, compared(distance, **how), redetected=False)


# The local hypothesis


def test_the_local_hypothesis_is_the_previous_pose_refined_and_continues_it() -> None:
    refiner = FakeRefiner(step=0.5)
    (found,) = LocalSearch(refiner, 0.7).propose(observation(), state(pose_at(1.0)), RNG, None).hypotheses
    assert (found.source, found.continues, found.improves) == ("local", True, None)
    assert found.pose[0] == 1.5
    assert refiner.calls[0].pose[0] == 1.0 and refiner.calls[0].body is BODY


def test_momentum_moves_on_by_its_share_of_the_last_step() -> None:
    refiner = FakeRefiner()
    known = state(pose_at(1.0, left_elbow_ry=-0.5), before=pose_at(0.8, left_elbow_ry=-0.3))
    LocalSearch(refiner, 0.7).propose(observation(), known, RNG, None)
    start = refiner.calls[0].pose
    assert start[0] == pytest.approx(1.0 + 0.7 * 0.2)
    assert start[skeleton.POSE_NAMES.index("left_elbow_ry")] == pytest.approx(-0.5 - 0.7 * 0.2)


# The database


class FakeQuery:
    """Query that returns poses at given places and keeps its inputs."""

    def __init__(self, source: str, places: list[float], pull: Any = None) -> None:
        self.source, self._places, self._pull = source, places, pull
        self.asked: list[tuple[Any, int]] = []

    def poses(self, seen: Any, previous: Any, body: Any, count: int) -> np.ndarray:
        self.asked.append((previous, count))
        return np.array([pose_at(x) for x in self._places[:count]]).reshape(-1, skeleton.POSE_SIZE)

    def pull(self, seen: Any) -> Any:
        return self._pull


def lookup(queries: list[FakeQuery], distances: dict[float, float], budget: dict[str, Any] = BUDGET) -> DatabaseLookup:
    return DatabaseLookup(queries, FakeObjective(distances), FakeRefiner(), **budget)


def test_while_all_is_well_queries_take_turns_with_frames_of_rest() -> None:
    queries = [FakeQuery("extrema", []), FakeQuery("joints", [])]
    search = lookup(queries, {})
    asked = []
    for turn in range(8):
        before = [len(query.asked) for query in queries]
        search.propose(observation(), state(pose_at(), turn=turn), RNG, rival(pose_at(), 0.1))
        asked.append([len(query.asked) - n for query, n in zip(queries, before, strict=True)])
    one, rest, other = [1, 0], [0, 0], [0, 1]
    assert asked == [rest, other, rest, one, rest, other, rest, one]


def test_after_a_loss_every_query_is_asked_in_every_frame() -> None:
    queries = [FakeQuery("extrema", []), FakeQuery("joints", [])]
    for turn in range(3):
        lookup(queries, {}).propose(observation(), state(pose_at(), turn=turn, lost=1), RNG, None)
    assert [len(query.asked) for query in queries] == [3, 3]
    assert {count for query in queries for _, count in query.asked} == {BUDGET["candidates"]}


def test_the_nearest_of_the_retrieved_poses_is_refined_and_no_other() -> None:
    refiner = FakeRefiner(step=0.25)
    objective = FakeObjective({1.0: 0.15, 2.0: 0.12})
    search = DatabaseLookup([FakeQuery("extrema", [1.0, 2.0, 3.0])], objective, refiner, **BUDGET)
    (found,) = search.propose(observation(), state(pose_at(), lost=1), RNG, rival(pose_at(), 0.1)).hypotheses
    assert found.source == "extrema" and found.pose[0] == 2.25
    assert not found.continues and found.improves is None
    assert [call.pose[0] for call in refiner.calls] == [2.0]
    assert objective.bounds == [BUDGET["promising"] * 0.1, 0.15]


def test_on_a_first_frame_each_query_gives_the_nearest_of_its_refined_starts() -> None:
    queries = [FakeQuery("extrema", [1.0, 2.0, 3.0, 4.0]), FakeQuery("joints", [])]
    refiner = FakeRefiner(step=0.5)
    objective = FakeObjective({1.5: 0.3, 2.5: 0.1, 3.5: 0.2})
    search = DatabaseLookup(queries, objective, refiner, **BUDGET)
    (found,) = search.propose(observation(), state(), RNG, None).hypotheses
    assert found.pose[0] == 2.5 and found.comparison is not None and found.comparison.distance == 0.1
    assert queries[0].asked == [(None, BUDGET["restarts"])]
    assert len(refiner.calls) == BUDGET["restarts"]
    assert {call.iterations for call in refiner.calls} == {FIRST_ROUNDS * refiner.settings.iterations}


# Its queries


def estimate(confidence: float = 0.25) -> JointEstimate:
    return JointEstimate(BODY.joint_positions(pose_at()), np.full(20, confidence))


def test_estimated_joints_pull_in_the_camera_frame_by_the_root_of_their_confidence() -> None:
    seen = observation(estimate=estimate())
    pull = EstimatedJointsQuery(small_database(), 30.0).pull(seen)
    assert isinstance(pull, JointTerm)
    assert pull.weights == pytest.approx(np.full(20, 30.0 * 0.5))
    assert pull.targets == pytest.approx(estimate().points * [1.0, -1.0, -1.0])
    assert pull.sigma == ESTIMATE_SIGMA


class FakeDatabase:
    """Database of three poses; each query returns all of them at given distances."""

    def __init__(self, distances: list[float]) -> None:
        real = small_database()
        self.poses, self.joints, self.offsets = real.poses[:3], real.joints[:3], np.zeros((3, 4), dtype=np.float32)
        self.torso_length = real.torso_length
        self.distances = np.array(distances)

    def query(self, features: np.ndarray, k: int, present: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.distances[: len(features)], np.tile(np.arange(3), (len(features), 1))


def queried(query: ExtremaQuery, points: np.ndarray, present: np.ndarray, previous: Previous | None) -> np.ndarray:
    query.queries = lambda seen, known: (points, present)  # type: ignore[method-assign]
    return query.poses(observation(), previous, BODY, 3)


def rows_of(found: np.ndarray, database: FakeDatabase) -> list[int]:
    """Return the rows of the database that were found, by their angles."""
    return [int(np.abs(database.poses[:, 6:] - pose[6:]).sum(axis=1).argmin()) for pose in found]


@pytest.mark.parametrize(("balance", "first"), [(1.0, 0), (0.0, 2), (0.5, 2)])
def test_the_frame_before_weighs_as_in_eq_5_6(balance: float, first: int) -> None:
    database: Any = FakeDatabase([[0.10, 0.15, 0.12]])
    seen = observation()
    like = database.joints[2].astype(np.float64)
    turned = like @ np.array(  # facing of the frame, about y
        [[np.cos(seen.yaw), 0, -np.sin(seen.yaw)], [0, 1, 0], [np.sin(seen.yaw), 0, np.cos(seen.yaw)]]
    )
    previous = replace(Previous.of_pose(BODY, pose_at()), joints=turned + _centre(seen))
    query = ExtremaQuery(database, LookupSettings(balance=balance))
    found = queried(query, np.zeros((1, 5, 3)), np.ones((1, 5), dtype=bool), previous)
    assert rows_of(found, database)[0] == first


def _centre(seen: Any) -> np.ndarray:
    from toolkit.database import canonical

    return canonical.frontal_centre(seen.centre, seen.yaw, 1.0)


# Arms


class FakeArmObjective:
    """Comparisons by the place of the root."""

    def __init__(self, known: dict[float, Any]) -> None:
        self.known, self.bounds = known, []

    def compare(self, body: Any, pose: np.ndarray, scene: Any, bound: float = np.inf) -> Any:
        self.bounds.append(bound)
        return self.known[float(pose[0])]


def arm_search(known: dict[float, Any], refiner: FakeRefiner | None = None, period: int = 1) -> ArmSearch:
    """Return a search whose kinematics move the root by 1."""
    objective: Any = FakeArmObjective(known)
    settings = ArmSettings(explained=0.0, margin=0.001, prior=0.5)
    return ArmSearch(NetworkArms(objective, refiner or FakeRefiner(), FakeRefiner(step=1.0), settings), period)


def estimated() -> Any:
    """Return an observation with joints of which the network is certain."""
    return observation(estimate=JointEstimate(np.zeros((20, 3)), np.ones(20)))


BEST = rival(pose_at(), 0.1, gaps=0.010, energy=0.0)


@pytest.mark.parametrize(
    ("gaps", "energy", "better"),
    [(0.0089, 0.0, True), (0.0091, 0.0, False), (0.005, 0.006, True), (0.005, 0.0081, False)],
    ids=["beyond the margin", "within the margin", "a little unlikely", "too unlikely"],
)
def test_an_arm_wins_by_what_it_leaves_unexplained_and_by_how_likely_it_is(
    gaps: float, energy: float, better: bool
) -> None:
    refiner = FakeRefiner()
    answers = {1.0: compared(0.11, gaps=gaps, energy=energy), 2.0: compared(0.11, gaps=0.02)}
    search = arm_search(answers, refiner)
    proposal = search.propose(estimated(), state(pose_at()), RNG, BEST)
    assert bool(proposal.hypotheses) == better
    assert [call.iterations for call in refiner.calls] == [ITERATIONS, ITERATIONS]
    if better:
        (found,) = proposal.hypotheses
        assert (found.source, found.improves, found.continues) == ("arms", BEST, False)
        assert found.pose[0] == 1.0 and found.comparison is not None and found.comparison.distance == 0.11


def test_arms_and_whole_poses_are_searched_in_different_frames_unless_the_person_is_lost() -> None:
    search = arm_search({1.0: compared(0.01, gaps=0.0), 2.0: compared(0.2, gaps=0.02)}, period=3)
    turns = [state(pose_at(), turn=turn) for turn in range(6)]
    waits = [search.propose(estimated(), now, RNG, BEST) is NOTHING for now in turns]
    assert waits == [False, True, True, False, True, True]
    assert [now.is_due(3) for now in turns] == [False, False, True, False, False, True]
    assert all(replace(now, lost=1).is_due(2) for now in turns)
    assert search.propose(estimated(), replace(turns[2], lost=1), RNG, BEST) is not NOTHING


def test_each_arm_is_moved_to_its_own_joints_while_the_others_stay() -> None:
    kinematics = FakeRefiner()
    cosine, sine = np.cos(0.3), np.sin(0.3)
    level = np.array([[1.0, 0.0, 0.0], [0.0, -cosine, sine], [0.0, -sine, -cosine]])  # a camera that looks down
    objective: Any = FakeArmObjective({0.0: compared(0.2, gaps=0.02)})
    confidence = np.linspace(0.05, 1.0, 20)
    seen = observation(estimate=JointEstimate(np.ones((20, 3)), confidence), cloud=SimpleNamespace(rotation=level))
    arms = NetworkArms(objective, FakeRefiner(), kinematics, ArmSettings(explained=0.0))
    assert arms.better(BEST, seen) is None
    stay = BODY.joint_positions(pose_at()) @ level
    for side, call in zip(("left", "right"), kinematics.calls, strict=True):
        (term,) = call.terms
        own = np.isin(skeleton.REPORTED, [f"{side}_{joint}" for joint in ("elbow", "wrist", "hand")])
        assert term.targets[own] == pytest.approx(np.ones((3, 3)) @ level)
        assert term.targets[~own] == pytest.approx(stay[~own])
        assert term.weights[~own] == pytest.approx(JOINT_WEIGHT)
        assert term.weights[own] == pytest.approx(JOINT_WEIGHT * np.sqrt(confidence[own]))


def test_where_the_body_explains_all_samples_the_network_is_not_evaluated() -> None:
    seen = observation()
    del seen.estimate  # an access raises AttributeError
    objective: Any = FakeArmObjective({})
    arms = NetworkArms(objective, FakeRefiner(), FakeRefiner(), ArmSettings(explained=0.0101))
    assert arms.better(BEST, seen) is None


def test_without_an_estimate_arms_stay() -> None:
    assert arm_search({}).propose(observation(), state(pose_at()), RNG, BEST) is NOTHING


# Assembly by the hybrid tracker

CAMERA = Camera(200.0, 200.0, 79.5, 59.5, 160, 120)
LEVEL = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def database() -> PoseDatabase:
    return small_database()


def made(monkeypatch: pytest.MonkeyPatch, part: type) -> list[dict[str, Any]]:
    """Return the arguments of each `part` that the hybrid tracker creates, by parameter name."""
    calls: list[dict[str, Any]] = []

    def make(*values: Any, **named: Any) -> Any:
        calls.append(dict(inspect.signature(part).bind(*values, **named).arguments))
        return part(*values, **named)

    for module in (hybrid, searching):
        if hasattr(module, part.__name__):
            monkeypatch.setattr(module, part.__name__, make)
    return calls


def test_the_prior_takes_part_in_every_fit_and_in_every_comparison(
    database: PoseDatabase, monkeypatch: pytest.MonkeyPatch
) -> None:
    fits, comparisons = made(monkeypatch, Refiner), made(monkeypatch, Objective)
    tracker = HybridTracker(database, HybridSettings(hypotheses=("local", "extrema")), body=BODY)
    tracker.follower(CAMERA, LEVEL)
    (prior,) = fits[0]["pose_terms"]
    assert comparisons[0]["pose_terms"] == (prior,)
    likeliest = np.concatenate([np.zeros(6), database.poses[:, 6:].mean(axis=0)])
    assert prior.energy(likeliest) == pytest.approx(0.0, abs=1e-9)
    assert prior.weight == tracker.settings.fitting.prior_weight
    without = replace(tracker.settings.fitting, prior_weight=0.0)
    HybridTracker(database, replace(tracker.settings, fitting=without)).follower(CAMERA, LEVEL)
    assert fits[1]["pose_terms"] == comparisons[1]["pose_terms"] == ()


def test_a_person_of_unknown_size_is_tried_in_every_size_of_the_settings(
    database: PoseDatabase, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Any] = []
    monkeypatch.setattr(HybridTracker, "kind", staticmethod(lambda *parts: calls.append(parts)))
    HybridTracker(database, HybridSettings(hypotheses=("extrema",), sizes=(-1.0, 2.0, 5.0))).follower(CAMERA, LEVEL)
    sizes, begun = calls[0][5], calls[0][7]
    assert [body.shape[0] for body in sizes] == [-1.0, 2.0, 5.0]
    assert sizes[2].height == pytest.approx(0.96, abs=0.03) and np.abs(sizes[2].shape[1:]).max() > 1.0  # a toddler
    assert not begun.sized
    HybridTracker(database, HybridSettings(hypotheses=("extrema",)), body=BODY).follower(CAMERA, LEVEL)
    assert calls[1][7].sized and calls[1][7].body is BODY


@pytest.mark.parametrize(("rate", "expected"), [(30.0, 2), (15.0, 1), (60.0, 4), (10.0, 1)])
def test_a_body_is_learnt_from_evenly_spread_frames_whatever_the_camera_s_rate(rate: float, expected: int) -> None:
    jitter = np.random.default_rng(0).uniform(-0.1, 0.1, 60) / rate
    pace = RateLimiter(15.0)
    taken = [k for k in range(60) if pace.takes(k / rate + float(jitter[k]))]
    assert taken[0] == 0 and np.diff(taken).mean() == pytest.approx(expected, abs=0.1)
    assert np.abs(np.diff(taken) - expected).max() <= 1
