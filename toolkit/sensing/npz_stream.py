"""Rows of large arrays inside NPZ files, one at a time, both ways."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import numpy as np
from numpy.lib import format as npy

from toolkit.errors import RecordingError

BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, ValueError, KeyError, OSError)
"""What NumPy and zipfile raise for a damaged file."""


class MemberReader:
    """Rows of one array of an NPZ file, read as they are asked for.

    A stored (uncompressed) member is read at any place; a compressed one in order, and going back starts over.

    Attributes
    ----------
    shape, dtype : of the whole array
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._member = path, f"{name}.npy"
        self._stream: IO[bytes] | None = None
        self._next = 0
        with self._guarded(), zipfile.ZipFile(path) as archive, archive.open(self._member) as stream:
            self.shape, by_column, self.dtype = _read_header(stream)
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
                _read_header(stream)
            for i in range(self.shape[0]):
                yield self._read(stream, i)

    def row(self, i: int) -> np.ndarray:
        """Row `i` as a new array."""
        with self._guarded():
            if self._stream is None or i < self._next:
                self._stream = zipfile.ZipFile(self._path).open(self._member)
                _read_header(self._stream)
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

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        try:
            yield
        except BROKEN as error:
            raise RecordingError(f"{self._path} is truncated or damaged ({error}); copy or record it again") from error


def _read_header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    version = npy.read_magic(stream)
    reader = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, by_column, dtype = reader(stream)
    return shape, by_column, dtype
