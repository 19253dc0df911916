"""The project's recording format: one NPZ file, read frame by frame."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import IO

import numpy as np

from toolkit.io.archives import Column, archive_names, check_columns, load_archive, read_header, translated
from toolkit.io.errors import RecordingError
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import LARGEST_PICTURE, chosen_camera, recording_of_source
from toolkit.sensing.recording import FrameSource, Recording

RECORD_AGAIN = "copy or record it again"
"""Advice for a damaged recording."""


class MemberReader:
    """Rows of one array of an NPZ file, read on demand.

    A stored (uncompressed) member has random access; a compressed one is read in order, and going back restarts it.

    Attributes
    ----------
    shape, dtype : those of the whole array
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name, self._member = path, name, f"{name}.npy"
        self._stream, self._next = self._opened(), 0
        if not self.shape or self.dtype.kind not in "iuf":
            raise RecordingError(f"{name} in {path} is {self.dtype} {self.shape}; it must be numbers, frame by frame")
        if self._by_column:
            raise RecordingError(f"{name} in {path} is stored column by column; save it with np.ascontiguousarray")
        self._row_shape = self.shape[1:]
        self._row_bytes = int(np.prod(self._row_shape, dtype=np.int64)) * self.dtype.itemsize

    def rows(self) -> Iterator[np.ndarray]:
        """Yield all rows in order, each a new array."""
        stream = self._opened()
        for i in range(self.shape[0]):
            yield self._read(stream, i)

    def row(self, i: int) -> np.ndarray:
        """Return row `i` as a new array."""
        if i < self._next:
            self._stream, self._next = self._opened(), 0
        while self._next < i:
            self._read(self._stream, self._next)
            self._next += 1
        self._next = i + 1
        return self._read(self._stream, i)

    def _opened(self) -> IO[bytes]:
        """Return the member at its first row; it closes with the last reference to it."""
        with self._guarded():
            archive = zipfile.ZipFile(self._path)
            stream = archive.open(self._member)
            self.shape, self._by_column, self.dtype = read_header(archive, self._name, stream)
        return stream

    def _read(self, stream: IO[bytes], i: int) -> np.ndarray:
        with self._guarded():
            data = stream.read(self._row_bytes)
        if len(data) != self._row_bytes:
            raise RecordingError(f"{self._path} ends within row {i} of {self._member}; copy or record it again")
        return np.frombuffer(data, dtype=self.dtype).reshape(self._row_shape)

    def _guarded(self) -> AbstractContextManager[None]:
        return translated(self._path, RecordingError, RECORD_AGAIN)


METADATA = {
    "intrinsics": Column("iuf"),
    "timestamps": Column("iuf"),
    "distortion": Column("iuf"),
    "background": Column("iuf", gaps=True),
    "up_camera": Column("iuf"),
    "joints": Column("iuf", gaps=True),
    "reference_joints": Column("iuf", gaps=True),
    "joints_2d": Column("iuf", gaps=True),
}
"""Members that are read immediately; the others are read frame by frame or ignored."""


def _frames(path: Path, names: list[str]) -> tuple[FrameSource, tuple[int, int]]:
    """Return the frames of the members `depth` and `color` of an NPZ file, and the shape of an image."""
    depth = MemberReader(path, "depth")
    if len(depth.shape) != 3:
        raise RecordingError(f"depth in {path} has shape {depth.shape}; expected (frames, height, width)")
    count, height, width = depth.shape
    most_frames = 50_000_000  # maximum number of frames (more than two weeks at 30 Hz)
    if count > most_frames or height * width > LARGEST_PICTURE:
        raise RecordingError(f"{path} states {count} frames of {width}x{height} pixels; {RECORD_AGAIN}")
    if "color" not in names:
        return FrameSource(count, depth.row, in_order=depth.rows), (height, width)
    color, expected = MemberReader(path, "color"), (*depth.shape, 3)
    if color.shape != expected or color.dtype != np.uint8:
        raise RecordingError(f"color in {path} is {color.dtype} {color.shape}; expected uint8 {expected}")
    return FrameSource(count, depth.row, color.row, depth.rows), (height, width)


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open an NPZ recording (keys: see `docs/recordings.md`); only metadata is read."""
    names = archive_names(path, RecordingError, RECORD_AGAIN)
    if "depth" not in names:
        raise RecordingError(f"{path} has no 'depth'; it has: {', '.join(names) or 'nothing'}")
    source, shape = _frames(path, names)
    # Maximum number of bytes per value, of values beside frames and background, and of values per frame (joints of 64
    # people).
    max_item_bytes, max_small_values, max_numbers = 16, 1 << 16, 64 * 20 * 10
    most = max_item_bytes * (2 * shape[0] * shape[1] + source.count * max_numbers + max_small_values)
    small = load_archive(path, RecordingError, RECORD_AGAIN, only=METADATA, most=most)
    check_columns(small, METADATA, RecordingError, str(path), "see docs/recordings.md for the format")
    camera = chosen_camera(options, shape, path, small.get("intrinsics"), small.get("distortion"))
    return recording_of_source(
        path,
        source,
        camera,
        options,
        timestamps=small.get("timestamps"),
        background=small.get("background"),
        up=small.get("up_camera"),
        joints=small.get("joints"),
        reference_joints=small.get("reference_joints"),
        image_joints=small.get("joints_2d"),
    )
