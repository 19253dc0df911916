"""Checks of a recording's arrays, the same on reading and on writing."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.errors import RecordingError

JOINT_COUNT = 20


def check_timestamps(timestamps: np.ndarray, count: int, path: Path) -> np.ndarray:
    """Timestamps as float64 (count,), or RecordingError: wrong length, not finite, running backwards."""
    times = np.asarray(timestamps, dtype=np.float64)
    if times.shape != (count,):
        raise RecordingError(f"{path} has {count} frames and timestamps of shape {times.shape}; write one per frame")
    if not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise RecordingError(f"the timestamps of {path} are not finite or run backwards; write seconds, in order")
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
