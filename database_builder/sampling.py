"""Truncated greedy sampling of poses (Baak 2013, 5.3.3), in bounded memory for any amount of mocap.

Poses arrive source by source. Up to `PART` of them are kept unchanged, and the selection is plain farthest-first. More
are thinned in parts by farthest-first too, and the selection uses the remaining poses of all parts: a composable
core-set (Malkomes et al. 2015). A pose is then within the cover of its part of a remaining pose, which is within the
cover of the selection of a selected one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from database_builder.reading import CanonicalPoses
from toolkit.body import skeleton
from toolkit.database.database import PoseOrigins
from toolkit.io.errors import DatabaseError, UsageError
from toolkit.kernels.learning import farthest

PART = 500_000
"""Number of poses that are thinned together (200 MB)."""
JOINT_COUNT = len(skeleton.REPORTED)


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


class Rows(NamedTuple):
    """Candidate poses: float32 (N, P), joints (N, 20, 3), metres, source index, frame (int32) and mirror flag."""

    poses: np.ndarray
    joints: np.ndarray
    source: np.ndarray
    frame: np.ndarray
    mirrored: np.ndarray

    @classmethod
    def empty(cls, count: int) -> Rows:
        """Return rows of uninitialised memory, which the system allocates when they are filled."""
        return cls(
            np.empty((count, skeleton.POSE_SIZE), np.float32), np.empty((count, len(skeleton.REPORTED), 3), np.float32),
            np.empty(count, np.int32), np.empty(count, np.int32), np.empty(count, np.bool_),
        )  # fmt: skip

    @classmethod
    def of(cls, one: CanonicalPoses, number: int) -> Rows:
        """Return all poses of source `number`."""
        place = np.arange(len(one.poses), dtype=np.int32)
        source = np.full(len(place), number, np.int32)
        return cls(one.poses, one.joints, source, place % max(one.frames, 1), place >= one.frames)

    def taken(self, rows: np.ndarray | slice) -> Rows:
        """Return some of the rows."""
        return Rows(*(column[rows] for column in self))


class PosePool:
    """Collector of poses with selection.

    Parameters
    ----------
    threshold, max_poses : those of the selection, see `farthest_first`
    """

    def __init__(self, threshold: float, max_poses: int | None) -> None:
        self._threshold, self._max_poses = threshold, max_poses
        self._left: list[Rows] = []
        self._open, self._filled, self._cover = Rows.empty(PART), 0, 0.0
        self.names: list[str] = []
        self.digests: list[str] = []
        self.poses_read = 0

    def add(self, one: CanonicalPoses) -> None:
        """Add the poses of the next source."""
        rows = Rows.of(one, len(self.names))
        self.names.append(one.name)
        self.digests.append(one.digest)
        self.poses_read += len(one.poses)
        start = 0
        while start < len(one.poses):
            if self._filled == PART:
                self._thin()
            count = min(PART - self._filled, len(one.poses) - start)
            for column, new in zip(self._open, rows, strict=True):
                column[self._filled : self._filled + count] = new[start : start + count]
            self._filled += count
            start += count

    def _thin(self) -> None:
        """Thin the open part to poses near all others, in their original order."""
        part = self._open.taken(slice(self._filled))
        # One of this many poses of a part remains, unless more are requested in total; 20 MB for a million poses.
        left = 20
        most = max(PART // left, self._max_poses or 0)
        chosen = farthest_first(part.joints, 0.5 * self._threshold, most)
        if len(chosen) > 1:
            last = pose_distance(part.joints[chosen[:-1]], part.joints[chosen[-1]]).min()
            self._cover = max(self._cover, float(last), 0.5 * self._threshold)
        self._left.append(part.taken(np.sort(chosen)))
        self._filled = 0

    def origins(self, selected: Rows) -> PoseOrigins:
        """Return the origins of the selected poses."""
        return PoseOrigins(self.names, self.digests, selected.source, selected.frame, selected.mirrored)

    def select(self) -> tuple[Rows, dict[str, float]]:
        """Return the selected poses in the order of selection; the pool is empty afterwards.

        With them, empty without thinning, the number of remaining candidates, and the maximum distance of a pose from
        the nearest of them, metres in the unit of Eq. 5.1.
        """
        if not self._left:
            left = self._open.taken(slice(self._filled))
        else:
            self._thin()
            columns = list(zip(*self._left, strict=True))
            self._left, self._open = [], Rows.empty(0)
            left = Rows(*(np.concatenate(columns.pop(0)) for _ in Rows._fields))
        thinned = {"poses": len(left.poses), "cover": self._cover} if self._cover else {}
        return left.taken(farthest_first(left.joints, self._threshold, self._max_poses)), thinned
