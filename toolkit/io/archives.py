"""Checked NPZ files of the project: plain arrays by name with a checksum, written atomically.

A file may come from an untrusted source. No content is unpickled, no stated size is trusted before the bytes are
read, and every exception of a reader becomes one sentence of the caller's error class.
"""

from __future__ import annotations

import hashlib
import math
import os
import zipfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from toolkit.io.errors import DepthMocapError
from toolkit.io.files import is_file, save_npz
from toolkit.io.safe_open import open_file

CHECKSUM = "checksum"
"""Name of the array that holds the SHA-256 of all others; files of other programs may lack it."""
PLAIN_KINDS = "biufU"
"""Kinds of NumPy types that a file may hold: Booleans, numbers and text."""
KIND_WORDS = {"f": "numbers", "iu": "whole numbers", "iuf": "numbers", "b": "truth values", "U": "text"}


@dataclass(frozen=True)
class Column:
    """Requirements on one array.

    Attributes
    ----------
    kinds : accepted kinds of NumPy types, such as "f", "iu" or "U"
    shape : sizes; a name stands for any size, the same in all columns; None = any shape
    low, high : range of every value, inclusive
    gaps : NaN and infinity are allowed and mean unknown
    """

    kinds: str
    shape: tuple[int | str, ...] | None = None
    low: float = -math.inf
    high: float = math.inf
    gaps: bool = False


def check_columns(
    values: Mapping[str, Any], columns: Mapping[str, Column], error: type[DepthMocapError], where: str, hint: str
) -> None:
    """Check arrays against their requirements; sizes with the same name have to agree.

    Parameters
    ----------
    values : arrays (or array-likes) by name; a column without a value is not checked
    columns : requirements by name
    error : error class to raise
    where, hint : name of the source and advice for the message

    Raises
    ------
    DepthMocapError
        An array has another type or shape, a value is not finite or out of range.
    """
    sizes: dict[str, int] = {}
    for name, column in columns.items():
        if name not in values:
            continue
        array = np.asarray(values[name])
        if array.dtype.kind not in column.kinds:
            words = KIND_WORDS.get(column.kinds, "numbers")
            raise error(f"{name} of {where} is {array.dtype}; it must be {words}; {hint}")
        if column.shape is not None and not _fits(array.shape, column.shape, sizes):
            expected = ", ".join(str(sizes.get(s, s) if isinstance(s, str) else s) for s in column.shape)
            raise error(f"{name} of {where} has shape {array.shape}; expected ({expected}); {hint}")
        _check_values(array, column, name, error, where, hint)


def _fits(shape: tuple[int, ...], expected: tuple[int | str, ...], sizes: dict[str, int]) -> bool:
    """Return True if a shape is the expected one; sizes with a name are added to `sizes` at their first use."""
    if len(shape) != len(expected):
        return False
    wanted = [
        sizes.setdefault(want, have) if isinstance(want, str) else want
        for have, want in zip(shape, expected, strict=True)
    ]
    return tuple(wanted) == shape


def _check_values(
    array: np.ndarray, column: Column, name: str, error: type[DepthMocapError], where: str, hint: str
) -> None:
    if array.dtype.kind not in "iuf" or not array.size:
        return
    usable = array[np.isfinite(array)] if column.gaps and array.dtype.kind == "f" else array
    if not usable.size:
        return
    least, most = float(usable.min()), float(usable.max())
    if not (math.isfinite(least) and math.isfinite(most)):
        raise error(f"{name} of {where} holds values that are not finite; {hint}")
    if least < column.low or most > column.high:
        wrong = least if least < column.low else most
        raise error(f"{name} of {where} holds {wrong:g}, outside {column.low:g} to {column.high:g}; {hint}")


def save_archive(path: str | Path, arrays: Mapping[str, Any], *, compressed: bool = True) -> None:
    """Write named arrays (or array-likes) and their checksum to one NPZ file, atomically.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    plain = {name: _native(np.asarray(value)) for name, value in arrays.items()}
    save_npz(path, {**plain, CHECKSUM: np.array(checksum_of(plain))}, compressed=compressed)


def load_archive(
    path: str | Path,
    error: type[DepthMocapError],
    hint: str,
    *,
    only: Collection[str] | None = None,
    most: int = 1 << 30,
    inside: bool = False,
) -> dict[str, np.ndarray]:
    """Read the arrays of an NPZ file and verify its checksum, if it has one.

    Parameters
    ----------
    path : file to read
    error : error class to raise
    hint : advice for the message
    only : names of the arrays to read, without the checksum test; missing ones are ignored; None = all
    most : largest total size in bytes, compared with the headers before the arrays are unpacked
    inside : the file lies in a folder of an untrusted source, see `toolkit.io.safe_open`

    Raises
    ------
    DepthMocapError
        The file is missing, no NPZ file, damaged, too large, or holds anything but plain arrays.
    """
    file = Path(path)
    with opened(file, error, hint, inside=inside) as archive:
        wanted = [name for name in _names(archive) if only is None or name in only]
        size = sum(archive.getinfo(f"{name}.npy").file_size for name in wanted)
        if size > most:
            raise error(f"{file} unpacks to {size} bytes, more than the {most} that it could need; {hint}")
        arrays = {name: _read_whole(archive, name) for name in wanted}
    stated = arrays.pop(CHECKSUM, None)
    if stated is not None and str(stated) != checksum_of(arrays):
        raise error(f"{file} is damaged: its checksum does not fit its content; {hint}")
    return arrays


def archive_names(path: str | Path, error: type[DepthMocapError], hint: str) -> list[str]:
    """Return the names of the arrays in an NPZ file; raises as `load_archive`."""
    with opened(Path(path), error, hint) as archive:
        return _names(archive)


def checksum_of(arrays: Mapping[str, np.ndarray]) -> str:
    """Return the SHA-256 of names, types, shapes and values, as hexadecimal digits, in any order of the names."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        digest.update(f"{name}|{array.dtype.str}|{array.shape}|".encode())
        digest.update(np.ascontiguousarray(array).data if array.dtype.kind != "U" else array.tobytes())
    return digest.hexdigest()


