"""Depth that lies in memory, as a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from toolkit.errors import RecordingError
from toolkit.recordings.options import ReaderOptions
from toolkit.recordings.readers.common import ArrayFrames, chosen_camera, recording_of_source
from toolkit.sensing.recording import Recording


def recording_of(
    depth: np.ndarray,
    *,
    timestamps: np.ndarray | None = None,
    background: np.ndarray | None = None,
    name: str = "depth",
    **options: Any,
) -> Recording:
    """A recording of depth in memory, which is not copied.

    Parameters
    ----------
    depth : (T, H, W), 0 = no measurement: whole numbers are millimetres, others metres, unless `depth_unit` says so
    timestamps : (T,), seconds; without them `frame_rate` tells, or 30 frames a second
    background : (H, W), the empty scene in the same unit
    name : for people
    options : of `ReaderOptions`; `intrinsics` (fx, fy, cx, cy in pixels) has to be one of them

    Raises
    ------
    RecordingError
        The array is none of depth frames, or the intrinsics are missing or absurd.
    UsageError
        An option is unknown or wrong.
    """
    frames = np.asarray(depth)
    if frames.ndim != 3 or frames.dtype.kind not in "uif":
        raise RecordingError(f"depth has shape {frames.shape} of {frames.dtype}; give numbers (frames, height, width)")
    chosen, path = ReaderOptions.from_mapping(options), Path(name)
    return recording_of_source(
        path,
        ArrayFrames(frames),
        chosen_camera(chosen, frames.shape[1:], path),
        chosen,
        name=name,
        unit="m" if frames.dtype.kind == "f" else "mm",
        timestamps=None if timestamps is None else np.asarray(timestamps, np.float64),
        background=background,
    )
