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
from toolkit.people.hypothesis import PersonClassifier
from toolkit.people.image_rotation import quarter_turns
from toolkit.people.plausibility import HELP
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers import reader_for
from toolkit.recordings.readers.base import ArrayFrames, FileFacts, chosen_camera, recording_of_source
from toolkit.sensing.recording import Recording, memory_path

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


def open_upright(path: str | Path, classifier: PersonClassifier | None = None, **options: Any) -> Recording:
    """Open as `open_recording` and rotate the images of a camera on its side or upside down.

    The options of the recording then contain `rotate`. A PlausibilityWarning is issued unless the file contains the
    vertical.

    Parameters
    ----------
    classifier : scores heads in the four orientations; if None, only a floor or a stored vertical decides

    Raises
    ------
    RecordingError, UsageError
        As `open_recording`.
    """
    return upright(lambda **turned: open_recording(path, **{**options, **turned}), classifier)


def upright(opened: Callable[..., Recording], classifier: PersonClassifier | None = None) -> Recording:
    """Return the recording of `opened(**options)` with the option `rotate` of upright images, see `open_upright`."""
    recording = opened()
    degrees = 90 * quarter_turns(recording, classifier)
    if not degrees:
        return recording
    logger.info("%s: images are turned by %d degrees", recording.name, degrees)
    if recording.vertical.source != "file":
        text = f"{recording.name}: images are turned upright by {degrees} degrees; --rotate 0 leaves them; {HELP}"
        warnings.warn(PlausibilityWarning(text), stacklevel=4)
    return opened(rotate=degrees)


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
        ArrayFrames(frames),
        chosen_camera(chosen, frames.shape[1:], path),
        chosen,
        FileFacts(
            unit="m" if frames.dtype.kind == "f" else "mm",
            timestamps=None if timestamps is None else np.asarray(timestamps, np.float64),
            background=None if background is None else _array(background, "background"),
        ),
        name=name,
    )


def _array(values: Any, what: str) -> np.ndarray:
    """Depth as an array in which masked values are 0, no measurement."""
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
