"""A NumPy file of depth images, (T, H, W) or one (H, W), with the intrinsics as an option."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import array_frames, chosen_camera, recording_of_source
from toolkit.sensing.recording import Recording


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open an array of depth images without reading it: integers are millimetres, floats metres.

    Raises
    ------
    RecordingError
        The file is damaged, holds objects or is not an array of depth images.
    """
    try:
        depth = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise RecordingError(f"{path} cannot be read as a NumPy array ({error}); save it again with np.save") from error
    depth = depth[None] if depth.ndim == 2 else depth
    if depth.ndim != 3 or depth.dtype.kind not in "uif":
        raise RecordingError(
            f"{path} has shape {depth.shape} of {depth.dtype}; save depth as numbers (frames, height, width)"
        )
    camera = chosen_camera(options, depth.shape[1:], path)
    unit = "m" if depth.dtype.kind == "f" else "mm"
    return recording_of_source(path, array_frames(depth), camera, options, unit=unit)
