"""Joints that a detector saw in the image as evidence: colour shows an arm before a trunk that depth does not."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.fitting.placed import NormalSystem, PlacedBody
from toolkit.fitting.terms import CARRIED, CARRIERS, carried, pull
from toolkit.kernels import linear
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D

WITHIN = 0.05
"""Metres beside the ray of its pixel within which a joint is where it was seen: what detectors are off."""
CAP = 0.2
"""Metres farther that a joint counts at most: what `FittingSettings.unexplained` is for a point."""
SIGMA = 0.2
"""Metres farther at which the pull has fallen to a quarter."""
PULL = 20.0
"""Weight of a joint that is seen with confidence 1 against one correspondence: as much as the vertices around it."""

SIDES = (np.arange(len(skeleton.REPORTED)), np.array(skeleton.OTHER_SIDE))
"""Whose pixel is whose, int64 (20,) each: as the detector calls them, and with left and right exchanged."""


class SightedJoints:
    """Joints lie on the rays of the pixels in which they were seen.

    Which side is which is not believed: detectors take backs for fronts, and depth knows better.

    Parameters
    ----------
    joints : in pixels of `camera`
    """

    def __init__(self, joints: Joints2D, camera: Camera) -> None:
        self._weights = np.where(CARRIED & joints.sure, joints.confidence.astype(np.float64), 0.0)
        slopes = (joints.pixels.astype(np.float64) - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
        rays = np.concatenate([np.where(self._weights[:, None] > 0.0, slopes, 0.0), np.ones((len(slopes), 1))], axis=1)
        self._rays = rays / linear.lengths(rays)[:, None]

    def attract(self, system: NormalSystem, placed: PlacedBody) -> None:
        """See `FrameEvidence.attract`: joints are drawn to within 5 cm of their rays, and no nearer."""
        points = _joints(placed)
        weights, beyond = min((self._beyond(points, side) for side in SIDES), key=_mean)
        for row in np.flatnonzero((weights > 0.0) & beyond.any(axis=1)):
            pull(system, CARRIERS[row][0], points[row], beyond[row], PULL * float(weights[row]), SIGMA)

    def cost(self, placed: PlacedBody) -> float:
        """See `FrameEvidence.cost`: how much too far the joints are from their rays, in the weighted mean."""
        points = _joints(placed)
        return min(_mean(self._beyond(points, side)) for side in SIDES)

    def _beyond(self, points: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weights (20,) of joints at `points` (20, 3), and by how much they are too far from their rays (20, 3)."""
        rays = self._rays[side]
        away = points - linear.dots(points, rays)[:, None] * rays
        lengths = linear.lengths(away)
        return self._weights[side], away * np.maximum(1.0 - WITHIN / np.maximum(lengths, WITHIN), 0.0)[:, None]


def _joints(placed: PlacedBody) -> np.ndarray:
    """The joints that the body carries, float64 (20, 3), camera frame, metres; the others are 0."""
    return np.array([carried(placed, *place) if place[0] >= 0 else np.zeros(3) for place in CARRIERS])


def _mean(weighted: tuple[np.ndarray, np.ndarray]) -> float:
    weights, beyond = weighted
    total = float(weights.sum())
    return 0.0 if total == 0.0 else linear.dot(weights, np.minimum(linear.lengths(beyond), CAP)) / total
