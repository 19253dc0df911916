"""Database hypothesis: poses retrieved by one query or several, the nearest of them refined (Baak 2013, 5.4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from toolkit.body.body import Body
from toolkit.database import canonical
from toolkit.database.database import PoseDatabase
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.terms import JointTerm
from toolkit.io.parts import Parts, whole
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.search_protocol import NOTHING, Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import PersonState, Previous

FIRST_ROUNDS = 2
"""Factor on the usual number of iterations where there is no previous pose."""


class Query(Protocol):
    """Query of the database for whole poses.

    Attributes
    ----------
    source : name of its hypotheses
    """

    source: str

    def poses(self, observation: Observation, previous: Previous | None, body: Body, count: int) -> np.ndarray:
        """Return at most `count` poses, the best first: float64 (C, P), level frame."""
        ...

    def pull(self, observation: Observation) -> JointTerm | None:
        """Return the initial pull of the refinement, or None."""
        ...


class DatabaseLookup:
    """Search by all queries after a loss or on a first frame, and by one after the other while tracking.

    Parameters
    ----------
    queries : queries of the database
    objective, refiner : compare the answers with the frame, and refine
    candidates : retrieved poses per query that are compared before one of them is refined
    restarts : poses per query refined where there is no previous pose
    promising : the nearest retrieved pose is refined if its distance is at most this times that of the best rival
    period : while tracking, one query is used in every `period`-th frame
    """

    name = "lookup"

    def __init__(
        self, queries: Sequence[Query], objective: Objective, refiner: Refiner, *, candidates: int, restarts: int,
        promising: float, period: int,
    ) -> None:  # fmt: skip
        self._queries, self._objective, self._refiner = tuple(queries), objective, refiner
        self._candidates, self._restarts, self._promising, self._period = candidates, restarts, promising, period

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """Propose retrieved poses, see `Search.propose`."""
        return whole(self.propose_parts(observation, state, rng, best))

    def propose_parts(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Parts[Proposal]:
        """See `SearchInParts.propose_parts`: without a previous pose, each query is a part."""
        if state.previous is None:
            firsts = []
            for number, query in enumerate(self._queries):
                if number:
                    yield
                firsts.append(self._first(query, observation, state.body))
            return Proposal(tuple(first for first in firsts if first is not None))
        bound = np.inf if best is None else self._promising * best.comparison.distance
        nearest, chosen, found = bound, None, None
        for query in self._due_queries(state):
            for pose in query.poses(observation, state.previous, state.body, self._candidates):
                distance = self._objective.compare(state.body, pose, observation.scene, nearest).distance
                if distance < nearest:
                    nearest, chosen, found = distance, query, pose
        if chosen is None or found is None:
            return NOTHING
        return Proposal((Hypothesis(chosen.source, self._refined(chosen, found, observation, state.body)),))

    def _due_queries(self, state: PersonState) -> tuple[Query, ...]:
        """Return the queries of this frame: one or none in turn while tracking, else all."""
        if state.lost or not self._queries:
            return self._queries
        if not state.is_due(self._period):
            return ()
        return (self._queries[(state.turn + 1) // self._period % len(self._queries)],)

    def _first(self, query: Query, observation: Observation, body: Body) -> Hypothesis | None:
        """Return the refined answer of a query that is nearest to the frame; None without an answer."""
        best: Hypothesis | None = None
        nearest = np.inf
        for pose in query.poses(observation, None, body, self._restarts):
            refined = self._refined(query, pose, observation, body, FIRST_ROUNDS)
            compared = self._objective.compare(body, refined, observation.scene)
            if compared.distance < nearest:
                nearest, best = compared.distance, Hypothesis(query.source, refined, compared)
        return best

    def _refined(
        self, query: Query, pose: np.ndarray, observation: Observation, body: Body, rounds: int = 1
    ) -> np.ndarray:
        """Return a retrieved pose, refined with the query's pull first."""
        scene, iterations = observation.scene, rounds * self._refiner.settings.iterations
        pull = query.pull(observation)
        pulled_iterations = 2  # iterations with a query's pull; later ones use the depth image alone
        if pull is not None:
            pose = self._refiner.refine(body, pose, scene, terms=[pull], iterations=rounds * pulled_iterations)
            iterations -= pulled_iterations
        return self._refiner.refine(body, pose, scene, iterations=max(iterations, 1))


def placed_poses(
    database: PoseDatabase, rows: np.ndarray, origins: np.ndarray, centre: np.ndarray, yaw: float, size: float
) -> np.ndarray:
    """Return database poses with their origins, for a body `size` times as large, at a centre and facing."""
    scaled = np.array(origins, dtype=np.float64)
    scaled[:, :3] *= size
    return canonical.place(database.poses[rows].astype(np.float64), scaled, centre, yaw)
