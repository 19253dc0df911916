"""ROS messages of a depth recording, decoded from ROS 1 and ROS 2 (CDR) bytes."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from toolkit.recordings.readers.base import decoded

ENCODINGS = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
"""Encodings of depth images; `mono16` occurs in old RealSense files."""
COLOR_ENCODINGS = {"rgb8": (3, False), "bgr8": (3, True), "rgba8": (4, False), "bgra8": (4, True)}
"""Encoding -> number of channels, and whether blue is first."""
QUANTISED = struct.Struct("<iff")
"""Header of the PNG in a `compressedDepth` message: format, and the constants A and B of `depth = A / (value - B)` for
images of type 32FC1."""


class Cursor:
    """Sequential reader of numbers and texts; raises ValueError for truncated bytes.

    Parameters
    ----------
    data : the message as stored
    cdr : ROS 2 encoding: four bytes with the byte order, numbers aligned to their size, texts with a final zero;
        otherwise ROS 1
    """

    def __init__(self, data: bytes, cdr: bool) -> None:
        self._data, self.cdr = memoryview(data), cdr
        self._place = self._start = 4 if cdr else 0
        if cdr and (len(data) < 4 or data[1] > 3):
            raise ValueError("it is no ROS 2 message")
        self._order = "<" if not cdr or data[1] & 1 else ">"

    def take(self, count: int) -> memoryview:
        """Return the next bytes."""
        piece = self._data[self._place : self._place + count]
        if count < 0 or len(piece) != count:
            raise ValueError(f"the message ends {count - len(piece)} bytes too early")
        self._place += count
        return piece

    def numbers(self, code: str, count: int) -> tuple[float, ...]:
        """Return numbers of one kind, named as in `struct`."""
        size = struct.calcsize(code)
        if self.cdr and count:
            self._place += -(self._place - self._start) % size
        return struct.unpack(f"{self._order}{count}{code}", self.take(size * count))

    def whole(self, code: str = "I") -> int:
        """Return one integer."""
        return int(self.numbers(code, 1)[0])

    def text(self) -> str:
        """Return a text."""
        return bytes(self.take(self.whole())).rstrip(b"\0").decode("utf-8", "replace")

    def rest(self) -> memoryview:
        """Return the remaining bytes."""
        return self._data[self._place :]


def read_header(cursor: Cursor) -> str:
    """Return the frame id of a header; its time is not used."""
    if not cursor.cdr:
        cursor.whole()  # sequence number
    cursor.whole("i" if cursor.cdr else "I")
    cursor.whole()
    return cursor.text()


@dataclass(frozen=True)
class CameraInfo:
    """Content of `sensor_msgs/CameraInfo`: size, lens model, `D`, `K` (9) and `P` (12), row by row."""

    shape: tuple[int, int]
    model: str
    D: tuple[float, ...]
    K: tuple[float, ...]
    P: tuple[float, ...]


def camera_info(data: bytes, cdr: bool) -> CameraInfo:
    """Decode `sensor_msgs/CameraInfo`."""
    cursor = Cursor(data, cdr)
    read_header(cursor)
    height, width = cursor.whole(), cursor.whole()
    model = cursor.text()
    lens = cursor.numbers("d", cursor.whole())
    matrix, _, projection = (cursor.numbers("d", n) for n in (9, 9, 12))
    return CameraInfo((height, width), model, lens, matrix, projection)


def acceleration(data: bytes, cdr: bool) -> tuple[str, np.ndarray]:
    """Return frame id and linear acceleration (3,), m/s^2, of `sensor_msgs/Imu`."""
    cursor = Cursor(data, cdr)
    frame = read_header(cursor)
    cursor.numbers("d", 4 + 9 + 3 + 9)
    return frame, np.array(cursor.numbers("d", 3))


class Picture(NamedTuple):
    """An image message: encoding, pixels (H, W) or (H, W, 3), and the bytes after its last field."""

    encoding: str
    pixels: np.ndarray
    behind: bytes


def picture(data: bytes, cdr: bool) -> Picture:
    """Decode `sensor_msgs/Image` of depth or colour; raises ValueError for other encodings."""
    cursor = Cursor(data, cdr)
    read_header(cursor)
    height, width = cursor.whole(), cursor.whole()
    encoding = cursor.text()
    big, step = cursor.whole("B"), cursor.whole()
    pixels = cursor.take(cursor.whole())
    if encoding in ENCODINGS:
        code, channels = ENCODINGS[encoding], 1
    elif encoding in COLOR_ENCODINGS:
        code, channels = "u1", COLOR_ENCODINGS[encoding][0]
    else:
        raise ValueError(f"its images are {encoding}; depth is read from {', '.join(ENCODINGS)}")
    row = width * channels * int(code[1])
    if not (0 < row <= step and step * height == len(pixels)):
        raise ValueError(f"an image of {width}x{height} {encoding} has {len(pixels)} bytes")
    rows = np.frombuffer(pixels, np.uint8).reshape(height, step)[:, :row]
    array = np.ascontiguousarray(rows).view((">" if big else "<") + code).astype(code)
    if channels > 1:
        array = array.reshape(height, width, channels)[:, :, :3]
        array = array[:, :, ::-1] if COLOR_ENCODINGS[encoding][1] else array
    return Picture(encoding, np.ascontiguousarray(array), bytes(cursor.rest()))


def compressed_picture(data: bytes, cdr: bool) -> Picture:
    """Decode `sensor_msgs/CompressedImage`: `compressedDepth` as PNG, colour as PNG or JPEG; raises ValueError."""
    import cv2

    cursor = Cursor(data, cdr)
    read_header(cursor)
    form = cursor.text()
    content = cursor.take(cursor.whole())
    encoding = form.split(";")[0].strip()
    if "compressedDepth" not in form:
        image = decoded(content, cv2.IMREAD_COLOR)
        if image is None:
            raise ValueError(f"an image compressed as {form!r} cannot be decoded")
        return Picture("rgb8", np.ascontiguousarray(image[:, :, ::-1]), b"")
    _, a, b = QUANTISED.unpack(content[: QUANTISED.size])
    image = decoded(content[QUANTISED.size :], cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype != np.uint16 or image.ndim != 2 or encoding not in ENCODINGS:
        raise ValueError(f"depth compressed as {form!r} is not read; write it as 16UC1 PNG")
    if encoding != "32FC1":
        return Picture(encoding, image, b"")
    with np.errstate(divide="ignore", invalid="ignore"):
        metres = np.where(image > 0, a / (image.astype(np.float32) - np.float32(b)), np.float32(0))
    return Picture(encoding, metres.astype(np.float32), b"")


def string(data: bytes, cdr: bool) -> str:
    """Decode `std_msgs/String`."""
    return Cursor(data, cdr).text()


def single(data: bytes, cdr: bool) -> float:
    """Decode `std_msgs/Float32`."""
    return float(Cursor(data, cdr).numbers("f", 1)[0])
