"""The best hypothesis so far with other arms: the database asked for one arm at a time."""

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
from toolkit.tracking.search.database_lookup import is_asked
from toolkit.tracking.search.search_protocol import NOTHING, Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import PersonState

ITERATIONS = 2
"""Iterations that refine a pose with one new limb."""


FARTHER = 1.2
"""Times by which the sparse distance may grow; beyond it the new arm hides measured points."""


@dataclass(frozen=True)
class LimbExchange:
    """Refines candidates one after the other and keeps the pose that leaves least unexplained so far.

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
        """The best of a pose (P,), as it `compared` with the frame, and the `candidates` (P,) to take its place."""
        for candidate in candidates:
            refined = self.refiner.refine(body, candidate, scene, iterations=ITERATIONS)
            tried = self.objective.compare(body, refined, scene, FARTHER * compared.distance)
            if unexplained(tried, self.settings) < unexplained(compared, self.settings) - self.settings.margin:
                pose, compared = refined, tried
        return pose, compared


class ArmSearch:
    """Looks for better arms of the best pose of a person who is being followed.

    Decided by what a pose leaves unexplained of the frame and by the pose prior. The other parts of the sparse distance
    do not help here: they are least for an arm that hides in the body. So what is found takes the place of what it
    came from.

    Parameters
    ----------
    poses : the arms of the database
    objective, refiner : compare the answers with the frame, and refine
    settings : see `ArmSettings`
    period : of `DatabaseLookup`: where its turn comes arms wait, so that no frame bears both; 1 = they never do
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
        """See `Search.propose`."""
        queried = self._period > 1 and not state.lost and is_asked(state, self._period)
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
    """What decides between arms, metres: how far the samples are from the drawn body, and how unlikely the pose is."""
    if not np.isfinite(compared.distance):
        return np.inf
    return float(compared.sample_gaps.mean()) + settings.prior * compared.energy
