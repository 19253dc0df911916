"""Reader of numeric arrays of MATLAB level 5 files, which verifies every length and checksum first.

SciPy's reader decodes a compressed variable while it inflates it, before its checksum is verified, and a damaged
variable can crash the process. This reader inflates a variable whole; inconsistent lengths are errors.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from toolkit.io.errors import DepthMocapError
from toolkit.io.safe_open import read_file

LARGEST_MATLAB_FILE = 1 << 31
"""Largest size in bytes of a file and of an inflated variable."""
INT32, UINT32, COMPRESSED = 5, 6, 15
NUMBERS = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", INT32: "i4", UINT32: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
"""Data types of stored numbers (MATLAB file format, table 1-1)."""


def read_matlab(path: str | Path, error: type[DepthMocapError]) -> dict[str, np.ndarray]:
    """Return the variables of a file by name: arrays in their stored type.

    Text, cells, structures, sparse and complex arrays are skipped.

    Raises
    ------
    error
        The file is missing, damaged, or of another level (before 5, or 7.3, which is HDF5).
    """
    try:
        return dict(_variables(read_file(path, LARGEST_MATLAB_FILE)))
    except (OSError, ValueError, struct.error, zlib.error) as problem:
        reason = problem.strerror if isinstance(problem, OSError) else problem
        raise error(f"{path} is truncated or no MATLAB file ({reason}); copy it again") from problem


def _variables(content: bytes) -> Iterator[tuple[str, np.ndarray]]:
    header_bytes = 128  # bytes before the first variable; the last two give the byte order
    order = {b"IM": "<", b"MI": ">"}.get(content[header_bytes - 2 : header_bytes])
    if order is None:
        raise ValueError("it is not of level 5")
    matrix_element = 14
    for kind, data in _elements(content[header_bytes:], order):
        if kind == COMPRESSED:
            ((kind, data),) = _elements(_inflated(data), order)
        if kind == matrix_element:
            yield from _matrix(data, order)


def _inflated(data: bytes) -> bytes:
    stream = zlib.decompressobj()
    content = stream.decompress(data, LARGEST_MATLAB_FILE)
    if not stream.eof:
        raise ValueError("a variable is cut short or too large")
    return content


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield type and content of consecutive data elements."""
    at = 0
    while at < len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if kind >> 16:  # small element: up to four bytes replace the size
            kind, size, start, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise ValueError("a short element is longer than its place")
        else:
            start = at + 8
            end = start + size if kind == COMPRESSED else start + -(-size // 8) * 8
        if start + size > len(data):
            raise ValueError("an element is longer than the file")
        yield kind, data[start : start + size]
        at = end


def _matrix(data: bytes, order: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield name and value of a variable, if it holds numbers."""
    elements = list(_elements(data, order))
    if len(elements) < 3 or (elements[0][0], elements[1][0]) != (UINT32, INT32):
        raise ValueError("a variable has no flags, shape and name")
    flags = struct.unpack_from(f"{order}I", elements[0][1])[0]
    shape = np.frombuffer(elements[1][1], f"{order}i4").tolist()
    name, parts = elements[2][1].decode("ascii"), elements[3:]
    complex_flag = 0x0800
    # Classes 6 to 15 are numeric; numbers are stored in the smallest sufficient type, whatever the class.
    if 6 <= flags & 0xFF <= 15 and not flags & complex_flag:
        if len(parts) != 1 or parts[0][0] not in NUMBERS or min(shape, default=-1) < 0:
            raise ValueError(f"the variable {name!r} holds something else than numbers")
        yield name, np.frombuffer(parts[0][1], order + NUMBERS[parts[0][0]]).reshape(shape, order="F")
