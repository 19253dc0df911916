"""The poses that the sampling chooses from, in bounded memory, however much mocap there is.

Poses come source by source. Up to `PART` of them are kept as they are, and the selection is plain farthest-first. More
are thinned part by part as they come, each part by farthest-first too, and the selection chooses from what is left of
all parts: a composable core-set (Malkomes et al. 2015). A pose is then within the cover of its part of a pose that is
left, and that one within the cover of the selection of a selected one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from database_builder.reading import CanonicalPoses
from database_builder.sampling import farthest_first, pose_distance
from toolkit.body import skeleton
from toolkit.database.database import PoseOrigins

PART = 500_000
"""Poses that are thinned together: 200 MB of them."""
LEFT = 20
"""One of so many poses of a part is left, or as many as are wanted in all: 20 MB for a million poses."""


class Rows(NamedTuple):
    """Poses to choose from: float32 (N, P) and their joints (N, 20, 3), metres; of each the number of its source, its
    frame there (int32) and whether it is a mirror image.
    """

    poses: np.ndarray
    joints: np.ndarray
    source: np.ndarray
    frame: np.ndarray
    mirrored: np.ndarray

    @classmethod
    def empty(cls, count: int) -> Rows:
        """So many rows that hold anything; memory is taken as they are filled."""
        return cls(
            np.empty((count, skeleton.POSE_SIZE), np.float32), np.empty((count, len(skeleton.REPORTED), 3), np.float32),
            np.empty(count, np.int32), np.empty(count, np.int32), np.empty(count, np.bool_),
        )  # fmt: skip

    @classmethod
    def of(cls, one: CanonicalPoses, number: int) -> Rows:
        """All poses of source `number`."""
        place = np.arange(len(one.poses), dtype=np.int32)
        source = np.full(len(place), number, np.int32)
        return cls(one.poses, one.joints, source, place % max(one.frames, 1), place >= one.frames)

    def taken(self, rows: np.ndarray | slice) -> Rows:
        """Some of the rows."""
        return Rows(*(column[rows] for column in self))


@dataclass(frozen=True, eq=False)
class Selection:
    """What was selected, in the order of selection.

    Attributes
    ----------
    rows : the poses
    thinned : how many poses were left to choose from and how far a pose can be from the nearest of them, metres in the
        unit of Eq. 5.1; empty where all were there
    """

    rows: Rows
    thinned: dict[str, float]


class PosePool:
    """Collects poses and selects among them.

    Parameters
    ----------
    threshold, max_poses : of the selection, see `farthest_first`
    """

    def __init__(self, threshold: float, max_poses: int | None) -> None:
        self._threshold, self._max_poses = threshold, max_poses
        self._left: list[Rows] = []
        self._open, self._filled, self._cover = Rows.empty(PART), 0, 0.0
        self.names: list[str] = []
        self.digests: list[str] = []
        self.poses_read = 0

    def add(self, one: CanonicalPoses) -> None:
        """Take the poses of the next source."""
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
        """Keep the few poses of the open part from which all others are not far, in the order in which they came."""
        part = self._open.taken(slice(self._filled))
        most = max(PART // LEFT, self._max_poses or 0)
        chosen = farthest_first(part.joints, 0.5 * self._threshold, most)
        if len(chosen) > 1:
            last = pose_distance(part.joints[chosen[:-1]], part.joints[chosen[-1]]).min()
            self._cover = max(self._cover, float(last), 0.5 * self._threshold)
        self._left.append(part.taken(np.sort(chosen)))
        self._filled = 0

    def origins(self, selected: Selection) -> PoseOrigins:
        """Where the selected poses come from."""
        rows = selected.rows
        return PoseOrigins(self.names, self.digests, rows.source, rows.frame, rows.mirrored)

    def select(self) -> Selection:
        """The selection; the pool is empty afterwards."""
        if not self._left:
            left = self._open.taken(slice(self._filled))
        else:
            self._thin()
            columns = list(zip(*self._left, strict=True))
            self._left, self._open = [], Rows.empty(0)
            left = Rows(*(np.concatenate(columns.pop(0)) for _ in Rows._fields))
        thinned = {"poses": len(left.poses), "cover": self._cover} if self._cover else {}
        return Selection(left.taken(farthest_first(left.joints, self._threshold, self._max_poses)), thinned)
