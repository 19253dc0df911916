"""Body estimation from recordings of a T-pose."""

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

VIEW_FRAMES = 9
"""Frames of each view; the median over them has a third of the noise of one frame."""


def scan_recordings(
    paths: Sequence[str | Path], yaws: Sequence[float] | None = None, sensing: SensingSettings | None = None
) -> Scan:
    """Return the body of the person in several T-pose recordings, one per view, from their first frames.

    Parameters
    ----------
    yaws : angle by which the person is turned to their left in each view, degrees; None = evenly spread from 0
    sensing : settings of the segmentation

    Raises
    ------
    UsageError
        The number of yaws differs from the number of views.
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
    """Return the cloud of the median of the first frames, level frame."""
    finder = find_person(recording, sensing)
    stream = islice(recording.stream(), VIEW_FRAMES)
    frames = np.array([finder.find(frame.depth_mm, frame.timestamp, {})[0].depth for frame in stream])
    known = 2 * np.count_nonzero(frames, axis=0) > len(frames)
    lowered = np.where(frames > 0, frames, np.inf)
    count = np.count_nonzero(frames, axis=0)
    middle = np.take_along_axis(np.sort(lowered, axis=0), np.maximum((count - 1) // 2, 0)[None], axis=0)[0]
    depth = np.where(known, middle, 0.0).astype(np.float32)
    return Cloud.from_depth(depth, finder.camera, level_rotation(recording.up_camera))
