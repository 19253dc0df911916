"""Verification of first poses: the best poses with different facings are refined equally before the selection.

Front and back view of a body have nearly the same outline and depth, with the arms bent in opposite directions. Without
verification, the tracker would keep the one with the better refinement.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from toolkit.database import canonical
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.io.parts import Parts
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.arm_search import SOURCE, NetworkArms
from toolkit.tracking.search.database_lookup import FIRST_ROUNDS
from toolkit.tracking.search.search_protocol import Hypothesis, ScoredHypothesis, cost_of


class InitialPoseVerifier:
    """Refiner of the hypotheses of a first frame or of a frame after a loss; the nearest one is selected.

    Candidates are the best of each body size, the best with a clearly different facing, and the best of all turned by
    180 degrees. Their arms are moved to the joints of the network, because a wrong body size often fits better until
    the arms are right. Turning requires the joint network, since depth alone does not separate front from back.

    Parameters
    ----------
    objective, refiner : compare poses with the frame, and refine
    arms : moves the arms
    """

    name = SOURCE

    def __init__(self, objective: Objective, refiner: Refiner, arms: NetworkArms) -> None:
        self._objective, self._refiner, self._arms = objective, refiner, arms

    def verified(self, observation: Observation, scored: Sequence[ScoredHypothesis]) -> Parts[list[ScoredHypothesis]]:
        """See `Verifier.verified`: `scored` are the hypotheses of all searches and bodies."""
        candidates = []
        for each in best_of_each_body(scored):
            candidates.append(self._with_better_arms(each, observation))
            yield
        best = min(candidates, key=cost_of)
        others = facing_elsewhere(best, scored)
        if observation.estimate is not None:
            others.append(self._turned(best, observation))
        return candidates + [self._with_better_arms(each, observation) for each in others]

    def _with_better_arms(self, scored: ScoredHypothesis, observation: Observation) -> ScoredHypothesis:
        """Return the hypothesis with better arms, or the same one."""
        found = self._arms.better(scored, observation)
        if found is None or found.comparison is None:
            return scored
        return ScoredHypothesis.of(found, scored.body, found.comparison, redetected=True)

    def _turned(self, best: ScoredHypothesis, observation: Observation) -> ScoredHypothesis:
        """Return the refined pose turned by 180 degrees, with its own or with mirrored limbs, by lower cost."""
        both = []
        iterations = FIRST_ROUNDS * self._refiner.settings.iterations
        for turned in other_ways_round(best.hypothesis.pose):
            pose = self._refiner.refine(best.body, turned, observation.scene, iterations=iterations)
            compared = self._objective.compare(best.body, pose, observation.scene)
            hypothesis = Hypothesis(best.hypothesis.source, pose, compared)
            both.append(ScoredHypothesis.of(hypothesis, best.body, compared, redetected=True))
        return min(both, key=cost_of)


def best_of_each_body(scored: Sequence[ScoredHypothesis]) -> list[ScoredHypothesis]:
    """Return the hypothesis with the lowest cost for each body."""
    best: dict[int, ScoredHypothesis] = {}
    for each in sorted(scored, key=cost_of, reverse=True):
        best[id(each.body)] = each
    return list(best.values())


def facing_elsewhere(best: ScoredHypothesis, scored: Sequence[ScoredHypothesis]) -> list[ScoredHypothesis]:
    """Return the best hypothesis that faces at least 60 degrees away from the best one of all, or an empty list."""
    min_turn = math.radians(60.0)  # between two facings that no refinement connects
    yaw = float(canonical.body_facing(best.hypothesis.pose))
    turns = [float(canonical.body_facing(each.hypothesis.pose)) - yaw for each in scored]
    apart = [each for each, turn in zip(scored, turns, strict=True) if abs(math.remainder(turn, math.tau)) >= min_turn]
    return sorted(apart, key=cost_of)[:1]


def other_ways_round(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a pose (P,) of a y-up frame turned by 180 degrees in place, with its limbs and with mirrored limbs."""
    own, position, yaw = canonical.canonicalise(pose)
    turned, mirrored = (
        canonical.place(limbs, np.zeros(4), position, yaw + np.pi) for limbs in (own, canonical.mirrored(own))
    )
    return turned, mirrored
