"""The hybrid tracker from SciPy's Dijkstra, SciPy's kd-tree and NumPy: what the compiled one is held against.

Plain are the landmarks, the correspondences, the solver, the drawn body and the lookup; cleaning, the joint regressor
and the arms' chains of balls are the compiled ones.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from tests.support.plain_fitting import PlainObjective, PlainPlacer, PlainScene, plain_refiner
from tests.support.plain_landmarks import plain_centre, plain_extrema, plain_graph, plain_source
from tests.support.searches import ScipySearch
from toolkit.body.body import Body
from toolkit.database.database import PoseDatabase
from toolkit.fitting.scene import Scene
from toolkit.landmarks.extrema import Extrema
from toolkit.sensing.camera import Camera
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracking.follower import Follower
from toolkit.tracking.observation import Observation, Observer


class PlainObservation(Observation):
    """An observation whose landmarks come from SciPy and NumPy."""

    @cached_property
    def centre(self) -> np.ndarray:
        """See `Observation.centre`."""
        return plain_centre(self.cloud.points, self._state.centre, self.scale)

    @cached_property
    def extrema(self) -> Extrema:
        """See `Observation.extrema`."""
        landmarks, points = self.observer.landmarks, self.cloud.points
        matrix, largest = plain_graph(self.cloud, landmarks)
        source = plain_source(points, largest, self.centre, landmarks, self.scale)
        return plain_extrema(matrix, points, source, self.observer.extrema)

    @cached_property
    def scene(self) -> Scene:
        """See `Observation.scene`."""
        extrema = self.extrema.points.astype(np.float64)
        marks = {"unobserved": self.unobserved, "cut": self.cut, "withheld": self.withheld}
        return PlainScene(self.cloud, extrema, self.observer.samples, self.evidence, **marks)


class PlainObserver(Observer):
    """Looks at sightings by SciPy and NumPy."""

    kind = PlainObservation


class PlainTracker(HybridTracker):
    """The hybrid tracker, from NumPy and SciPy alone; the body is learnt by the compiled code, the same for both."""

    def __init__(self, database: PoseDatabase, settings: HybridSettings | None = None) -> None:
        super().__init__(replace(database, search=ScipySearch), settings)

    def follower(self, camera: Camera, level_rotation: np.ndarray, body: Body | None = None) -> Follower:
        """See `Tracker.follower`."""
        compiled = super().follower(camera, level_rotation, body)
        fitting, objective = self.settings.fitting, compiled.objective
        placer = PlainPlacer.like(objective.placer)
        return self.assembled(
            PlainObjective(placer, fitting, objective.pose_terms),
            plain_refiner(placer, fitting, objective.pose_terms),
            PlainObserver(**vars(compiled.observer)),
            level_rotation,
            compiled.state,
        )
