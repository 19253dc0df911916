"""Poses that a guide proposes: the best hypothesis so far as the motion is expected to go."""

from __future__ import annotations

import numpy as np

from toolkit.fitting.arms import ArmSettings
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.refiner import Refiner
from toolkit.tracking.guide import Guide
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.protocol import NOTHING, Hypothesis, Proposal, Rival
from toolkit.tracking.state import PersonState

ITERATIONS = 2
"""Of the refinement of a pose of which only a limb is new."""


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
        self._guide, self._objective, self._refiner, self._settings = guide, objective, refiner, settings

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: Rival | None
    ) -> Proposal:
        """See `Search.propose`."""
        if best is None:
            return NOTHING
        body, scene = best.body, observation.scene
        pose, compared = best.hypothesis.pose, best.comparison
        for candidate in self._guide.poses(observation.timestamp, pose):
            refined = self._refiner.refine(body, candidate, scene, iterations=ITERATIONS)
            tried = self._objective.compare(body, refined, scene)
            if self._cost(tried) < self._cost(compared) - self._settings.margin:
                pose, compared = refined, tried
        if pose is best.hypothesis.pose:
            return NOTHING
        return Proposal((Hypothesis("guided", pose, compared, supersedes=True),))

    def _cost(self, compared: Comparison) -> float:
        return compared.distance + self._settings.prior * compared.energy
