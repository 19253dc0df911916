"""The last word on a first frame: the best poses that face apart, brought equally far before one of them is believed.

A body seen from behind has nearly the outline and the depth of one seen from the front, with its arms bent the other
way. Whichever of the two a search happens to finish better wins by its distance, and is followed for good.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from toolkit.database import canonical
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.aimed import AimedArms
from toolkit.tracking.search.lookup import FIRST_ROUNDS
from toolkit.tracking.search.protocol import Hypothesis, Rival

FACINGS = 2
"""Rivals that are finished, besides the other way round of the best: more found nothing on the tuning splits."""
APART = math.radians(60.0)
"""Turn between two facings from which on no refinement leads from one to the other."""


class FirstFrames:
    """Finishes the hypotheses of a first frame, or of one after a loss; the nearest of them is the person's pose.

    The best of all bodies, the best that faces elsewhere, and the best turned to the other side have their arms brought
    to where the cloud ends (Lopez-Mendez 2011, 2.2).

    Parameters
    ----------
    objective, refiner : compare poses with the frame, and refine
    arms : aims at the ends of the cloud
    """

    name = "particles"

    def __init__(self, objective: Objective, refiner: Refiner, arms: AimedArms) -> None:
        self._objective, self._refiner, self._arms = objective, refiner, arms

    def finished(self, observation: Observation, rivals: Sequence[Rival]) -> list[Rival]:
        """Further rivals for a frame of which `rivals` is what every search said of every body."""
        chosen = facing_apart(rivals)
        return [self._arms.of(rival, observation) for rival in (*chosen, *self._turned(observation, chosen[:1]))]

    def _turned(self, observation: Observation, rivals: Sequence[Rival]) -> list[Rival]:
        """Each the other way round, refined: with its limbs or with their mirror image, whichever is nearer."""
        found = []
        iterations = FIRST_ROUNDS * self._refiner.settings.iterations
        for rival in rivals:
            both = []
            for turned in other_ways_round(rival.hypothesis.pose):
                pose = self._refiner.refine(rival.body, turned, observation.scene, iterations=iterations)
                compared = self._objective.compare(rival.body, pose, observation.scene)
                both.append(Rival(Hypothesis(rival.hypothesis.source, pose, compared), rival.body, compared))
            found.append(min(both, key=lambda other: other.comparison.distance))
        return found


def facing_apart(rivals: Sequence[Rival]) -> list[Rival]:
    """The nearest rivals that face at least `APART` from each other, at most `FACINGS`, the nearest first."""
    chosen: list[Rival] = []
    yaws: list[float] = []
    for rival in sorted(rivals, key=lambda rival: rival.comparison.distance):
        yaw = float(canonical.body_facing(rival.hypothesis.pose))
        if all(abs(math.remainder(yaw - other, math.tau)) >= APART for other in yaws):
            chosen.append(rival)
            yaws.append(yaw)
        if len(chosen) == FACINGS:
            break
    return chosen


def other_ways_round(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A pose (P,) of a y-up frame turned by 180 degrees in its place, with its limbs and with their mirror image."""
    own, position, yaw = canonical.canonicalise(pose)
    turned, mirrored = (
        canonical.place(limbs, np.zeros(4), position, yaw + np.pi) for limbs in (own, canonical.mirrored(own))
    )
    return turned, mirrored
