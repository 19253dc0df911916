"""Which frame a viewer shows as time passes: the timeline without the window."""

from __future__ import annotations

import numpy as np

SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Factors of real time that a viewer offers."""


class Playback:
    """Timeline of a track.

    Parameters
    ----------
    timestamps : (T,), seconds, rising, T at least 1

    Attributes
    ----------
    frame : shown now, 0 to T - 1
    playing : True while time advances
    speed : factor of real time
    """

    def __init__(self, timestamps: np.ndarray) -> None:
        self._times = np.asarray(timestamps, dtype=np.float64) - timestamps[0]
        self.frame, self.playing, self.speed = 0, False, 1.0
        self._time = 0.0

    def __len__(self) -> int:
        return len(self._times)

    @property
    def seconds(self) -> float:
        """Seconds of the frame shown, since the first frame."""
        return float(self._times[self.frame])

    def show(self, frame: int) -> None:
        """Show a frame; one beyond either end is the first or the last."""
        self.frame = min(max(frame, 0), len(self) - 1)
        self._time = self.seconds

    def toggle(self) -> None:
        """Play, or pause; at the end play from the first frame."""
        self.playing = not self.playing
        if self.playing and self.frame == len(self) - 1:
            self.show(0)

    def advance(self, elapsed: float) -> bool:
        """Let `elapsed` seconds of real time pass; returns True if another frame is shown. It stops at the last one."""
        if not self.playing:
            return False
        before = self.frame
        self._time += self.speed * elapsed
        self.frame = int(np.searchsorted(self._times, self._time, side="right")) - 1
        if self.frame >= len(self) - 1:
            self.playing = False
        return self.frame != before
