"""Arm search: the best hypothesis so far with one arm replaced by arms of the database."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.arms import ArmPoses, ArmSettings
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.scene import Scene
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.database_lookup import is_due
from toolkit.tracking.search.search_protocol import NOTHING, Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import PersonState

ITERATIONS = 2
"""Iterations that refine a pose with one new limb."""


@dataclass(frozen=True)
class LimbExchange:
    """Refinement of arm candidates; keeps the pose that leaves least unexplained.

    Attributes
    ----------
    objective, refiner : compare with the frame, and refine
    settings : see `ArmSettings`
    """

    objective: Objective
    refiner: Refiner
    settings: ArmSettings

    def best(
        self, body: Body, pose: np.ndarray, compared: Comparison, candidates: Iterable[np.ndarray], scene: Scene
    ) -> tuple[np.ndarray, Comparison]:
        """Return the best of a pose (P,), `compared` with the frame, and its `candidates` (P,)."""
        # Maximum factor by which the sparse distance may grow; beyond it the new arm covers measured points.
        farther = 1.2
        for candidate in candidates:
            refined = self.refiner.refine(body, candidate, scene, iterations=ITERATIONS)
            tried = self.objective.compare(body, refined, scene, farther * compared.distance)
            if unexplained(tried, self.settings) < unexplained(compared, self.settings) - self.settings.margin:
                pose, compared = refined, tried
        return pose, compared


class ArmSearch:
    """Search for better arms of the best pose of a tracked person.

    The unexplained part of the frame and the pose prior decide. The other parts of the sparse distance do not help:
    they are smallest for an arm inside the body. A better pose replaces the hypothesis that it comes from.

    Parameters
    ----------
    poses : the arms of the database
    objective, refiner : compare the answers with the frame, and refine
    settings : see `ArmSettings`
    period : of `DatabaseLookup`: in its frames arms are not searched, so that no frame has both; 1 = no effect
    """

    name = "arms"

    def __init__(
        self, poses: ArmPoses, objective: Objective, refiner: Refiner, settings: ArmSettings, period: int = 1
    ) -> None:
        self._poses, self._settings, self._sigma = poses, settings, refiner.settings.sigma
        self._exchange = LimbExchange(objective, refiner, settings)
        self._period = period

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """Propose arms, see `Search.propose`."""
        queried = self._period > 1 and not state.lost and is_due(state, self._period)
        if state.previous is None or best is None or queried:
            return NOTHING
        body, scene = best.body, observation.scene
        pose, compared = best.hypothesis.pose, best.comparison
        # Both share what a frame may cost, so each of them comes first in its turn.
        arms, left = self._poses.of(body), self._settings.refined
        for arm in arms if state.turn % 2 else arms[::-1]:
            if left == 0:
                break
            proposed = arm.propose(pose, compared, scene, self._settings, self._sigma, left)
            left -= len(proposed)
            pose, compared = self._exchange.best(body, pose, compared, proposed, scene)
        if pose is best.hypothesis.pose:
            return NOTHING
        return Proposal((Hypothesis("arms", pose, compared, improves=best),))


def unexplained(compared: Comparison, settings: ArmSettings) -> float:
    """Return the cost of an arm, metres: distance of the samples to the drawn body, plus the pose prior."""
    if not np.isfinite(compared.distance):
        return np.inf
    return float(compared.sample_gaps.mean()) + settings.prior * compared.energy