@contextmanager
def opened(path: Path, error: type[DepthMocapError], hint: str, *, inside: bool = False) -> Iterator[zipfile.ZipFile]:
    """Open the archive at `path`; exceptions of its readers become `error`."""
    if not is_file(path):
        raise error(f"there is no file {path}; check the path")
    with (
        translated(path, error, hint),
        open_file(path, inside=inside) as stream,
        zipfile.ZipFile(stream) as archive,
    ):
        _check_count(stream, archive)
        yield archive


def _check_count(stream: IO[bytes], archive: zipfile.ZipFile) -> None:
    """Raise ValueError if the file count at the archive's end differs from its directory.

    zipfile does not compare them. A wrong length in one entry hides the entries behind it, and with them the checksum.
    """
    end_bytes = 22  # size of the last record of a ZIP file before the comment
    stream.seek(-end_bytes - len(archive.comment), os.SEEK_END)
    end = stream.read(end_bytes)
    if not end.startswith(b"PK\x05\x06"):
        raise ValueError("there are bytes behind its end")
    file_count = slice(10, 12)  # position of the file count in that record
    stated, listed = int.from_bytes(end[file_count], "little"), len(archive.infolist())
    zip64_count = 0xFFFF  # file count that refers to ZIP64
    if stated not in (listed, zip64_count):
        raise ValueError(f"it states {stated} arrays and lists {listed}")


@contextmanager
def translated(path: Path, error: type[DepthMocapError], hint: str) -> Iterator[None]:
    """Turn every exception of reading `path` into `error`.

    Every exception is caught on purpose: a damaged archive makes zipfile, zlib, NumPy and its header parser raise more
    than a dozen kinds, among them MemoryError, RecursionError and NotImplementedError.
    """
    try:
        yield
    except DepthMocapError:
        raise
    except Exception as problem:
        raise error(f"{path} is damaged, truncated or no NPZ file ({_reason(path, problem)}); {hint}") from problem


def _reason(path: Path, problem: Exception) -> str:
    if isinstance(problem, zipfile.BadZipFile):
        with open_file(path) as stream:
            if stream.read(len(npy.MAGIC_PREFIX)) == npy.MAGIC_PREFIX:
                return "it is a single array"
    return " ".join(str(problem).split()) or type(problem).__name__


def _names(archive: zipfile.ZipFile) -> list[str]:
    """Return the names of the arrays in an archive; raise ValueError for duplicate or inconsistent names."""
    names = [name.removesuffix(".npy") for name in archive.namelist()]
    most_arrays = 10_000
    if len(names) > most_arrays:
        raise ValueError(f"it lists {len(names)} arrays, more than {most_arrays}")
    for member in archive.infolist():
        archive.open(member).close()
    if len(set(names)) != len(names):
        raise ValueError("it holds an array twice")
    return names


def read_header(archive: zipfile.ZipFile, name: str, stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Return shape, column order (True for Fortran order) and type of the array at the start of `stream`.

    Raises
    ------
    ValueError
        The type is not plain, or the shape does not match the size of the data.
    """
    version = npy.read_magic(stream)
    reader = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, by_column, dtype = reader(stream)
    if dtype.kind not in PLAIN_KINDS:
        raise ValueError(f"{name} is of type {dtype}; only numbers and text are read")
    size = math.prod(shape) * dtype.itemsize
    stated = archive.getinfo(f"{name}.npy").file_size - stream.tell()
    if min(shape, default=0) < 0 or size != stated:
        raise ValueError(f"{name} of shape {shape} needs {size} bytes and has {stated}")
    return shape, by_column, dtype


def _read_whole(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    with archive.open(f"{name}.npy") as stream:
        shape, by_column, dtype = read_header(archive, name, stream)
        data = stream.read()  # read to the end, so that zipfile verifies the CRC
    array = np.frombuffer(data, dtype=dtype).reshape(shape, order="F" if by_column else "C")
    array = _native(array)
    if dtype.kind == "U":
        array.tolist()  # raises ValueError for invalid text
    return array


def _native(array: np.ndarray) -> np.ndarray:
    """Return a copy in native byte order, which compiled code requires."""
    return array.astype(array.dtype.newbyteorder("="))
