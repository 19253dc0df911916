"""Head and hands where the cloud ends: the proposals of Lopez-Mendez 2011."""

from __future__ import annotations

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.arms import SIDES, Arm, ArmSettings, entries_of
from toolkit.fitting.initial import InitialSettings, initial_pose, sides_of
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.particles import ParticleFrame, ParticleImage, ParticleSettings, UpperFilter
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.upper import UpperBodies
from toolkit.kernels import aiming
from toolkit.landmarks.effectors import EffectorSettings, find_effectors, find_fork
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.arms import FARTHER, ITERATIONS, unexplained
from toolkit.tracking.search.lookup import FIRST_ROUNDS
from toolkit.tracking.search.protocol import NOTHING, Hypothesis, Proposal, Rival
from toolkit.tracking.state import PersonState

CANDIDATES = 8
"""Geodesic extrema in the order found: head and both hands are among them in 96 % of frames from the waist up."""
SWIVELS = 12
"""Of an arm whose hand is at a candidate: 30 degrees apart."""
AIM = aiming.Aim(0.05, 0.0, -8.0)
"""A hand may be 20 cm beside its candidate: the fit does the rest."""


FORK = EffectorSettings()
"""How head and hands are looked for where nothing is known of the person yet."""
ROUNDS = InitialSettings(rounds=4)
"""How the first pose is found: less often filtered than by the particle filter alone, because it is refined."""


class ParticleSearch:
    """The proposals of Lopez-Mendez 2011 on a first frame and after a loss.

    Head and hands are looked for by the fork of their paths (3); the filtered pose is refined and competes by its
    distance. Then each arm of the best hypothesis is brought to the candidates of its own side by inverse kinematics,
    at many swivels (2.2), held against the frame as balls, fitted and refined; what decides is that of `ArmSearch`.
    While somebody is followed it says nothing: arms of the database find the way back as well.

    Parameters
    ----------
    objective, refiner : compare the answers with the frame, and refine
    settings : see `ArmSettings`
    level_rotation : R_level_camera, float64 (3, 3)
    """

    name = "particles"

    def __init__(
        self, objective: Objective, refiner: Refiner, settings: ArmSettings, level_rotation: np.ndarray
    ) -> None:
        self._objective, self._refiner, self._settings = objective, refiner, settings
        self._bodies, self._filter = UpperBodies(level_rotation), UpperFilter(ParticleSettings())

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: Rival | None
    ) -> Proposal:
        """See `Search.propose`."""
        if state.previous is not None:
            return NOTHING
        firsts = self._by_the_fork(observation, state.body, rng)
        for first in firsts:
            assert first.comparison is not None
            if best is None or first.comparison.distance < best.comparison.distance:
                best = Rival(first, state.body, first.comparison)
        # While the size is unknown each body has its turn, and the best of them may be another's.
        if best is None or best.body is not state.body:
            return Proposal(firsts)
        pose, compared = self._aimed(observation, best)
        if pose is best.hypothesis.pose:
            return Proposal(firsts)
        supersedes = best.hypothesis not in firsts
        return Proposal((*firsts, Hypothesis("particles", pose, compared, supersedes=supersedes)))

    def _by_the_fork(self, observation: Observation, body: Body, rng: np.random.Generator) -> tuple[Hypothesis, ...]:
        """The first pose of Lopez-Mendez 2011, 3, refined; nothing without a fork."""
        cloud = observation.cloud
        effectors = find_effectors(cloud, FORK, observation.unobserved)
        fork = find_fork(effectors, FORK)
        if fork is None:
            return ()
        settings, width = self._filter.settings, cloud.camera.width
        coarse, fine = (
            ParticleImage.of(cloud.depth, observation.unobserved, cloud.camera, min(columns, width), "columns")
            for columns in (settings.trunk_columns, settings.arm_columns)
        )
        frame = ParticleFrame(coarse, fine, effectors.points)
        first = initial_pose(self._bodies.of(body), self._filter, effectors, fork, frame, ROUNDS, rng)
        iterations = FIRST_ROUNDS * self._refiner.settings.iterations
        pose = self._refiner.refine(body, first.pose, observation.scene, iterations=iterations)
        compared = self._objective.compare(body, pose, observation.scene)
        return (Hypothesis("particles", pose, compared),)

    def _aimed(self, observation: Observation, best: Rival) -> tuple[np.ndarray, Comparison]:
        """The best hypothesis with arms that leave less unexplained, if there are any."""
        pose, compared, settings = best.hypothesis.pose, best.comparison, self._settings
        candidates = sides_of(observation.free_extrema[:CANDIDATES], pose)
        for side, own in zip(SIDES, candidates, strict=True):
            for candidate in self._tried(side, best.body, pose, compared, own, observation):
                refined = self._refiner.refine(best.body, candidate, observation.scene, iterations=ITERATIONS)
                bound = FARTHER * compared.distance
                tried = self._objective.compare(best.body, refined, observation.scene, bound)
                if unexplained(tried, settings) < unexplained(compared, settings) - settings.margin:
                    pose, compared = refined, tried
        return pose, compared

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
