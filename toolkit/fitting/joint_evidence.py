"""Evidence of joints besides the depth: image joints, and joints that the joint network estimates."""

from __future__ import annotations

import math

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import BELOW
from toolkit.fitting.placed import NormalSystem, PlacedBody
from toolkit.fitting.terms import CARRIED, CARRIERS, carried, pull
from toolkit.kernels import linear
from toolkit.landmarks.joint_network import RELIABLE_WITHIN, JointEstimate
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D

CAP = 0.2
"""Maximum excess distance of a joint, metres, as `FittingSettings.unexplained` for a point."""
RAY_TOLERANCE = 0.05
"""Distance from the ray of its pixel within which a joint has no cost, metres: the error of detectors."""
PULL = 20.0
"""Weight of a joint with confidence 1 relative to one correspondence, equal to that of the vertices around it."""
OUT_OF_VIEW = 0.2
"""Probability of being in view below which a joint counts as out of view."""

SIDES = (np.arange(len(skeleton.REPORTED)), np.array(skeleton.OTHER_SIDE))
"""Joint index of each pixel, int64 (20,) each: as detected, and with left and right exchanged."""


class SightedJoints:
    """Evidence that joints lie on the rays of their pixels: colour shows an arm in front of the trunk, depth does not.

    Both assignments of left and right are tried, because detectors sometimes confuse back and front.

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
        excess = np.maximum(1.0 - RAY_TOLERANCE / np.maximum(lengths, RAY_TOLERANCE), 0.0)
        return self._weights[side], away * excess[:, None]


def _joints(placed: PlacedBody) -> np.ndarray:
    """Return the joints carried by the body, float64 (20, 3), camera frame, metres; the others are 0."""
    return np.array([carried(placed, *place) if place[0] >= 0 else np.zeros(3) for place in CARRIERS])


def _mean(weighted: tuple[np.ndarray, np.ndarray]) -> float:
    weights, beyond = weighted
    total = float(weights.sum())
    return 0.0 if total == 0.0 else linear.dot(weights, np.minimum(linear.lengths(beyond), CAP)) / total


class EstimatedJoints:
    """Evidence that reliable joints lie within 10 cm of their estimates.

    It prevents a fit with a wrong body size before the body is estimated.

    Parameters
    ----------
    estimate : level frame
    rotation : R_level_camera, float64 (3, 3)
    weight : weight of one sure joint against one correspondence
    """

    def __init__(self, estimate: JointEstimate, rotation: np.ndarray, weight: float) -> None:
        sure = 0.8  # minimum reliability of an estimate that is used as evidence
        self._rows = [
            row for row, (carrier, _) in enumerate(CARRIERS) if carrier >= 0 and estimate.reliability[row] >= sure
        ]
        self._targets = linear.rotated(estimate.points, rotation)
        self._weight = weight

    def attract(self, system: NormalSystem, placed: PlacedBody) -> None:
        """See `FrameEvidence.attract`: joints are attracted to within 10 cm of their estimates."""
        sigma = 0.3  # scale of the Geman-McClure weight of the excess distance, metres
        for row in self._rows:
            point, beyond = self._beyond(placed, row)
            if beyond.any():
                pull(system, CARRIERS[row][0], point, beyond, self._weight, sigma)

    def cost(self, placed: PlacedBody) -> float:
        """See `FrameEvidence.cost`: mean excess distance of the reliable joints."""
        if not self._rows:
            return 0.0
        return sum(min(math.hypot(*self._beyond(placed, row)[1]), CAP) for row in self._rows) / len(self._rows)

    def _beyond(self, placed: PlacedBody, row: int) -> tuple[np.ndarray, np.ndarray]:
        """Return a reported joint (3,) and its excess vector from its estimate (3,), camera frame, metres."""
        point = carried(placed, *CARRIERS[row])
        away = point - self._targets[row]
        length = math.hypot(*away)
        return point, away * max(1.0 - RELIABLE_WITHIN / max(length, RELIABLE_WITHIN), 0.0)


def links_out_of_view(in_view: np.ndarray) -> np.ndarray:
    """Return the joints whose links and descendants are all out of view: bool (18,), by `in_view` (20,)."""
    return np.asarray(((in_view < OUT_OF_VIEW) | ~_ENDS).all(axis=1))


def _end_of(carrier: int, site: int) -> int:
    """Return the joint whose link ends at a reported joint with this entry in `CARRIERS`; -1 for derived joints."""
    return carrier if site >= 0 or carrier < 0 else int(skeleton.PARENTS[carrier])


_ENDS: np.ndarray = np.stack([BELOW[:, end] & (end >= 0) for end in (_end_of(*place) for place in CARRIERS)], axis=1)
"""Bool (18, 20): True if the link of a joint, or of a descendant, ends at a reported joint; each joint has one."""
