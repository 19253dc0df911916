"""A folder of raw frames: each file one image of little-endian uint16."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from toolkit.door import read_file
from toolkit.errors import RecordingError
from toolkit.recordings.readers.common import (
    LARGEST_FILE,
    chosen_background,
    chosen_camera,
    chosen_up,
    frame_times,
    natural_key,
)
from toolkit.recordings.stored import StoredRecording
from toolkit.sensing.conversion import DepthConverter
from toolkit.sensing.recording import ReaderOptions, Recording

KNOWN_SIZES = {2 * w * h: (w, h) for w, h in ((640, 480), (512, 424), (320, 240), (176, 144))}
"""Bytes of a file -> width and height of the depth cameras that such dumps come from."""


def matches(path: Path) -> bool:
    """Whether `path` is a raw file, or a folder of them, of a known camera's size."""
    return any(file.stat().st_size in KNOWN_SIZES for file in _files(path))


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    files = [p for p in path.iterdir() if p.is_file() and not p.name.startswith(".")]
    frames = [p for p in files if p.stat().st_size in KNOWN_SIZES]
    suffixes = {p.suffix for p in frames}  # what is called like a frame is one, and cut short if it has another size
    return sorted((p for p in files if p.suffix in suffixes) or files, key=natural_key)


class RawFrames:
    """Frames of (height, width) little-endian uint16, one file each, by sorted name (numbers by value)."""

    def __init__(self, files: list[Path], shape: tuple[int, int]) -> None:
        self._files, self._shape = files, shape

    def __len__(self) -> int:
        return len(self._files)

    def depth(self, i: int) -> np.ndarray:
        """Raw frame `i`."""
        try:
            content = read_file(self._files[i], LARGEST_FILE)
        except OSError as error:
            raise RecordingError(f"{self._files[i]} cannot be read: {error.strerror or error}") from error
        data = np.frombuffer(content[: len(content) // 2 * 2], dtype="<u2")
        if data.size != self._shape[0] * self._shape[1]:
            raise RecordingError(
                f"{self._files[i]} holds {data.size} values, expected {self._shape[1]}x{self._shape[0]}; "
                "give --size WIDTH,HEIGHT"
            )
        return data.reshape(self._shape)

    def frames(self) -> Iterator[np.ndarray]:
        """Raw frames in order."""
        return (self.depth(i) for i in range(len(self)))

    def color(self, i: int) -> None:
        """There is none."""
        return None


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a folder of raw frames, or one file; the option `intrinsics` is needed, `size` where it cannot be
    guessed.
    """
    files = _files(path)
    if not files:
        raise RecordingError(f"{path} holds no file; give the folder of the raw frames")
    size = options.size or next((known for file in files if (known := KNOWN_SIZES.get(file.stat().st_size))), None)
    if size is None:
        raise RecordingError(f"{files[0]} has {files[0].stat().st_size} bytes, no known size; give --size WIDTH,HEIGHT")
    shape = (int(size[1]), int(size[0]))
    source = RawFrames(files, shape)
    return StoredRecording(
        name=path.stem,
        path=path,
        camera=chosen_camera(options, shape, path),
        timestamps=frame_times(len(source), options),
        source=source,
        converter=DepthConverter(options.unit("mm"), options.radial, bool(options.mirrored)),
        background=chosen_background(options, None),
        stored_up=chosen_up(options, None),
        options=options.given(),
    )
