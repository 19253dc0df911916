"""One file of named integer arrays that is opened without being read.

A magic word and the length of a header, the header in JSON and its SHA-256, then one array after the other, each on a
64-byte boundary. The header tells name, type, shape, place and CRC-32 of every array. Opening reads the header alone
and maps the arrays; each is compared with its checksum where that is asked for.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from toolkit.door import open_file
from toolkit.errors import RetrievalError
from toolkit.files import atomic_path, is_file
from toolkit.plain import parse_json
from toolkit.typed import Range, TypedReader

REBUILD = "build it again"

MAGIC = b"depthmocap index\n"
ALIGNMENT = 64
DIGEST = hashlib.sha256().digest_size


@dataclass(frozen=True)
class _Entry:
    """What the header says of one array."""

    name: str
    dtype: str
    shape: tuple[Annotated[int, Range(0)], ...]
    offset: Annotated[int, Range(0)]
    crc32: int


@dataclass(frozen=True)
class _Header:
    """What the header holds."""

    version: int
    features: str
    names: list[str]
    arrays: list[_Entry]
    bytes: Annotated[int, Range(0)]


@dataclass(frozen=True, eq=False)
class StoredArrays:
    """An opened file.

    Attributes
    ----------
    path : the file
    header : what was written: version, features and names
    """

    path: Path
    header: dict[str, Any]
    _table: dict[str, _Entry]
    _start: int

    @classmethod
    def open(cls, path: str | Path) -> StoredArrays:
        """Read the header.

        Raises
        ------
        RetrievalError
            The file is missing, no index, or cut short, or its header is damaged.
        """
        path = Path(path)
        if not is_file(path):
            raise RetrievalError(f"there is no index {path}; make one with `depthmocap index`")
        try:
            with open_file(path) as stream:
                if stream.read(len(MAGIC)) != MAGIC:
                    raise RetrievalError(f"{path} is no keyframe index; make one with `depthmocap index`")
                length, size = int.from_bytes(stream.read(8), "little"), path.stat().st_size
                text, digest = stream.read(min(length, size)), stream.read(DIGEST)
                start = _padded(stream.tell())
        except OSError as error:
            raise RetrievalError(f"cannot read the index {path} ({error}); {REBUILD}") from error
        if digest != hashlib.sha256(text).digest():
            raise RetrievalError(f"the index {path} is of an older version, or its header is damaged; {REBUILD}")
        where = f"the header of the index {path}"
        reader = TypedReader(RetrievalError, REBUILD, source=where)
        header = reader.read(parse_json(text.decode("utf-8", "replace"), where, RetrievalError, REBUILD), _Header, "")
        if size != start + header.bytes:
            raise RetrievalError(f"{path} is cut short: it has {size} bytes, not {start + header.bytes}; {REBUILD}")
        known = {"version": header.version, "features": header.features, "names": header.names}
        return cls(path, known, {entry.name: entry for entry in header.arrays}, start)

    def mapped(self, name: str) -> np.ndarray:
        """An array without a look at its content; copy-on-write, so that compiled code sees the type it knows.

        Raises
        ------
        RetrievalError
            There is none of that name, or it is no array of integers of this machine.
        """
        try:
            entry = self._table[name]
            kind = np.dtype(entry.dtype)
            if kind.kind not in "iu" or not kind.isnative:
                raise ValueError(f"it is of type {kind}")
            place = self._start + entry.offset
            if place + math.prod(entry.shape) * kind.itemsize > os.path.getsize(self.path):
                raise ValueError("it is longer than the file")
            return np.asarray(np.memmap(self.path, kind, "c", place, entry.shape))
        except (KeyError, TypeError, ValueError, OverflowError, OSError) as error:
            raise RetrievalError(f"the array {name} of {self.path} cannot be mapped ({error}); {REBUILD}") from error

    def checked(self, name: str) -> np.ndarray:
        """An array that was read once and compared with its checksum.

        Raises
        ------
        RetrievalError
            As `mapped`, or the checksum does not fit.
        """
        array = self.mapped(name)
        if zlib.crc32(array.data) != self._table[name].crc32:
            raise RetrievalError(f"{name} of {self.path} is damaged: its checksum does not fit its content; {REBUILD}")
        return array

    def check(self) -> None:
        """Compare every array with its checksum, which reads the whole file."""
        for name in self._table:
            self.checked(name)


def write_arrays(path: str | Path, header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    """Write a header and arrays as one file, whole or not at all."""
    table: list[dict[str, Any]] = []
    offset = 0
    for name, array in arrays.items():
        crc = zlib.crc32(np.ascontiguousarray(array).data)
        entry = {"name": name, "dtype": array.dtype.str, "shape": list(array.shape), "offset": offset, "crc32": crc}
        table.append(entry)
        offset += _padded(array.nbytes)
    text = json.dumps({**header, "arrays": table, "bytes": offset}).encode()
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        start = stream.write(MAGIC + len(text).to_bytes(8, "little") + text + hashlib.sha256(text).digest())
        stream.write(bytes(_padded(start) - start))
        for array in arrays.values():
            stream.write(np.ascontiguousarray(array).data)
            stream.write(bytes(_padded(array.nbytes) - array.nbytes))


def _padded(size: int) -> int:
    return -(-size // ALIGNMENT) * ALIGNMENT
