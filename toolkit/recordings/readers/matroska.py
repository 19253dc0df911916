"""Matroska containers (`.mkv`) with uncompressed or image-compressed tracks: index of all blocks with random access.

Supported are the elements that recorders of depth cameras write: tracks, attachments, and blocks without lacing.
Indexing skips the payloads, so that the image size does not affect its time. See RFC 8794 (EBML) and RFC 9559
(Matroska) for the identifiers.
"""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, NamedTuple

from toolkit.io.safe_open import open_file

SEGMENT, CLUSTER, TRACK_ENTRY = 0x18538067, 0x1F43B675, 0xAE
PARENTS = frozenset({SEGMENT, CLUSTER, TRACK_ENTRY, 0x1654AE6B, 0x1941A469, 0x1549A966, 0xE0, 0xA0, 0x61A7})
"""Elements that contain relevant ones; those without a name are Tracks, Attachments, Info, Video, BlockGroup and
AttachedFile."""
BLOCKS = frozenset({0xA3, 0xA1})
"""SimpleBlock, and the Block of a BlockGroup."""
CLUSTER_TIME, TIME_SCALE, FILE_NAME, FILE_DATA = 0xE7, 0x2AD7B1, 0x466E, 0x465C


class Block(NamedTuple):
    """Position of one frame: time in nanoseconds, first byte and number of bytes."""

    time: int
    start: int
    size: int


@dataclass
class MatroskaTrack:
    """One track: name, codec, codec private data, size in pixels (0 without), and blocks."""

    number: int = -1
    name: str = ""
    codec: str = ""
    private: bytes = b""
    width: int = 0
    height: int = 0
    blocks: list[Block] = field(default_factory=list)


class Matroska:
    """Tracks and attachments of a file; raises ValueError for a damaged one.

    Attributes
    ----------
    tracks : in the order of the file, each with its blocks in the order of time
    attachments : name -> content
    """

    def __init__(self, path: Path) -> None:
        self._stream = open_file(path)
        self._size = os.fstat(self._stream.fileno()).st_size
        self.tracks: list[MatroskaTrack] = []
        self.attachments: dict[str, bytes] = {}
        self._scale, self._cluster_time, self._file_name = 1_000_000, 0, ""
        weakref.finalize(self, self._stream.close)
        identifier, *_ = self._element_at(0)
        ebml = 0x1A45DFA3  # header of each Matroska file
        if identifier != ebml:
            raise ValueError("it has no Matroska header")
        self._walk(0, self._size, 0)
        for track in self.tracks:
            track.blocks.sort()

    def read(self, block: Block) -> bytes:
        """Return the content of one block."""
        return _exactly(self._stream, block.start, block.size)

    def _element_at(self, place: int) -> tuple[int, int, int]:
        """Return the identifier of the element at `place`, the first byte of its content, and the byte after it."""
        self._stream.seek(place)
        identifier, length = _number(self._stream, keep_mark=True)
        size, more = _number(self._stream, keep_mark=False)
        start = place + length + more
        unknown = size == (1 << 7 * more) - 1  # unknown size: the element extends to the end of its parent
        return identifier, start, self._size if unknown else start + size

    def _walk(self, place: int, end: int, depth: int) -> None:
        deepest = 8
        if depth > deepest:
            raise ValueError("its elements are nested too deep")
        while place < end:
            identifier, start, stop = self._element_at(place)
            if stop > end and not (identifier in (SEGMENT, CLUSTER) and stop == self._size):
                raise ValueError(f"it ends within an element at byte {place}")
            if identifier == TRACK_ENTRY:
                self.tracks.append(MatroskaTrack())
            if identifier in PARENTS:
                self._walk(start, stop, depth + 1)
            elif identifier in BLOCKS:
                self._add_block(start, stop)
            elif identifier in LEAVES:
                largest = 1 << 24  # bytes of an element that is no block
                if stop - start > largest:
                    raise ValueError(f"element {identifier:x} has {stop - start} bytes")
                self._keep(identifier, _exactly(self._stream, start, stop - start))
            place = stop

    def _add_block(self, start: int, stop: int) -> None:
        self._stream.seek(start)
        number, length = _number(self._stream, keep_mark=False)
        head = self._stream.read(3)
        if len(head) < 3 or start + length + 3 > stop:
            raise ValueError(f"the block at byte {start} is cut short")
        if head[2] & 0x06:
            raise ValueError("its blocks are laced, which no recorder of depth does")
        track = next((track for track in self.tracks if track.number == number), None)
        if track is not None:
            time = (self._cluster_time + int.from_bytes(head[:2], "big", signed=True)) * self._scale
            track.blocks.append(Block(time, start + length + 3, stop - start - length - 3))

    def _keep(self, identifier: int, data: bytes) -> None:
        if identifier == CLUSTER_TIME:
            self._cluster_time = _whole(data)
        elif identifier == TIME_SCALE:
            self._scale = _whole(data)
        elif identifier == FILE_NAME:
            self._file_name = _text(data)
        elif identifier == FILE_DATA:
            self.attachments[self._file_name] = data
        elif not self.tracks:
            raise ValueError("a track's property stands before the first track")
        else:
            name, made = TRACK_FIELDS[identifier]
            setattr(self.tracks[-1], name, made(data))


def _whole(data: bytes) -> int:
    return int.from_bytes(data, "big")


def _text(data: bytes) -> str:
    return data.rstrip(b"\0").decode("utf-8", "replace")


TRACK_FIELDS: dict[int, tuple[str, Callable[[bytes], object]]] = {
    0xD7: ("number", _whole), 0x86: ("codec", _text), 0x63A2: ("private", bytes), 0x536E: ("name", _text),
    0xB0: ("width", _whole), 0xBA: ("height", _whole),
}  # fmt: skip
"""Element -> attribute of the current track, and the conversion of its bytes."""
LEAVES = frozenset({CLUSTER_TIME, TIME_SCALE, FILE_NAME, FILE_DATA, *TRACK_FIELDS})
"""Elements that are read at once."""


def _number(stream: IO[bytes], *, keep_mark: bool) -> tuple[int, int]:
    """Return a number of variable length (RFC 8794, 4) and the number of its bytes."""
    first = stream.read(1)
    if not first or first[0] == 0:
        raise ValueError("it ends within an element, or contains an invalid one")
    length = 9 - first[0].bit_length()
    data = first + stream.read(length - 1)
    if len(data) != length:
        raise ValueError("it ends within an element")
    value = int.from_bytes(data, "big")
    return (value if keep_mark else value & ((1 << 7 * length) - 1)), length


def _exactly(stream: IO[bytes], start: int, size: int) -> bytes:
    stream.seek(start)
    data = stream.read(size)
    if len(data) != size:
        raise ValueError(f"it ends within the {size} bytes from {start} on")
    return data
