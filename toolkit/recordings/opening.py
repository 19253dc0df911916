"""Opening of recordings in files or in memory."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.errors import PlausibilityWarning, RecordingError
from toolkit.io.files import is_file, is_folder, link_out_of
from toolkit.people.image_rotation import quarter_turns
from toolkit.people.plausibility import HELP, are_unconnected
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers import reader_for
from toolkit.recordings.readers.base import array_frames, chosen_camera, recording_of_source
from toolkit.sensing.recording import Recording, memory_path

UNCONNECTED = 0.2
"""Frame rate of photographs: so low that no frame has information about another."""

logger = logging.getLogger(__name__)


def open_recording(path: str | Path, **options: Any) -> Recording:
    """Open a depth recording of any supported format; options are those of `ReaderOptions`.

    Raises
    ------
    RecordingError
        The path is missing, of no supported format, or its content is invalid.
    UsageError
        An option is unknown.
    """
    target = Path(path)
    if not (is_file(target) or is_folder(target)):
        raise RecordingError(f"there is no recording at {target}, a file or a folder; check the path")
    chosen = ReaderOptions.from_mapping(options)
    read = reader_for(target, chosen.format)
    if target.is_dir() and (link := link_out_of(target)) is not None:
        raise RecordingError(f"{link} is a link that leads out of the recording; put the file itself there")
    return read(target, chosen)


def open_upright(path: str | Path, **options: Any) -> Recording:
    """Open as `open_recording`, rotate the images of a tilted camera, and separate photographs.

    Images of a camera on its side or upside down are rotated; the options of the recording then contain `rotate`.
    Frames without times between which no person can have moved are photographs; the options then contain a low
    `frame_rate`. A PlausibilityWarning is issued of both, unless the file contains the vertical.

    Raises
    ------
    RecordingError, UsageError
        As `open_recording`.
    """
    return upright(lambda **more: open_recording(path, **{**options, **more}))


def upright(opened: Callable[..., Recording]) -> Recording:
    """Return the recording of `opened(**options)` with the options that `open_upright` adds."""
    recording = opened()
    added: dict[str, Any] = {}
    if degrees := 90 * quarter_turns(recording):
        added["rotate"], source = degrees, recording.vertical.source
        recording = opened(**added)
        logger.info("%s: images are turned by %d degrees", recording.name, degrees)
        if source != "file":
            _warn(recording, f"images are turned upright by {degrees} degrees; --rotate 0 leaves them")
    if recording.times_assumed and are_unconnected(recording):
        recording = opened(**added, frame_rate=UNCONNECTED)
        text = "people are elsewhere in each frame, so each is tracked as a photograph"
        _warn(recording, f"{text}; --frame-rate 30 takes the frames as a film")
    return recording


def _warn(recording: Recording, text: str) -> None:
    warnings.warn(PlausibilityWarning(f"{recording.name}: {text}; {HELP}"), stacklevel=5)


def recording_of(
    depth: np.ndarray | Sequence[np.ndarray],
    *,
    timestamps: np.ndarray | None = None,
    background: np.ndarray | None = None,
    name: str = "depth",
    **options: Any,
) -> Recording:
    """Make a recording of depth in memory, without a copy.

    Parameters
    ----------
    depth : (T, H, W), an array or a list of frames, 0 or masked = no measurement: integers are millimetres, floats
        metres, unless `depth_unit` is given
    timestamps : (T,), seconds; default: evenly at `frame_rate`, or 30 Hz
    background : (H, W), the empty scene in the same unit
    name : for people
    options : of `ReaderOptions`; `intrinsics` (fx, fy, cx, cy in pixels) is required

    Raises
    ------
    RecordingError
        The array has no depth frames, or the intrinsics are missing or invalid.
    UsageError
        An option is unknown or invalid.
    """
    frames = _array(depth, "depth")
    if frames.ndim != 3 or frames.dtype.kind not in "uif":
        raise RecordingError(f"depth has shape {frames.shape} of {frames.dtype}; give numbers (frames, height, width)")
    chosen, path = ReaderOptions.from_mapping(options), memory_path(name)
    return recording_of_source(
        path,
        array_frames(frames),
        chosen_camera(chosen, frames.shape[1:], path),
        chosen,
        name=name,
        unit="m" if frames.dtype.kind == "f" else "mm",
        timestamps=None if timestamps is None else np.asarray(timestamps, np.float64),
        background=None if background is None else _array(background, "background"),
    )


def _array(values: Any, what: str) -> np.ndarray:
    """Return depth as an array in which masked values are 0, no measurement."""
    if isinstance(values, np.ma.MaskedArray):
        return np.asarray(values.filled(0))
    if not isinstance(values, (np.ndarray, Sequence)) or isinstance(values, (str, bytes)):
        raise RecordingError(
            f"{what} is a {type(values).__name__}; give an array or a list of frames, or frames one by one to "
            "depthmocap.Tracker"
        )
    try:
        frames = [frame.filled(0) if isinstance(frame, np.ma.MaskedArray) else frame for frame in values]
        return np.asarray(values if isinstance(values, np.ndarray) else frames)
    except ValueError as error:
        raise RecordingError(f"{what} is a list of frames of several sizes; give frames of one size") from error
