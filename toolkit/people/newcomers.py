"""Candidates for new people: their distance from the people present, mirror images, and repeated detection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from toolkit.io.archives import Column
from toolkit.kernels import linear
from toolkit.people.detection import SHOULDER_DISTANCE
from toolkit.people.structure import Plane
from toolkit.people.view import CoarseCamera

# Places are (3,), level frame, metres.


def apart(head: np.ndarray, other: np.ndarray) -> bool:
    """Return True if two heads on one surface may be of two people."""
    aside = float(np.hypot(head[0] - other[0], head[2] - other[2]))
    # Pixels that exceed those beside the head belong to the back of a leaning person.
    level = abs(head[1] - other[1]) <= aside
    # Horizontal distance, metres, within which a place below a head on its surface is a knee of a seated person (0.55 m
    # below) or the back of a leaning one.
    knee_reach = 0.75
    return aside >= (SHOULDER_DISTANCE if level else knee_reach)


def in_a_mirror(place: np.ndarray, places: Sequence[np.ndarray], planes: Sequence[Plane], coarse: CoarseCamera) -> bool:
    """Return True if a head is behind a wall, at the mirror image of one of the `places` before it."""
    # Metres behind a wall, and metres from the mirror image of a head before it, for a head to be that mirror image;
    # walls are known to a few degrees.
    mirror_depth, mirror_gate = 0.3, 0.4
    for plane in planes:
        normal = coarse.to_level(plane.normal[None])[0]
        behind = linear.dot(normal, place) + plane.offset
        if behind < -mirror_depth:
            image = place - 2 * behind * normal
            if any(((image - other) ** 2).sum() < mirror_gate**2 for other in places):
                return True
    return False


@dataclass(frozen=True, eq=False)
class Newcomer:
    """Place of a head candidate: float64 (3,), level frame, metres; frames with it; first and last time."""

    place: Annotated[np.ndarray, Column("f", (3,), -1e3, 1e3)]
    frames: int
    first: float
    last: float


class Newcomers:
    """Candidates over frames.

    Attributes
    ----------
    waiting : those that do not count as people yet
    """

    CHECKPOINT = ("waiting", "_before")
    waiting: list[Newcomer]

    def __init__(self) -> None:
        self.waiting = []
        self._before = 0.0

    def promoted(
        self, candidates: Sequence[np.ndarray], touching: Sequence[bool], sure: Sequence[bool], timestamp: float
    ) -> list[int]:
        """Return the indices of the candidates, places (3,), that count as people.

        A candidate counts at once where it is `sure` and touches no other person (`touching`).
        """
        counted = [i for i in range(len(candidates)) if sure[i] and not touching[i]]
        left, kept = [i for i in range(len(candidates)) if i not in counted], []
        gate, walk = 0.3, 2.0  # m, and m/s, of a head's motion between frames
        least_frames = 2.5
        frames = 3  # minimum number of detections: noise does not repeat three times in one place
        # seconds of detections for a head on another person's surface: a knee or a fist may resemble one
        touching_time = 0.5
        patience = 0.3  # seconds without a detection after which a candidate is dropped
        for newcomer in self.waiting:
            away = [float(np.sqrt(((candidates[i] - newcomer.place) ** 2).sum())) for i in left]
            elapsed = timestamp - newcomer.last
            if away and min(away) < gate + walk * elapsed:
                nearest = left.pop(int(np.argmin(away)))
                newcomer = Newcomer(candidates[nearest], newcomer.frames + 1, newcomer.first, timestamp)
                lasted = timestamp - newcomer.first >= touching_time or not touching[nearest]
                if newcomer.frames >= frames and lasted:
                    counted.append(nearest)
                    continue
            if elapsed <= max(patience, least_frames * (timestamp - self._before)):
                kept.append(newcomer)
        self._before = timestamp
        self.waiting = kept + [Newcomer(candidates[i], 1, timestamp, timestamp) for i in left]
        return sorted(counted)
