"""Checks of a recording's arrays, the same on reading and on writing."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.errors import RecordingError

JOINT_COUNT = 20
LONGEST_STEP = 10.0
"""Seconds: frames farther apart, in the median, are no motion, but milliseconds taken for seconds."""


def check_timestamps(timestamps: np.ndarray, count: int, path: Path) -> np.ndarray:
    """Timestamps as float64 (count,), or RecordingError: wrong length, not finite, backwards, all equal, no seconds."""
    times = np.asarray(timestamps, dtype=np.float64)
    if times.shape != (count,):
        raise RecordingError(f"{path} has {count} frames and timestamps of shape {times.shape}; write one per frame")
    if not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise RecordingError(f"the timestamps of {path} are not finite or run backwards; write seconds, in order")
    if count > 1 and times[0] == times[-1]:
        raise RecordingError(f"all timestamps of {path} are {times[0]:g}; write one per frame, or leave them out")
    if count > 1 and (step := float(np.median(np.diff(times)))) > LONGEST_STEP:
        raise RecordingError(f"the timestamps of {path} are {step:g} s apart; write seconds, not milliseconds")
    return times


def check_joints(joints: np.ndarray | None, count: int, key: str, path: Path) -> np.ndarray | None:
    """A copy as float32 (count, 20, 3), or (N, count, 20, 3) of N people (NaN = unknown), or RecordingError."""
    if joints is None:
        return None
    array = np.array(joints, dtype=np.float32)
    expected = (count, JOINT_COUNT, 3)
    if array.shape != expected and not (array.ndim == 4 and array.shape[1:] == expected):
        raise RecordingError(
            f"{key} of {path} has shape {array.shape}; expected {expected}, or one such array for each of N people"
        )
    return np.where(np.isfinite(array), array, np.float32(np.nan))
