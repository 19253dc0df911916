"""Distances between estimated and true joints, and their statistics.

All statistics include all frames, the first one too. Joints with unknown truth (NaN) are left out.
"""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import TrackError
from toolkit.sensing.camera import Camera

ERROR_CAP = 1.0
"""Maximum error of a joint, metres; larger errors are capped."""
CORRECT_WITHIN = 0.1
"""Threshold of A(100), metres."""
LOST_ERROR = 0.2
"""Mean joint error above which a frame counts as lost, metres."""
CURVE = np.arange(0.0, 0.301, 0.005)
"""Thresholds t of the accuracy curve A(t), metres."""
HANDS_AND_FEET = np.array([i for i, name in enumerate(skeleton.REPORTED) if name.split("_")[-1] in ("hand", "foot")])
"""Indices of hands and feet among the reported joints."""
TRUNK = ("pelvis", "spine", "neck", "head", "left_hip", "right_hip")
SURFACE_REACH = np.array([0.2 if name in TRUNK else 0.12 for name in skeleton.REPORTED])
"""Maximum distance along z from the measured surface to the centre of a visible joint, metres: centres lie up to 14 cm
(trunk) and 7 cm (limbs) inside an average adult."""


def joint_errors(joints: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return the distance of each joint to the true one, capped at 1 m: float64 (T, 20), metres, NaN = unknown truth.

    Parameters
    ----------
    joints, truth : (T, 20, 3), metres, in one frame of reference

    Raises
    ------
    TrackError
        The two arrays have different shapes.
    """
    if joints.shape != truth.shape:
        raise TrackError(f"joints {joints.shape} cannot be compared with {truth.shape}; give one row per frame to both")
    return np.minimum(np.linalg.norm(np.asarray(joints, np.float64) - truth, axis=-1), ERROR_CAP)


def accuracy(errors: np.ndarray, threshold: float | np.ndarray = CORRECT_WITHIN) -> np.ndarray:
    """Return A(t), the fraction of known joints within `threshold` metres, one value per threshold."""
    known = errors[np.isfinite(errors)]
    thresholds = np.asarray(threshold, dtype=np.float64)
    if known.size == 0:
        return np.full(thresholds.shape, np.nan)
    return np.searchsorted(np.sort(known), thresholds, side="right") / known.size


def frame_errors(errors: np.ndarray) -> np.ndarray:
    """Return the mean error of each frame over its known joints: float64 (T,), metres, NaN without any."""
    known = np.isfinite(errors)
    count = known.sum(axis=1)
    return np.where(count > 0, np.where(known, errors, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)


def visible_joints(joints_camera: np.ndarray, depth_m: np.ndarray, camera: Camera) -> np.ndarray:
    """Return which joints are visible to the camera: bool (..., 20).

    A joint is visible if a surface is measured within 2 pixels of its projection and within
    `SURFACE_REACH` along z. Joints outside the image, in a hole of the depth image, or behind another limb, a person or
    furniture are hidden.

    Parameters
    ----------
    joints_camera : (..., 20, 3), metres, true joints of one or several people; NaN counts as hidden
    depth_m : float32 (H, W), metres along z, 0 = no measurement
    camera : camera of that image
    """
    joints = np.asarray(joints_camera, dtype=np.float64)
    pixels = np.rint(np.nan_to_num(camera.project(joints), nan=-1.0))
    inside = ((pixels >= 0) & (pixels < [camera.width, camera.height])).all(axis=-1)
    column, row = pixels[inside].astype(np.int64).T
    half_width = 2  # pixels around the projection of a joint that are searched for the surface
    padded = np.pad(depth_m, half_width)
    around = np.stack([padded[row + i, column + j] for i, j in np.ndindex(*2 * (2 * half_width + 1,))])
    reach = np.broadcast_to(SURFACE_REACH, inside.shape)[inside]
    seen = np.zeros(inside.shape, dtype=bool)
    seen[inside] = ((around > 0) & (np.abs(around - joints[inside, 2]) < reach)).any(axis=0)
    return seen
