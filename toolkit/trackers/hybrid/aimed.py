"""Inverse kinematics of arms to extrema of the cloud (Lopez-Mendez 2011, 2.2)."""

from __future__ import annotations

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.arms import SIDES, Arm, ArmSettings, entries_of
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.scene import Scene
from toolkit.kernels.fit import aiming
from toolkit.trackers.lopez2011.initial import sides_of
from toolkit.trackers.lopez2011.upper import UpperBodies, aimed_all_round
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.arm_search import LimbExchange
from toolkit.tracking.search.search_protocol import Hypothesis, ScoredHypothesis

SOURCE = "head_hands"
"""Name of the hypothesis of a pose with replaced arms."""


class AimedArms:
    """Arm search at extrema of the arm's own side: many swivels are compared with the frame as balls, then fitted and
    refined; the acceptance test is that of `ArmSearch`.

    Parameters
    ----------
    objective, refiner : compare the found poses with the frame, and refine them
    settings : see `ArmSettings`
    bodies : bodies with the arms
    """

    def __init__(self, objective: Objective, refiner: Refiner, settings: ArmSettings, bodies: UpperBodies) -> None:
        self._settings, self._sigma, self._bodies = settings, refiner.settings.sigma, bodies
        self._exchange = LimbExchange(objective, refiner, settings)

    def of(self, scored: ScoredHypothesis, observation: Observation) -> ScoredHypothesis:
        """Return the hypothesis with arms that leave less depth unexplained, or the same one."""
        pose, compared, scene = scored.hypothesis.pose, scored.comparison, observation.scene
        # Number of geodesic extrema, in the order found; head and both hands are among them in 96 % of frames from
        # the waist up.
        most_candidates = 8
        candidates = sides_of(observation.free_extrema[:most_candidates], pose)
        for side, own in zip(SIDES, candidates, strict=True):
            proposed = self._proposed(side, scored.body, pose, compared, own, scene)
            pose, compared = self._exchange.best(scored.body, pose, compared, proposed, scene)
        if pose is scored.hypothesis.pose:
            return scored
        return ScoredHypothesis.of(Hypothesis(SOURCE, pose, compared), scored.body, compared, redetected=True)

    def _proposed(
        self, side: str, body: Body, pose: np.ndarray, compared: Comparison, candidates: np.ndarray, scene: Scene
    ) -> list[np.ndarray]:
        """Return the versions of `pose` (P,) with one arm at a candidate that leave less unexplained, best first."""
        rig = self._bodies.of(body).arms[SIDES.index(side)]
        swivels = 12  # number of swivel samples of an arm with its hand at a candidate (30 degrees apart)
        aim = aiming.Aim(0.05, 0.0, -8.0)  # within 5 cm of a candidate; the fit corrects the rest
        poses, _ = aimed_all_round(pose, rig, candidates, swivels, aim)
        if len(poses) == 0:
            return []
        arm = Arm(side, body, np.ascontiguousarray(poses[:, entries_of(side)]))
        return arm.propose(pose, compared, scene, self._settings, self._sigma, self._settings.refined)
