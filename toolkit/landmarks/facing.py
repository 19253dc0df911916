"""Facing of a person from the plane of the torso, and its temporal smoothing (Baak 2013, 5.3.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.kernels import linear
from toolkit.kernels.cloud import torso
from toolkit.landmarks.landmark_settings import LandmarkSettings


@dataclass(frozen=True)
class FacingEstimate:
    """Facing of one frame.

    Attributes
    ----------
    yaw : radians in (-pi, pi], about +y from +z: the person faces (sin yaw, 0, cos yaw) in the level frame
    weight : in [0, 1], flatness and roundness of the torso patch; 0 without an estimate, then `yaw` points at the
        camera
    """

    yaw: float
    weight: float


def camera_yaw(centre: np.ndarray) -> float:
    """Return the yaw of a person at `centre` (3,), level frame, who faces the camera, radians."""
    return math.atan2(-centre[0], -centre[2])


def estimate_facing(
    points: np.ndarray, centre: np.ndarray, settings: LandmarkSettings | None = None, scale: float = 1.0
) -> FacingEstimate:
    """Estimate the facing of a cloud from the plane through the points on its chest.

    The normal of the plane is the eigenvector of the smallest eigenvalue of the covariance, turned to the camera and
    projected onto the ground. A chest is rounded and only its front is visible, so the normal turns less than the body:
    the angle between the normal and the direction to the camera is multiplied by `turn_gain`.

    If an arm occludes the torso, the patch is curved (large smallest eigenvalue) or not round (different larger
    eigenvalues), and the weight falls linearly between the bounds of both. It also falls with the horizontal part of
    the normal. The estimate is valid up to about 60 degrees from the camera, because a torso seen from the side has no
    visible front.

    Parameters
    ----------
    points : float32 (N, 3), metres, level frame
    centre : (3,), metres, level frame, from `cloud_centre`
    settings : place of the patch, and gain
    scale : size of the person against an adult, multiplies height and radius
    """
    settings = settings or LandmarkSettings()
    centre = np.asarray(centre, dtype=np.float64)
    mean, covariance = np.empty(3), np.empty((3, 3))
    chest = centre + [0.0, scale * settings.chest_height, 0.0]
    torso_radius = 0.15  # radius of the torso patch around the middle of an adult's chest, metres (from the paper)
    count = torso.ball_moments(points, chest, scale * torso_radius, mean, covariance)
    towards_camera = camera_yaw(centre)
    smallest_torso = 30  # minimum number of points of a torso patch
    if count < smallest_torso:
        return FacingEstimate(towards_camera, 0.0)
    values, vectors = linear.principal_axes(covariance)
    if values[2] <= 0.0:
        return FacingEstimate(towards_camera, 0.0)
    normal = vectors[:, 0]
    if linear.dot(normal, centre) > 0.0:
        normal = -normal
    curvature = max(values[0], 0.0) / values.sum()
    circularity = values[1] / values[2]
    # Fractions of the smallest eigenvalue in the sum of all three: above the first the normal is ignored, below the
    # second the torso counts as flat.
    curved_share, flat_share = 0.08, 0.03
    flat = _ramp(curvature, curved_share, flat_share)
    # Ratios of the two larger eigenvalues: below the first the normal is ignored, above the second the patch counts
    # as round.
    long_ratio, round_ratio = 0.35, 0.65
    round_ = _ramp(circularity, long_ratio, round_ratio)
    horizontal = math.hypot(normal[0], normal[2])
    turn = settings.turn_gain * _wrapped(math.atan2(normal[0], normal[2]) - towards_camera)
    return FacingEstimate(_wrapped(towards_camera + turn), flat * round_ * horizontal)


def _wrapped(angle: float) -> float:
    """Wrap an angle to (-pi, pi]."""
    return math.atan2(math.sin(angle), math.cos(angle))


def _ramp(value: float, zero: float, one: float) -> float:
    """Return 0 at `zero` and 1 at `one`, linear between them and constant outside."""
    return min(max((value - zero) / (one - zero), 0.0), 1.0)


def smoothed_facing(
    direction: np.ndarray | None, estimate: FacingEstimate, dt: float, centre: np.ndarray
) -> np.ndarray:
    """Return the smoothed facing (2,) in the ground plane, x and z, after the estimate of one more frame.

    A low-pass filter with the weight of the estimate as its rate: an estimate of weight w moves the direction by the
    fraction 1 - exp(-w dt / time constant). One long step therefore equals two short ones, and an occluded torso leaves
    the direction unchanged. The vector form has no discontinuity at pi.

    Parameters
    ----------
    direction : (2,), value `dt` seconds ago; None in a first frame, which gets the mean of the estimate, by its weight,
        and of facing the camera
    centre : (3,), of the cloud, level frame
    """
    measured = np.array([np.sin(estimate.yaw), np.cos(estimate.yaw)])
    if direction is None:
        prior = camera_yaw(centre)
        direction = np.array([np.sin(prior), np.cos(prior)])
        share = estimate.weight
    else:
        time_constant = 0.15  # seconds, at weight 1
        share = 1.0 - np.exp(-estimate.weight * max(dt, 0.0) / time_constant)
    return direction + share * (measured - direction)
