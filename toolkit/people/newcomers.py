"""Those who may have come into view, until they have been seen often enough to count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

GATE = 0.3  # m that a head moves from frame to frame
FRAMES = 3  # in which it must be seen: noise does not look like a head in the same place three times
TOUCHING_TIME = 0.5  # s for which it must be seen on somebody else's surface: a knee or a fist may look like a head
PATIENCE = 0.3  # s without being seen, after which it is forgotten


@dataclass(frozen=True, eq=False)
class Newcomer:
    """A place that looked like a head: float64 (3,), level frame, metres; in how many frames; when first and last."""

    place: np.ndarray
    frames: int
    first: float
    last: float


class Newcomers:
    """Remembers candidates from frame to frame."""

    def __init__(self) -> None:
        self._waiting: list[Newcomer] = []
        self._begun = False

    def promoted(self, candidates: Sequence[np.ndarray], touching: Sequence[bool], timestamp: float) -> list[int]:
        """Indices of the candidates, places (3,), that now count; in the first frame with any all of them.

        `touching` says which of them are on the surface of somebody who is there.
        """
        if not self._begun:
            self._begun = len(candidates) > 0
            return list(range(len(candidates)))
        left, counted, kept = list(range(len(candidates))), [], []
        for newcomer in self._waiting:
            away = [float(np.sqrt(((candidates[i] - newcomer.place) ** 2).sum())) for i in left]
            if away and min(away) < GATE:
                nearest = left.pop(int(np.argmin(away)))
                newcomer = Newcomer(candidates[nearest], newcomer.frames + 1, newcomer.first, timestamp)
                lasted = timestamp - newcomer.first >= TOUCHING_TIME or not touching[nearest]
                if newcomer.frames >= FRAMES and lasted:
                    counted.append(nearest)
                    continue
            if timestamp - newcomer.last <= PATIENCE:
                kept.append(newcomer)
        self._waiting = kept + [Newcomer(candidates[i], 1, timestamp, timestamp) for i in left]
        return sorted(counted)

    def export_state(self) -> dict[str, Any]:
        """What the next frame depends on, as arrays."""
        return {
            "begun": self._begun,
            "places": np.array([n.place for n in self._waiting]).reshape(-1, 3),
            "frames": np.array([n.frames for n in self._waiting], dtype=np.int64),
            "first": np.array([n.first for n in self._waiting], dtype=np.float64),
            "last": np.array([n.last for n in self._waiting], dtype=np.float64),
        }

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `export_state` gave."""
        self._begun = bool(state["begun"])
        rows = zip(state["places"], state["frames"], state["first"], state["last"], strict=True)
        self._waiting = [
            Newcomer(np.array(at), int(frames), float(first), float(last)) for at, frames, first, last in rows
        ]
