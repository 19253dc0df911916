"""Joints in the image as a search needs them: with rays and places, their sides the right way round."""

from __future__ import annotations

import math

import numpy as np

from toolkit.body import skeleton
from toolkit.body.rotations import quaternions as quat
from toolkit.fitting.terms import CARRIED
from toolkit.kernels import linear
from toolkit.sensing.joints2d import BEHIND_SKIN
from toolkit.trackers.qammaz.discrepancy import JOINT_WEIGHTS, SeenJoints
from toolkit.tracking.observation import Observation

SWAPPED = (0.08, 0.6)
"""Metres that the previous joints are away from the seen ones, and the share of it from the seen ones with left and
right exchanged: then a detector has taken one side for the other."""
SIDEWAYS = 0.12
"""Metres between left and right, across the view, below which it is not known which of them is in front."""
TRUNK = [skeleton.REPORTED.index(f"{side}_{name}") for name in ("shoulder", "hip") for side in ("left", "right")]
NEAR = 0.05
"""Metres before the camera."""


def seen_joints(observation: Observation, *, on_skin: bool = False) -> SeenJoints | None:
    """The joints of the image, those that count as found, in space half a limb behind the skin or `on_skin` itself.

    None without any.
    """
    joints, lifted = observation.joints, observation.lifted
    if joints is None or lifted is None:
        return None
    camera = observation.cloud.camera
    pixels = joints.pixels.astype(np.float64)
    slopes = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    points = linear.rotated(lifted.points, observation.cloud.rotation)
    if on_skin:
        points *= ((points[:, 2] - BEHIND_SKIN) / points[:, 2])[:, None]
    return SeenJoints(slopes, points, np.where(joints.sure, joints.confidence.astype(np.float64), 0.0))


def exchanged(seen: SeenJoints) -> SeenJoints:
    """The same joints, left and right the other way round."""
    return SeenJoints(*(part[list(skeleton.OTHER_SIDE)] for part in seen))


def looks_exchanged(seen: SeenJoints, previous: np.ndarray) -> bool:
    """Whether a detector has taken one side for the other: `previous` joints (20, 3), camera frame, metres, say so."""
    weights = np.where(CARRIED, JOINT_WEIGHTS * seen.confidence, 0.0)
    if not weights.any():
        return False
    weights /= weights.sum()
    before = previous[:, :2] / np.maximum(previous[:, 2:], NEAR)
    away, other = (
        float(np.median(previous[:, 2])) * linear.dot(weights, _lengths(s.slopes - before))
        for s in (seen, exchanged(seen))
    )
    return away > SWAPPED[0] and other < SWAPPED[1] * away


def gap(seen: SeenJoints | None, joints: np.ndarray) -> float:
    """Weighted mean distance of joints (20, 3), camera frame, from where they were seen in space, metres."""
    if seen is None:
        return 0.0
    weights = np.where(np.isfinite(seen.points[:, 0]) & CARRIED, JOINT_WEIGHTS * seen.confidence, 0.0)
    if not weights.any():
        return 0.0
    return linear.dot(weights, linear.lengths(joints - np.nan_to_num(seen.points))) / float(weights.sum())


def _lengths(vectors: np.ndarray) -> np.ndarray:
    """Length of each of `vectors` (N, 2), 0 for unknown ones."""
    return np.nan_to_num(np.sqrt((vectors**2).sum(axis=1)))


def first_poses(observation: Observation, seen: SeenJoints | None) -> list[np.ndarray]:
    """Standing poses (P,), level frame, placed and turned as shoulders and hips are.

    Where these are not all seen: upright at the person's centre, and facing as their surface does, or away from it.
    From the side the far shoulder lies on the near one: then either of them may be in front.
    """
    trunk = None if seen is None else np.where(seen.confidence[:, None] > 0.0, seen.points, np.nan)[list(TRUNK)]
    if trunk is None or not np.isfinite(trunk).all():
        up, facing = np.array([0.0, 1.0, 0.0]), np.array([observation.facing[0], 0.0, observation.facing[1]])
        return [_standing(observation.centre, np.cross(up, way * facing), up) for way in (1.0, -1.0)]
    left_shoulder, right_shoulder, left_hip, right_hip = linear.rotated(trunk, observation.cloud.rotation.T)
    place = 0.5 * (left_hip + right_hip)
    up = _unit(left_shoulder + right_shoulder - left_hip - right_hip)
    left = 0.5 * (left_shoulder - right_shoulder + left_hip - right_hip)
    ahead = _unit(place - linear.dot(place, up) * up)  # away from the camera, which is at the origin
    if abs(linear.dot(left, np.cross(up, ahead))) < SIDEWAYS:
        return [_standing(place, ahead, up), _standing(place, -ahead, up)]
    return [_standing(place, left, up)]


def _standing(place: np.ndarray, left: np.ndarray, up: np.ndarray) -> np.ndarray:
    """The pose (P,) of a person upright along `up`, whose left side points as nearly as possible along `left`."""
    left = _unit(left - linear.dot(left, up) * up)
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[skeleton.ROOT_POSITION] = place
    pose[skeleton.ROOT_ROTATION] = quat.logarithm(quat.from_matrices(np.stack([left, up, np.cross(left, up)], axis=1)))
    return pose


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / max(math.hypot(*vector), 1e-9)
