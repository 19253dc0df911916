"""A folder of raw frames: one image of little-endian uint16 per file."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.io.safe_open import read_file
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import LARGEST_FILE, chosen_camera, file_frames, natural_key, recording_of_source
from toolkit.sensing.recording import Recording

KNOWN_SIZES = {2 * w * h: (w, h) for w, h in ((640, 480), (512, 424), (320, 240), (176, 144))}
"""File size in bytes -> width and height of common depth cameras."""


def matches(path: Path) -> bool:
    """Return whether `path` is a raw file of a known size, or a folder with some."""
    return any(file.stat().st_size in KNOWN_SIZES for file in _frame_files(path))


def _frame_files(path: Path) -> list[Path]:
    """Return the files of the frames, sorted: the file itself, or the files of the folder with a frame's suffix."""
    if path.is_file():
        return [path]
    files = [p for p in path.iterdir() if p.is_file() and not p.name.startswith(".")]
    frames = [p for p in files if p.stat().st_size in KNOWN_SIZES]
    suffixes = {p.suffix for p in frames}  # a file with the suffix of a frame is one, and truncated if its size differs
    return sorted((p for p in files if p.suffix in suffixes) or files, key=natural_key)


def _read_frame(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """Read one image of a shape (height, width)."""
    try:
        content = read_file(path, LARGEST_FILE)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}") from error
    data = np.frombuffer(content[: len(content) // 2 * 2], dtype="<u2")
    if data.size != shape[0] * shape[1]:
        raise RecordingError(
            f"{path} holds {data.size} values, expected {shape[1]}x{shape[0]}; give --size WIDTH,HEIGHT"
        )
    return data.reshape(shape)


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open raw frames; requires the option `intrinsics`, and `size` for an unknown file size."""
    files = _frame_files(path)
    if not files:
        raise RecordingError(f"{path} holds no file; give the folder of the raw frames")
    size = options.size or next((known for file in files if (known := KNOWN_SIZES.get(file.stat().st_size))), None)
    if size is None:
        raise RecordingError(f"{files[0]} has {files[0].stat().st_size} bytes, no known size; give --size WIDTH,HEIGHT")
    shape = (int(size[1]), int(size[0]))
    source = file_frames(files, partial(_read_frame, shape=shape))
    return recording_of_source(path, source, chosen_camera(options, shape, path), options)
