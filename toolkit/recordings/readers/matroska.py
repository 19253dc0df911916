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
from enum import IntEnum
from pathlib import Path
from typing import IO, NamedTuple

from toolkit.io.safe_open import open_file


class Element(IntEnum):
    """Identifiers of the elements."""

    EBML = 0x1A45DFA3
    SEGMENT = 0x18538067
    CLUSTER = 0x1F43B675
    TRACKS = 0x1654AE6B
    ATTACHMENTS = 0x1941A469
    INFO = 0x1549A966
    TRACK_ENTRY = 0xAE
    TRACK_NUMBER = 0xD7
    CODEC = 0x86
    CODEC_PRIVATE = 0x63A2
    NAME = 0x536E
    VIDEO = 0xE0
    WIDTH = 0xB0
    HEIGHT = 0xBA
    CLUSTER_TIME = 0xE7
    SIMPLE_BLOCK = 0xA3
    BLOCK_GROUP = 0xA0
    BLOCK = 0xA1
    TIME_SCALE = 0x2AD7B1
    ATTACHED_FILE = 0x61A7
    FILE_NAME = 0x466E
    FILE_DATA = 0x465C


PARENTS = frozenset(
    {
        Element.SEGMENT,
        Element.CLUSTER,
        Element.TRACKS,
        Element.ATTACHMENTS,
        Element.INFO,
        Element.TRACK_ENTRY,
        Element.VIDEO,
        Element.BLOCK_GROUP,
        Element.ATTACHED_FILE,
    }
)
"""Identifiers of the elements that contain relevant elements."""


class Block(NamedTuple):
    """Position of one frame: time in nanoseconds, first byte and number of bytes."""

    time: int
    start: int
    size: int


@dataclass
class MatroskaTrack:
    """One track: name, codec, codec private data, size in pixels (0 without), and blocks."""

    number: int = 0
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
        self._by_number: dict[int, MatroskaTrack] = {}
        self.tracks: list[MatroskaTrack] = []
        self.attachments: dict[str, bytes] = {}
        self._scale, self._cluster_time, self._file_name = 1_000_000, 0, ""
        weakref.finalize(self, self._stream.close)
        identifier, *_ = self._element_at(0)
        if identifier != Element.EBML:
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
            if stop > end and not (identifier in (Element.SEGMENT, Element.CLUSTER) and stop == self._size):
                raise ValueError(f"it ends within an element at byte {place}")
            if identifier == Element.TRACK_ENTRY:
                self.tracks.append(MatroskaTrack())
            if identifier in PARENTS:
                self._walk(start, stop, depth + 1)
            elif identifier in (Element.SIMPLE_BLOCK, Element.BLOCK):
                self._add_block(start, stop)
            elif identifier in LEAVES:
                LEAVES[identifier](self, _exactly(self._stream, start, self._bounded(identifier, stop - start)))
            place = stop

    @staticmethod
    def _bounded(identifier: int, size: int) -> int:
        small = 1 << 24  # maximum size of an element that is no block or attachment, bytes
        if size > small:
            raise ValueError(f"element {identifier:x} has {size} bytes")
        return size

    def _add_block(self, start: int, stop: int) -> None:
        self._stream.seek(start)
        number, length = _number(self._stream, keep_mark=False)
        head = self._stream.read(3)
        if len(head) < 3 or start + length + 3 > stop:
            raise ValueError(f"the block at byte {start} is cut short")
        if head[2] & 0x06:
            raise ValueError("its blocks are laced, which no recorder of depth does")
        track = self._by_number.get(number)
        if track is not None:
            time = (self._cluster_time + int.from_bytes(head[:2], "big", signed=True)) * self._scale
            track.blocks.append(Block(time, start + length + 3, stop - start - length - 3))

    def _set_number(self, data: bytes) -> None:
        self.tracks[-1].number = _whole(data)
        self._by_number[_whole(data)] = self.tracks[-1]

    def _set_time(self, data: bytes) -> None:
        self._cluster_time = _whole(data)

    def _set_scale(self, data: bytes) -> None:
        self._scale = _whole(data)

    def _set_file_name(self, data: bytes) -> None:
        self._file_name = data.decode("utf-8", "replace")

    def _add_file(self, data: bytes) -> None:
        self.attachments[self._file_name] = data


def _of_track(name: str, made: Callable[[bytes], object]) -> Callable[[Matroska, bytes], None]:
    """Return the function that sets one attribute of the current track."""

    def set_attribute(file: Matroska, data: bytes) -> None:
        if not file.tracks:
            raise ValueError("a track's property stands before the first track")
        setattr(file.tracks[-1], name, made(data))

    return set_attribute


def _whole(data: bytes) -> int:
    return int.from_bytes(data, "big")


def _text(data: bytes) -> str:
    return data.rstrip(b"\0").decode("utf-8", "replace")


LEAVES: dict[int, Callable[[Matroska, bytes], None]] = {
    Element.TRACK_NUMBER: Matroska._set_number,
    Element.CODEC: _of_track("codec", _text),
    Element.CODEC_PRIVATE: _of_track("private", bytes),
    Element.NAME: _of_track("name", _text),
    Element.WIDTH: _of_track("width", _whole),
    Element.HEIGHT: _of_track("height", _whole),
    Element.CLUSTER_TIME: Matroska._set_time,
    Element.TIME_SCALE: Matroska._set_scale,
    Element.FILE_NAME: Matroska._set_file_name,
    Element.FILE_DATA: Matroska._add_file,
}
"""Identifier -> handler of the elements that are read immediately."""


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
