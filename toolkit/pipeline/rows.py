"""Who is told the rows of a track while it is written."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from toolkit.body.body import Body
from toolkit.track import FrameResult


class RowWatcher(Protocol):
    """Told every row of a person's track while it is written."""

    def begin(self, frame_rate: float, body: Body | None, past: np.ndarray) -> None:
        """A run starts, or goes on after rows that are written: records with pose, state and timestamps."""
        ...

    def row(self, result: FrameResult, timestamp: float, body: Body) -> None:
        """One more row."""
        ...

    def end(self) -> None:
        """No more rows come."""
        ...
