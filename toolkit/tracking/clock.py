"""Times of the stages of a frame step."""

from __future__ import annotations

from time import perf_counter

import numpy as np


class StageClock:
    """Disjoint stage times of one frame, milliseconds: each `record` charges the time since the last one to a stage."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self._index = {name: i for i, name in enumerate(names)}
        self.milliseconds = np.zeros(len(names), dtype=np.float32)
        self._last = perf_counter()

    def record(self, name: str) -> None:
        """Charge the time since the last record to stage `name`."""
        now = perf_counter()
        self.milliseconds[self._index[name]] += 1000.0 * (now - self._last)
        self._last = now

    def charge(self, name: str, milliseconds: float) -> None:
        """Add time that was spent elsewhere for this frame to stage `name`."""
        self.milliseconds[self._index[name]] += milliseconds
