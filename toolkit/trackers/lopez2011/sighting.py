"""Observation of the particle filter: cloud, candidates and images of an upper body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.scene import Scene
from toolkit.io.errors import SettingsError
from toolkit.people.detection import find_heads
from toolkit.people.sighting import Sighting
from toolkit.people.view import CoarseCamera
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.trackers.lopez2011.costs import ParticleFrame
from toolkit.trackers.lopez2011.effectors import Effectors


class Limits(NamedTuple):
    """Limits of the upper body in a sighting, metres; see `ParticleTrackerSettings`."""

    reach: float
    lap: float


class UpperSighting:
    """Observation of an upper body in one frame.

    Attributes
    ----------
    cloud : level frame
    unobserved : bool (h, w), pixels of the cloud without information about the upper body, or None
    points : measured pixels of the person in the whole sighting
    """

    def __init__(self, cloud: Cloud, unobserved: np.ndarray | None, points: int) -> None:
        self.cloud, self.unobserved, self.points = cloud, unobserved, points

    def frame(self, effectors: Effectors) -> ParticleFrame:
        """Return the frame of the filter."""
        return ParticleFrame.of(self.cloud.depth, self.unobserved, self.cloud.camera, effectors.points)

    def scene(self, effectors: Effectors, settings: FittingSettings) -> Scene:
        """Return the scene of the local optimisation."""
        return Scene(self.cloud, effectors.points, settings.cloud_samples, unobserved=self.unobserved)


class UpperViewer:
    """Maker of observations for one camera, at a lower resolution and within the reach of upper bodies.

    Parameters
    ----------
    camera : camera of the sightings
    level_rotation : R_level_camera, float64 (3, 3)
    columns : maximum width of the images, pixels
    limits : bounds of the used points

    Raises
    ------
    SettingsError
        The image has fewer columns than `columns`, the setting `particles.columns`.
    """

    def __init__(self, camera: Camera, level_rotation: np.ndarray, columns: int, limits: Limits) -> None:
        if columns > camera.width:
            raise SettingsError(f"particles.columns is {columns}, finer than the image with {camera.width} columns")
        self._level_rotation, self._limits = level_rotation, limits
        self._step = camera.width // columns
        self._camera = camera.subsampled(self._step)
        self._coarse = CoarseCamera(self._camera, level_rotation[1], SensingSettings(), self._camera.width)

    def observe(self, sighting: Sighting, crown: float | None = None) -> UpperSighting:
        """Return the observation of an upper body; `crown` is the height of its head, metres, level frame.

        The default crown is the highest head in the image; without a head the whole cloud is used.
        """
        step = self._step
        depth = sighting.depth[::step, ::step]
        unobserved = None if sighting.unobserved is None else sighting.unobserved[::step, ::step]
        cloud = Cloud.from_depth(depth, self._camera, self._level_rotation)
        points = len(cloud) * step * step
        if self._limits.reach > 0 and crown is None:
            crown = self._crown(depth)
        if self._limits.reach > 0 and crown is not None and len(cloud):
            below = cloud.pixels[self._beyond(cloud.points, crown)]
            if len(below):
                unobserved = np.zeros(depth.shape, dtype=np.bool_) if unobserved is None else unobserved.copy()
                depth = depth.copy()
                unobserved.reshape(-1)[below], depth.reshape(-1)[below] = True, 0.0
                cloud = Cloud.from_depth(depth, self._camera, self._level_rotation)
        return UpperSighting(cloud, unobserved, points)

    def _beyond(self, points: np.ndarray, crown: float) -> np.ndarray:
        """Return which of `points` (N, 3), level frame, are not part of an upper body: bool (N,).

        These are points too far below the crown, and low points in front of the trunk: a lap, knees, a desk in the
        mask.
        """
        depths = crown - points[:, 1]
        beyond = depths > self._limits.reach
        low = depths > self._limits.lap
        # Percentile of the distances of upper points that gives the trunk's distance; hands are in front of it.
        trunk_share = 75
        # Distance in front of the trunk from which low points belong to a lap, metres: the thickness of the trunk.
        before = 0.2
        if self._limits.lap > 0 and not low.all():
            away = np.hypot(points[:, 0], points[:, 2])
            beyond |= low & (away < np.percentile(away[~low], trunk_share) - before)
        return beyond

    def _crown(self, depth: np.ndarray) -> float | None:
        """Return the height of the most probable head in a depth image (h, w), metres, level frame."""
        seen = depth > 0
        view = self._coarse.view(np.ascontiguousarray(depth, dtype=np.float32), seen, np.zeros_like(seen))
        heads = find_heads(view, self._coarse)
        top = 0.12  # distance from the middle of a head to its crown, metres
        return float(heads[0].place[1]) + top if heads else None
