"""Truncated greedy sampling of poses (Baak 2013, 5.3.3): the plain farthest-first selection with fast search."""

from __future__ import annotations

import math

import numpy as np

from toolkit.body.skeleton import REPORTED
from toolkit.io.errors import DatabaseError, UsageError
from toolkit.kernels.learning import farthest

JOINT_COUNT = len(REPORTED)


def pose_distance(joints: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return `d_P` of Eq. 5.1, `(1 / 20) ||P - P'||` of stacked joints (..., 20, 3), metres.

    Two poses whose joints are all 0.08 m apart have `d_P` = 0.08 / sqrt(20) = 0.018 m.
    """
    difference = np.asarray(joints, dtype=np.float64) - np.asarray(others, dtype=np.float64)
    return np.sqrt((difference**2).sum(axis=(-2, -1))) / JOINT_COUNT


def farthest_first(joints: np.ndarray, threshold: float = 0.0, max_count: int | None = None) -> np.ndarray:
    """Select poses such that any two are farther apart than `threshold` and each pose is within it of a selected one.

    Plain farthest-first: it starts with pose 0 and always adds the pose farthest from the selected ones, of equals the
    lowest index, by float32 squared distances with the rounding of `numpy.sum((a - b) ** 2, axis=1)`.

    Parameters
    ----------
    joints : (N, 20, 3) or (N, 60), metres, the reported joints in the canonical frame; taken as float32
    threshold : in the unit of Eq. 5.1, metres, at least 0; the selection stops once no pose is farther. Exact
        duplicates of a selected pose are never selected
    max_count : alternative stop, at least 1; None = no limit

    Returns
    -------
    int64 (K,) indices in the order of selection

    Raises
    ------
    UsageError
        `threshold` is negative or not finite, or `max_count` is below 1.
    DatabaseError
        There is no pose, the shape is another one, or a coordinate is not finite.
    """
    if not (math.isfinite(threshold) and threshold >= 0):
        raise UsageError(f"the sampling threshold is {threshold}; use metres in the unit of Eq. 5.1, for example 0.018")
    if max_count is not None and max_count < 1:
        raise UsageError(f"the maximum number of poses is {max_count}; use at least 1")
    array = np.asarray(joints)
    if array.shape[1:] not in ((JOINT_COUNT, 3), (farthest.WIDTH,)):
        raise DatabaseError(f"joints to sample have shape {array.shape}; expected (N, {JOINT_COUNT}, 3)")
    points = np.ascontiguousarray(array.reshape(len(array), farthest.WIDTH), dtype=np.float32)
    if not len(points):
        raise DatabaseError("there is no pose to sample from; give at least one clip with frames")
    if not np.isfinite(points).all():
        raise DatabaseError("a joint to sample is not finite; check the clip that it was read from")
    stop = np.float32((JOINT_COUNT * threshold) ** 2)
    return farthest.farthest_first(points, stop, len(points) if max_count is None else max_count)
