"""Recordings of a person in a T-pose into their body."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from toolkit.fitting.scan_fit import Scan, ScanView, fit_scan
from toolkit.io.errors import UsageError
from toolkit.people.survey import find_person
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings

FRAMES = 9
"""Of each view: their median has a third of one frame's noise, and no person holds still for long."""


def scan_recordings(
    paths: Sequence[str | Path], yaws: Sequence[float] | None = None, sensing: SensingSettings | None = None
) -> Scan:
    """The body of the person in several recordings, one for each view; their first frames are used.

    Parameters
    ----------
    yaws : degrees by which the person is turned to their left in each; None spreads them evenly, beginning at 0
    sensing : how the person is cut out

    Raises
    ------
    UsageError
        There are other than one yaw for each view.
    RecordingError, BodyError
        A recording cannot be read, or see `fit_scan`.
    """
    count = len(paths)
    degrees = [360.0 * i / count for i in range(count)] if yaws is None else list(yaws)
    if len(degrees) != count:
        raise UsageError(f"there are {count} views and {len(degrees)} yaws; give one for each, or none")
    views = []
    for path, yaw in zip(paths, degrees, strict=True):
        recording = open_recording(path)
        cloud = _standing_still(recording, sensing or SensingSettings())
        views.append(ScanView(cloud, float(np.deg2rad((yaw + 180.0) % 360.0 - 180.0))))
    return fit_scan(views)


def _standing_still(recording: Recording, sensing: SensingSettings) -> Cloud:
    """The cloud of the median of the first frames, level frame."""
    finder = find_person(recording, sensing)
    stream = islice(recording.stream(), FRAMES)
    frames = np.array([finder.find(frame.depth_mm, frame.timestamp, {})[0].depth for frame in stream])
    known = 2 * np.count_nonzero(frames, axis=0) > len(frames)
    lowered = np.where(frames > 0, frames, np.inf)
    count = np.count_nonzero(frames, axis=0)
    middle = np.take_along_axis(np.sort(lowered, axis=0), np.maximum((count - 1) // 2, 0)[None], axis=0)[0]
    depth = np.where(known, middle, 0.0).astype(np.float32)
    return Cloud.from_depth(depth, finder.camera, level_rotation(recording.up_camera))
