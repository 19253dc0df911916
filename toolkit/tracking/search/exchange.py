"""One limb of a pose exchanged: of candidates that differ in it alone, the one that a frame bears out best."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.scene import Scene

ITERATIONS = 2
"""Iterations that refine a pose with one new limb."""


@dataclass(frozen=True)
class LimbExchange:
    """Refines candidates one after the other and keeps the cheapest pose so far.

    Attributes
    ----------
    objective, refiner : compare with the frame, and refine
    cost : of a compared pose, what decides
    margin : by which a candidate must be cheaper
    farther : how many times its sparse distance may be that of the pose it replaces
    """

    objective: Objective
    refiner: Refiner
    cost: Callable[[Comparison], float]
    margin: float
    farther: float = np.inf

    def best(
        self, body: Body, pose: np.ndarray, compared: Comparison, candidates: Iterable[np.ndarray], scene: Scene
    ) -> tuple[np.ndarray, Comparison]:
        """The best of a pose (P,), as it `compared` with the frame, and the `candidates` (P,) to take its place."""
        for candidate in candidates:
            refined = self.refiner.refine(body, candidate, scene, iterations=ITERATIONS)
            tried = self.objective.compare(body, refined, scene, self.farther * compared.distance)
            if self.cost(tried) < self.cost(compared) - self.margin:
                pose, compared = refined, tried
        return pose, compared
