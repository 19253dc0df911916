"""Smoothing of reported poses over time, off by default; the tracker's own state is not smoothed."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import SettingsError


class PoseSmoother:
    """First-order low-pass of a pose with a time constant in seconds.

    A step of dt seconds moves the output by the share `1 - exp(-dt / time)` of the way, whatever the frame rate.
    A steady motion lags by `time` seconds, to within half a frame.

    Parameters
    ----------
    time : seconds, at least 0; 0 = no smoothing
    last : last returned pose (P,) and its timestamp; None before the first frame

    Raises
    ------
    SettingsError
        `time` is negative or not finite.
    """

    def __init__(self, time: float, last: tuple[np.ndarray, float] | None = None) -> None:
        if not (np.isfinite(time) and time >= 0.0):
            raise SettingsError(f"smoothing is {time} s; give a time constant of at least 0")
        self._time = time
        self.last = last

    def update(self, pose: np.ndarray, timestamp: float) -> np.ndarray:
        """Return the smoothed pose (P,) after `pose` (P,) at `timestamp` seconds; the first one is unchanged."""
        if self._time == 0.0:
            return pose
        smoothed = pose.copy()
        if self.last is not None:
            before, moment = self.last
            share = 1.0 - np.exp(-max(timestamp - moment, 0.0) / self._time)
            smoothed = before + share * (pose - before)
            smoothed[skeleton.ROOT_ROTATION] = _between(
                before[skeleton.ROOT_ROTATION], pose[skeleton.ROOT_ROTATION], share
            )
        self.last = smoothed, timestamp
        return smoothed.copy()


def _between(start: np.ndarray, end: np.ndarray, share: float) -> np.ndarray:
    """Return the rotation vector at a `share` of the shortest path between two rotation vectors, all (3,)."""
    from scipy.spatial.transform import Rotation

    first = Rotation.from_rotvec(start)
    way = (Rotation.from_rotvec(end) * first.inv()).as_rotvec()
    return (Rotation.from_rotvec(share * way) * first).as_rotvec()
