"""Poses that a guide proposes: the best hypothesis so far as the motion is expected to go."""

from __future__ import annotations

import numpy as np

from toolkit.fitting.arms import ArmSettings
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.refiner import Refiner
from toolkit.tracking.guide import Guide
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.exchange import LimbExchange
from toolkit.tracking.search.protocol import NOTHING, Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import PersonState


class GuidedSearch:
    """Refines what a guide proposes beside the best pose of a person who is being followed.

    Decided by the sparse distance and what the pose costs its priors, as arms are: a limb that nobody sees leaves
    nothing unexplained wherever it is.

    Parameters
    ----------
    guide : what proposes
    objective, refiner : what compares and refines
    settings : `prior` and `margin` of the comparison
    """

    name = "guided"

    def __init__(self, guide: Guide, objective: Objective, refiner: Refiner, settings: ArmSettings) -> None:
        self._guide, self._prior = guide, settings.prior
        self._exchange = LimbExchange(objective, refiner, self._cost, settings.margin)

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """See `Search.propose`."""
        if best is None:
            return NOTHING
        pose = best.hypothesis.pose
        candidates = self._guide.poses(observation.timestamp, pose)
        pose, compared = self._exchange.best(best.body, pose, best.comparison, candidates, observation.scene)
        if pose is best.hypothesis.pose:
            return NOTHING
        return Proposal((Hypothesis("guided", pose, compared, improves=best),))

    def _cost(self, compared: Comparison) -> float:
        return compared.distance + self._prior * compared.energy
