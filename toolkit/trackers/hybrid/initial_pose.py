"""Verification of first poses: the best poses of different facings are refined alike before the selection.

A body seen from behind has nearly the outline and the depth of one seen from the front, with its arms bent the other
way. Whichever of the two a search happens to finish better wins, and is followed for good.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from toolkit.database import canonical
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.trackers.hybrid.aimed import AimedArms
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.database_lookup import FIRST_ROUNDS
from toolkit.tracking.search.search_protocol import Hypothesis, ScoredHypothesis, cost_of

APART = math.radians(60.0)
"""Turn between two facings from which on no refinement leads from one to the other."""


class InitialPoseVerifier:
    """Finishes the hypotheses of a first frame, or of one after a loss; the nearest of them is the person's pose.

    The best of each body, the best that faces elsewhere than the best of all, and that one turned to the other side
    have their arms brought to where the cloud ends (Lopez-Mendez 2011, 2.2). A wrong size, too, is often the nearest
    only until the arms are where they belong. No person is turned without a regressor: its votes know front from back,
    a depth image alone does not.

    Parameters
    ----------
    objective, refiner : compare poses with the frame, and refine
    arms : aims at the ends of the cloud
    """

    name = "head_hands"

    def __init__(self, objective: Objective, refiner: Refiner, arms: AimedArms) -> None:
        self._objective, self._refiner, self._arms = objective, refiner, arms

    def verified(self, observation: Observation, scored: Sequence[ScoredHypothesis]) -> list[ScoredHypothesis]:
        """See `Verifier.verified`: `scored` are the hypotheses of all searches and bodies."""
        aimed = [self._arms.of(each, observation) for each in best_of_each_body(scored)]
        best = min(aimed, key=cost_of)
        others = facing_elsewhere(best, scored)
        if observation.votes is not None:
            others.append(self._turned(best, observation))
        return aimed + [self._arms.of(each, observation) for each in others]

    def _turned(self, best: ScoredHypothesis, observation: Observation) -> ScoredHypothesis:
        """The other way round, refined: with its limbs or with their mirror image, whichever is nearer."""
        both = []
        iterations = FIRST_ROUNDS * self._refiner.settings.iterations
        for turned in other_ways_round(best.hypothesis.pose):
            pose = self._refiner.refine(best.body, turned, observation.scene, iterations=iterations)
            compared = self._objective.compare(best.body, pose, observation.scene)
            hypothesis = Hypothesis(best.hypothesis.source, pose, compared)
            both.append(ScoredHypothesis.of(hypothesis, best.body, compared, anew=True))
        return min(both, key=cost_of)


def best_of_each_body(scored: Sequence[ScoredHypothesis]) -> list[ScoredHypothesis]:
    """The hypothesis of least cost of every body."""
    best: dict[int, ScoredHypothesis] = {}
    for each in sorted(scored, key=cost_of, reverse=True):
        best[id(each.body)] = each
    return list(best.values())


def facing_elsewhere(best: ScoredHypothesis, scored: Sequence[ScoredHypothesis]) -> list[ScoredHypothesis]:
    """Of those that face at least `APART` from the best one the one of least cost, if there are any."""
    yaw = float(canonical.body_facing(best.hypothesis.pose))
    turns = [float(canonical.body_facing(each.hypothesis.pose)) - yaw for each in scored]
    apart = [each for each, turn in zip(scored, turns, strict=True) if abs(math.remainder(turn, math.tau)) >= APART]
    return sorted(apart, key=cost_of)[:1]


def other_ways_round(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A pose (P,) of a y-up frame turned by 180 degrees in its place, with its limbs and with their mirror image."""
    own, position, yaw = canonical.canonicalise(pose)
    turned, mirrored = (
        canonical.place(limbs, np.zeros(4), position, yaw + np.pi) for limbs in (own, canonical.mirrored(own))
    )
    return turned, mirrored
