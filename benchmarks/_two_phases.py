"""Qammaz, 3.3: a second swarm about each solution, on the depth alone, which gained the paper less than 5 mm."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.trackers.qammaz.discrepancy import Discrepancy
from toolkit.trackers.qammaz.swarm import minimise
from toolkit.trackers.qammaz.swarm_search import ANGLES, SwarmSearch
from toolkit.trackers.qammaz.tracker import SwarmTracker
from toolkit.tracking.search.search_protocol import Search


class TwoPhaseSearch(SwarmSearch):
    """A swarm, and about its solution a second one, whose objective is the depth term alone."""

    def _finished(self, frame: Any, body: Body, costs: Discrepancy, position: np.ndarray) -> Any:
        """The solution of the second phase as a pose."""
        pose, s = costs.pose_of(position), self._settings
        settings = replace(self._discrepancy, joints_2d=0.0, joints_3d=0.0)
        depth = frame.discrepancy(body, pose, settings, previous=True)
        starts, half = depth.position_of(pose[None]), np.full(len(pose), s.window)
        half[skeleton.ROOT_POSITION] = s.reach
        limits = self._window(starts[0], half)
        # Of its own randomness, so that the first phase is that of the row beside it.
        rng = np.random.default_rng(0)
        second = minimise(depth, starts, limits, self._swarm, rng, perturbed=ANGLES).position
        return super()._finished(frame, body, depth, second)


class TwoPhaseTracker(SwarmTracker):
    """The paper's tracker with a second phase."""

    def searches(self, objective: Objective, refiner: Refiner) -> tuple[Search, ...]:
        """See `SwarmTracker.searches`."""
        s = self.settings
        return (TwoPhaseSearch(s.search, s.swarm, s.discrepancy, objective, refiner),)
