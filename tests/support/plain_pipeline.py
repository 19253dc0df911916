"""Hybrid tracker with SciPy's Dijkstra, Open3D's kd-trees and NumPy, the reference for the compiled one.

Plain are the landmarks, the solver and the drawn body; correspondences and lookup are the settings `open3d`, as in
`configs/baak2013.yaml`. Cleaning, the joint network and the arms' chains of balls are the compiled ones.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np

from tests.support.plain_fitting import PlainObjective, PlainPlacer, plain_refiner
from tests.support.plain_landmarks import plain_centre, plain_extrema, plain_graph, plain_source
from toolkit.body.body import Body
from toolkit.database.database import PoseDatabase
from toolkit.landmarks.extrema import Extrema
from toolkit.sensing.camera import Camera
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracking.follower import Follower
from toolkit.tracking.observation import Observation, Observer


class PlainObservation(Observation):
    """Observation whose landmarks come from SciPy and NumPy."""

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


class PlainObserver(Observer):
    """Observer with SciPy and NumPy."""

    kind = PlainObservation


class PlainTracker(HybridTracker):
    """Hybrid tracker without compiled code; the body is learnt by the same compiled code in both."""

    def __init__(self, database: PoseDatabase, settings: HybridSettings | None = None) -> None:
        settings = settings or HybridSettings()
        searched = replace(settings.lookup, search="open3d"), replace(settings.fitting, correspondences="open3d")
        super().__init__(database, replace(settings, lookup=searched[0], fitting=searched[1]))

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
