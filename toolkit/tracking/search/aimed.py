"""Arms brought to where the cloud ends, by inverse kinematics (Lopez-Mendez 2011, 2.2)."""

from __future__ import annotations

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.arms import SIDES, Arm, ArmSettings, entries_of
from toolkit.fitting.initial import sides_of
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.upper import UpperBodies
from toolkit.kernels import aiming
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.arms import FARTHER, ITERATIONS, unexplained
from toolkit.tracking.search.protocol import Hypothesis, Rival

SOURCE = "particles"
"""What a pose with other arms is called."""
CANDIDATES = 8
"""Geodesic extrema in the order found: head and both hands are among them in 96 % of frames from the waist up."""
SWIVELS = 12
"""Of an arm whose hand is at a candidate: 30 degrees apart."""
AIM = aiming.Aim(0.05, 0.0, -8.0)
"""A hand may be 20 cm beside its candidate: the fit does the rest."""


class AimedArms:
    """Each arm of a pose at the extrema of its own side, at many swivels, held against the frame as balls, fitted and
    refined; what decides is that of `ArmSearch`.

    Parameters
    ----------
    objective, refiner : compare what is found with the frame, and refine
    settings : see `ArmSettings`
    bodies : whose arms are aimed
    """

    def __init__(self, objective: Objective, refiner: Refiner, settings: ArmSettings, bodies: UpperBodies) -> None:
        self._objective, self._refiner, self._settings, self._bodies = objective, refiner, settings, bodies

    def of(self, rival: Rival, observation: Observation) -> Rival:
        """A rival with arms that leave less unexplained; the same one if there are none."""
        pose, compared, settings = rival.hypothesis.pose, rival.comparison, self._settings
        candidates = sides_of(observation.free_extrema[:CANDIDATES], pose)
        for side, own in zip(SIDES, candidates, strict=True):
            for candidate in self._tried(side, rival.body, pose, compared, own, observation):
                refined = self._refiner.refine(rival.body, candidate, observation.scene, iterations=ITERATIONS)
                bound = FARTHER * compared.distance
                tried = self._objective.compare(rival.body, refined, observation.scene, bound)
                if unexplained(tried, settings) < unexplained(compared, settings) - settings.margin:
                    pose, compared = refined, tried
        if pose is rival.hypothesis.pose:
            return rival
        return Rival(Hypothesis(SOURCE, pose, compared), rival.body, compared)

    def _tried(
        self, side: str, body: Body, pose: np.ndarray, compared: Comparison, candidates: np.ndarray,
        observation: Observation,
    ) -> list[np.ndarray]:  # fmt: skip
        """`pose` (P,) with one arm at candidates that leaves less unexplained; the best first."""
        count = SWIVELS * len(candidates)
        if count == 0:
            return []
        rig = self._bodies.of(body).arms[SIDES.index(side)]
        poses, scores = np.repeat(pose[None], count, axis=0), np.empty(count)
        swivels = np.tile(np.linspace(-np.pi, np.pi, SWIVELS, endpoint=False), len(candidates))
        targets = np.repeat(candidates, SWIVELS, axis=0)
        aiming.aim_arms(poses, rig, np.ones(count, dtype=np.bool_), targets, swivels, AIM, scores)
        reached = poses[np.isfinite(scores)]
        if len(reached) == 0:
            return []
        arm = Arm(side, body, np.ascontiguousarray(reached[:, entries_of(side)]))
        s = self._settings
        return arm.propose(pose, compared, observation.scene, s, self._refiner.settings.sigma, s.refined)
