"""Rows of large arrays inside NPZ files, one at a time, both ways."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import IO

import numpy as np

from toolkit.archives import read_header, translated
from toolkit.errors import RecordingError

RECORD_AGAIN = "copy or record it again"
"""What to do about a damaged recording."""


class MemberReader:
    """Rows of one array of an NPZ file, read as they are asked for.

    A stored (uncompressed) member is read at any place; a compressed one in order, and going back starts over.

    Attributes
    ----------
    shape, dtype : of the whole array
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name, self._member = path, name, f"{name}.npy"
        self._stream: IO[bytes] | None = None
        self._next = 0
        with self._guarded(), zipfile.ZipFile(path) as archive, archive.open(self._member) as stream:
            self.shape, by_column, self.dtype = read_header(archive, name, stream)
        if not self.shape or self.dtype.kind not in "iuf":
            raise RecordingError(f"{name} in {path} is {self.dtype} {self.shape}; it must be numbers, frame by frame")
        if by_column:
            raise RecordingError(f"{name} in {path} is stored column by column; save it with np.ascontiguousarray")
        self._row_shape = self.shape[1:]
        self._row_bytes = int(np.prod(self._row_shape, dtype=np.int64)) * self.dtype.itemsize

    def rows(self) -> Iterator[np.ndarray]:
        """All rows in order, each a new array."""
        with self._guarded():
            archive = zipfile.ZipFile(self._path)
        with archive:
            with self._guarded():
                stream = archive.open(self._member)
                read_header(archive, self._name, stream)
            for i in range(self.shape[0]):
                yield self._read(stream, i)

    def row(self, i: int) -> np.ndarray:
        """Row `i` as a new array."""
        with self._guarded():
            if self._stream is None or i < self._next:
                archive = zipfile.ZipFile(self._path)
                self._stream = archive.open(self._member)
                read_header(archive, self._name, self._stream)
                self._next = 0
            while self._next < i:
                self._read(self._stream, self._next)
                self._next += 1
        self._next = i + 1
        return self._read(self._stream, i)

    def _read(self, stream: IO[bytes], i: int) -> np.ndarray:
        with self._guarded():
            data = stream.read(self._row_bytes)
        if len(data) != self._row_bytes:
            raise RecordingError(f"{self._path} ends within row {i} of {self._member}; copy or record it again")
        return np.frombuffer(data, dtype=self.dtype).reshape(self._row_shape)

    def _guarded(self) -> AbstractContextManager[None]:
        return translated(self._path, RecordingError, RECORD_AGAIN)
