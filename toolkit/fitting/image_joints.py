"""Evidence from image joints: colour shows an arm in front of the trunk where depth does not."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.fitting.placed import NormalSystem, PlacedBody
from toolkit.fitting.terms import CARRIED, CARRIERS, carried, pull
from toolkit.kernels import linear
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D

WITHIN = 0.05
"""Distance from the ray of its pixel within which a joint has no cost, metres: the error of detectors."""
CAP = 0.2
"""Maximum cost of a joint, metres, as `FittingSettings.unexplained` for a point."""
PULL = 20.0
"""Weight of a joint with confidence 1 relative to one correspondence, equal to that of the vertices around it."""

SIDES = (np.arange(len(skeleton.REPORTED)), np.array(skeleton.OTHER_SIDE))
"""Joint index of each pixel, int64 (20,) each: as detected, and with left and right exchanged."""


class SightedJoints:
    """Evidence that joints lie on the rays of their pixels.

    Both assignments of left and right are tried, because detectors confuse back and front, and depth separates them.

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
        """See `FrameEvidence.attract`: joints are attracted to within 5 cm of their rays."""
        points = _joints(placed)
        weights, beyond = min((self._beyond(points, side) for side in SIDES), key=_mean)
        sigma = 0.2  # scale of the Geman-McClure weight of a joint, metres
        for row in np.flatnonzero((weights > 0.0) & beyond.any(axis=1)):
            pull(system, CARRIERS[row][0], points[row], beyond[row], PULL * float(weights[row]), sigma)

    def cost(self, placed: PlacedBody) -> float:
        """See `FrameEvidence.cost`: weighted mean excess distance of the joints from their rays."""
        points = _joints(placed)
        return min(_mean(self._beyond(points, side)) for side in SIDES)

    def _beyond(self, points: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return weights (20,) of joints at `points` (20, 3), and their excess vectors from their rays (20, 3)."""
        rays = self._rays[side]
        away = points - linear.dots(points, rays)[:, None] * rays
        lengths = linear.lengths(away)
        return self._weights[side], away * np.maximum(1.0 - WITHIN / np.maximum(lengths, WITHIN), 0.0)[:, None]


def _joints(placed: PlacedBody) -> np.ndarray:
    """Return the joints carried by the body, float64 (20, 3), camera frame, metres; the others are 0."""
    return np.array([carried(placed, *place) if place[0] >= 0 else np.zeros(3) for place in CARRIERS])


def _mean(weighted: tuple[np.ndarray, np.ndarray]) -> float:
    weights, beyond = weighted
    total = float(weights.sum())
    return 0.0 if total == 0.0 else linear.dot(weights, np.minimum(linear.lengths(beyond), CAP)) / total
