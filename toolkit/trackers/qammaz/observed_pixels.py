"""Image joints as input of a search: rays, 3-D positions, and sides."""

from __future__ import annotations

import math

import numpy as np

from toolkit.body import skeleton
from toolkit.body.rotations import quaternions as quat
from toolkit.fitting.terms import CARRIED
from toolkit.kernels import linear
from toolkit.kernels.image.raster import NEAREST
from toolkit.sensing.joints2d import BEHIND_SKIN
from toolkit.trackers.qammaz.discrepancy import JOINT_WEIGHTS, SeenJoints
from toolkit.tracking.observation import Observation

TRUNK = [skeleton.REPORTED.index(f"{side}_{name}") for name in ("shoulder", "hip") for side in ("left", "right")]


def seen_joints(observation: Observation, *, on_skin: bool = False) -> SeenJoints | None:
    """Return the detected joints with positions half a limb behind the skin, or `on_skin`.

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
    """Return the same joints with left and right exchanged."""
    return SeenJoints(*(part[list(skeleton.OTHER_SIDE)] for part in seen))


def sides_exchanged(seen: SeenJoints, previous: np.ndarray) -> bool:
    """Return whether the detector exchanged left and right, by `previous` joints (20, 3), camera frame, metres."""
    weights = np.where(CARRIED, JOINT_WEIGHTS * seen.confidence, 0.0)
    if not weights.any():
        return False
    weights /= weights.sum()
    before = previous[:, :2] / np.maximum(previous[:, 2:], NEAREST)
    away, other = (
        float(np.median(previous[:, 2])) * linear.dot(weights, _lengths(s.slopes - before))
        for s in (seen, exchanged(seen))
    )
    # Minimum distance in metres of the previous joints from the detected ones, and maximum ratio after an exchange of
    # left and right, for exchanged sides of the detector.
    swapped = (0.08, 0.6)
    return away > swapped[0] and other < swapped[1] * away


def gap(seen: SeenJoints | None, joints: np.ndarray) -> float:
    """Return the weighted mean distance of joints (20, 3), camera frame, from their detected positions, metres."""
    if seen is None:
        return 0.0
    weights = np.where(np.isfinite(seen.points[:, 0]) & CARRIED, JOINT_WEIGHTS * seen.confidence, 0.0)
    if not weights.any():
        return 0.0
    return linear.dot(weights, linear.lengths(joints - np.nan_to_num(seen.points))) / float(weights.sum())


def _lengths(vectors: np.ndarray) -> np.ndarray:
    """Return the length of each of `vectors` (N, 2), 0 for NaN."""
    return np.nan_to_num(np.sqrt((vectors**2).sum(axis=1)))


def first_poses(observation: Observation, seen: SeenJoints | None) -> list[np.ndarray]:
    """Return standing poses (P,), level frame, with position and orientation of shoulders and hips.

    Without all four, the person is upright at the centre and faces as the surface does, or the opposite way. In a side
    view the far shoulder projects onto the near one, so both orders are returned.
    """
    trunk = None if seen is None else np.where(seen.confidence[:, None] > 0.0, seen.points, np.nan)[list(TRUNK)]
    if trunk is None or not np.isfinite(trunk).all():
        up, facing = np.array([0.0, 1.0, 0.0]), np.array([observation.facing[0], 0.0, observation.facing[1]])
        return [_standing(observation.centre, np.cross(up, way * facing), up) for way in (1.0, -1.0)]
    left_shoulder, right_shoulder, left_hip, right_hip = linear.rotated(trunk, observation.cloud.rotation.T)
    place = 0.5 * (left_hip + right_hip)
    up = _unit(left_shoulder + right_shoulder - left_hip - right_hip)
    left = 0.5 * (left_shoulder - right_shoulder + left_hip - right_hip)
    ahead = _unit(place - linear.dot(place, up) * up)  # away from the camera at the origin
    sideways = 0.12  # minimum depth order between left and right that counts, metres across the view
    if abs(linear.dot(left, np.cross(up, ahead))) < sideways:
        return [_standing(place, ahead, up), _standing(place, -ahead, up)]
    return [_standing(place, left, up)]


def _standing(place: np.ndarray, left: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return the pose (P,) of a person upright along `up`, with the left side as nearly as possible along `left`."""
    left = _unit(left - linear.dot(left, up) * up)
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[skeleton.ROOT_POSITION] = place
    pose[skeleton.ROOT_ROTATION] = quat.logarithm(quat.from_matrices(np.stack([left, up, np.cross(left, up)], axis=1)))
    return pose


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / max(math.hypot(*vector), 1e-9)
