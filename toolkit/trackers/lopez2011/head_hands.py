"""Search for head and hands at extrema of the cloud: the first pose of Lopez-Mendez 2011."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.io.typed_values import constant
from toolkit.landmarks.graph import Workspace
from toolkit.trackers.lopez2011.effectors import EffectorSettings, find_fork
from toolkit.trackers.lopez2011.filter import UpperFilter
from toolkit.trackers.lopez2011.filter_settings import ParticleSettings
from toolkit.trackers.lopez2011.initial import InitialSettings, initial_pose
from toolkit.trackers.lopez2011.sighting import UpperSighting
from toolkit.trackers.lopez2011.upper import UpperBodies
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.database_lookup import FIRST_ROUNDS
from toolkit.tracking.search.search_protocol import NOTHING, Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import PersonState


@dataclass(frozen=True)
class HeadHandSettings:
    """Settings of this search.

    Attributes
    ----------
    effectors : search for head and hands without a previous pose
    initial : settings of the first pose; fewer rounds than in the particle filter, because the pose is refined
    particles : settings of the filter
    """

    effectors: EffectorSettings = constant(EffectorSettings())
    initial: InitialSettings = constant(InitialSettings(rounds=4, unlabelled=False))
    particles: ParticleSettings = constant(ParticleSettings())


class HeadHandSearch:
    """Search with the first pose of Lopez-Mendez 2011, on first frames and after losses.

    Head and hands are found by the fork of their paths (3); the filtered pose is refined and competes by its distance.
    While a person is tracked it proposes nothing, because the arm search is as good.

    Parameters
    ----------
    settings : see `HeadHandSettings`
    objective, refiner : compare the answers with the frame, and refine
    bodies : upper bodies of the filter
    """

    name = "head_hands"

    def __init__(self, settings: HeadHandSettings, objective: Objective, refiner: Refiner, bodies: UpperBodies) -> None:
        self._settings, self._objective, self._refiner = settings, objective, refiner
        self._bodies, self._filter = bodies, UpperFilter(settings.particles)

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """See `Search.propose`."""
        if state.previous is not None:
            return NOTHING
        return Proposal(self._found(observation, state.body, rng))

    def _found(self, observation: Observation, body: Body, rng: np.random.Generator) -> tuple[Hypothesis, ...]:
        """Return the first pose of Lopez-Mendez 2011, 3, refined; nothing without a fork."""
        cloud, settings = observation.cloud, self._filter.settings
        width = cloud.camera.width
        small = replace(
            settings, trunk_columns=min(settings.trunk_columns, width), arm_columns=min(settings.arm_columns, width)
        )
        seen = UpperSighting(cloud, observation.unobserved, len(cloud), small)
        effectors = seen.effectors(self._settings.effectors, Workspace())
        fork = find_fork(effectors, self._settings.effectors)
        if fork is None:
            return ()
        frame = seen.frame(effectors)
        first = initial_pose(self._bodies.of(body), self._filter, effectors, fork, frame, self._settings.initial, rng)
        assert first is not None
        iterations = FIRST_ROUNDS * self._refiner.settings.iterations
        pose = self._refiner.refine(body, first.pose, observation.scene, iterations=iterations)
        compared = self._objective.compare(body, pose, observation.scene)
        return (Hypothesis("head_hands", pose, compared),)
