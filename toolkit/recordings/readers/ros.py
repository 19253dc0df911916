"""Depth recordings as ROS messages: RealSense `.db3` and old `.bag`, ROS 1 bags, ROS 2 `.db3`, mcap and folders.

`rosbags` reads the files. The depth topic is found by its type, name and first message, its camera by the `CameraInfo`
topic with the most similar name. RealSense files contain the metres per unit; otherwise 16-bit values are millimetres
and 32FC1 metres, as defined by ROS. Colour is read if it is registered to depth. The vertical comes from an
accelerometer with the axes of the camera.
"""

from __future__ import annotations

import struct
import weakref
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from os.path import commonprefix
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.io.files import is_file, is_folder
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import chosen_camera, damaged, decoded, recording_of_source, upright
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import FrameSource, Recording

SUFFIXES = (".bag", ".mcap", ".db3")
METADATA = "metadata.yaml"
"""Metadata file of a ROS 2 folder."""
IMAGE, COMPRESSED, CAMERA, IMU = (
    f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "CameraInfo", "Imu")
)  # fmt: skip
ENCODINGS = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
"""Encodings of depth images; `mono16` occurs in old RealSense files."""
COLOR_ENCODINGS = {"rgb8": (3, False), "bgr8": (3, True), "rgba8": (4, False), "bgra8": (4, True)}
"""Encoding -> number of channels, and whether blue is first."""
QUANTISED = struct.Struct("<iff")
"""Header of the PNG in a `compressedDepth` message: format, and the constants A and B of `depth = A / (value - B)` for
images of type 32FC1."""
REALSENSE_ACCELERATION = "/Accel_0/imu/data"
"""Last part of the SDK's acceleration topic, in the axes of its depth camera."""
REALSENSE_UNIT = struct.Struct("<f")
"""Metres per unit, which old RealSense files store behind the last field of an image message."""


def matches(path: Path) -> bool:
    """Return whether `path` is a `.db3`, `.bag` or `.mcap` file, or a ROS 2 folder."""
    if is_file(path):
        return path.suffix.lower() in SUFFIXES
    return is_folder(path) and is_file(path / METADATA)


class MessageFile:
    """Messages of a file or a ROS 2 folder by topic; raises RecordingError for a damaged one.

    Attributes
    ----------
    path : the file or folder
    topics : topic -> type, such as `sensor_msgs/msg/Image`
    """

    def __init__(self, path: Path) -> None:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_typestore

        self.path = path
        if path.suffix.lower() != ".bag" and set("?#%") & set(str(path)):  # `rosbags` puts the path into a URI
            raise RecordingError(f"{path} cannot be opened with '?', '#' or '%' in its path; rename it")
        self._ros1 = path.suffix.lower() == ".bag"
        with damaged(path):
            types = get_typestore(Stores.ROS1_NOETIC if self._ros1 else Stores.ROS2_HUMBLE)
            self._deserialize: Any = types.deserialize_ros1 if self._ros1 else types.deserialize_cdr
            self._reader: Any = rosbag1.Reader(path) if self._ros1 else rosbag2.Reader(path)
            self._reader.open()
            weakref.finalize(self, _close, self._reader)
            self.topics: dict[str, str] = {c.topic: c.msgtype for c in self._reader.connections}
            if not all(isinstance(topic, str) for topic in self.topics):
                raise ValueError("a topic has no name")
        self._times: dict[str, np.ndarray] = {}

    def times(self, topic: str) -> np.ndarray:
        """Return the times (T,) of the messages of a topic, int64 nanoseconds, ascending.

        A ROS 1 bag has an index, other files are scanned once.
        """
        if topic not in self._times:
            chosen = self._connections(topic)
            with damaged(self.path):
                if self._ros1:
                    times = sorted(entry.time for c in chosen for entry in self._reader.indexes[c.id])
                else:
                    times = [time for _, time, _ in self._reader.messages(chosen)]
                self._times[topic] = np.array(times, dtype=np.int64)
        return self._times[topic]

    def messages(self, topic: str, start: int = 0) -> Iterator[tuple[Any, bytes]]:
        """Yield the messages of a topic in the order of `times`, from number `start` on.

        The second value holds the bytes behind the last field, which only RealSense files have.
        """
        first, skipped = None, 0
        if start:
            times = self.times(topic)
            if start >= len(times):
                return
            first = int(times[start])
            skipped = start - int(np.searchsorted(times, first))  # messages with equal times
        with damaged(self.path):
            stored = self._reader.messages(self._connections(topic), start=first)
            for _, _, data in islice(stored, skipped, None):
                yield self._decoded(bytes(data), self.topics[topic])

    def first(self, topic: str) -> tuple[Any, bytes] | None:
        """Return the first message of a topic as `messages` yields it, or None."""
        return next(self.messages(topic), None)

    def _connections(self, topic: str) -> list[Any]:
        return [c for c in self._reader.connections if c.topic == topic]

    def _decoded(self, data: bytes, kind: str) -> tuple[Any, bytes]:
        from rosbags.serde import SerdeError

        try:
            return self._deserialize(data, kind), b""
        except SerdeError:
            if kind != IMAGE:
                raise
            return self._deserialize(data[: -REALSENSE_UNIT.size], kind), data[-REALSENSE_UNIT.size :]


def _close(reader: Any) -> None:
    """Close a reader of `rosbags`, unless one of its queries is still open; that one closes it."""
    with suppress(Exception):  # of the database that it uses
        reader.close()


def raw_pixels(message: Any) -> np.ndarray:
    """Return depth (H, W) or colour (H, W, 3) of `sensor_msgs/Image`; raises ValueError for other encodings."""
    encoding, height, width, step = message.encoding, message.height, message.width, message.step
    if encoding in ENCODINGS:
        code, channels = ENCODINGS[encoding], 1
    elif encoding in COLOR_ENCODINGS:
        code, channels = "u1", COLOR_ENCODINGS[encoding][0]
    else:
        raise ValueError(f"its images are {encoding}; depth is read from {', '.join(ENCODINGS)}")
    row = width * channels * int(code[1])
    if not (0 < row <= step and step * height == len(message.data)):
        raise ValueError(f"an image of {width}x{height} {encoding} has {len(message.data)} bytes")
    rows = np.ascontiguousarray(message.data.reshape(height, step)[:, :row])
    array = rows.view((">" if message.is_bigendian else "<") + code).astype(code)
    if channels > 1:
        array = array.reshape(height, width, channels)[:, :, :3]
        array = array[:, :, ::-1] if COLOR_ENCODINGS[encoding][1] else array
    return np.ascontiguousarray(array)


def compressed_pixels(message: Any) -> np.ndarray:
    """Return depth (`compressedDepth` as PNG) or colour (PNG or JPEG) of `sensor_msgs/CompressedImage`.

    Raises ValueError for damaged images and other encodings.
    """
    import cv2

    form, content = message.format, message.data.tobytes()
    encoding = form.split(";")[0].strip()
    if "compressedDepth" not in form:
        image = decoded(content, cv2.IMREAD_COLOR)
        if image is None:
            raise ValueError(f"an image compressed as {form!r} cannot be decoded")
        return np.ascontiguousarray(image[:, :, ::-1])
    _, a, b = QUANTISED.unpack(content[: QUANTISED.size])
    image = decoded(content[QUANTISED.size :], cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype != np.uint16 or image.ndim != 2 or encoding not in ENCODINGS:
        raise ValueError(f"depth compressed as {form!r} is not read; write it as 16UC1 PNG")
    if encoding != "32FC1":
        return image
    with np.errstate(divide="ignore", invalid="ignore"):
        metres = np.where(image > 0, a / (image.astype(np.float32) - np.float32(b)), np.float32(0))
    return np.asarray(metres, dtype=np.float32)


def _frames(file: MessageFile, topic: str, color_topic: str | None) -> FrameSource:
    """Return the depth images of a topic, with the nearest colour images in time of another topic."""
    times = file.times(topic)
    color_times = file.times(color_topic) if color_topic else np.empty(0, np.int64)

    def images(of: str, start: int) -> Iterator[np.ndarray]:
        return (_image_of(file, of, message) for message, _ in file.messages(of, start))

    ahead = (0, images(topic, 0))  # number of the next frame, and the frames from it on: reading in order is fast

    def depth(i: int) -> np.ndarray:
        nonlocal ahead
        stream = ahead[1] if ahead[0] == i else images(topic, i)
        image = next(stream, None)
        if image is None:
            raise RecordingError(f"{file.path} ends before frame {i} of {topic}; copy or record it again")
        ahead = (i + 1, stream)
        return image

    def color(i: int) -> np.ndarray | None:
        if color_topic is None or not len(color_times):
            return None
        return next(images(color_topic, int(np.abs(color_times - times[i]).argmin())))

    return FrameSource(len(times), depth, color, lambda: images(topic, 0))


def _image_of(file: MessageFile, topic: str, message: Any) -> np.ndarray:
    try:
        return raw_pixels(message) if file.topics[topic] == IMAGE else compressed_pixels(message)
    except (ValueError, struct.error) as error:
        raise RecordingError(f"topic {topic} of {file.path}: {error}; record it again as 16-bit images") from error


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a file of ROS messages; the option `track` names one of several depth topics."""
    file = MessageFile(path)
    topic = _depth_topic(file, options.track)
    first = file.first(topic)
    if first is None:
        raise RecordingError(f"topic {topic} of {path} has no message; record it again")
    image = _image_of(file, topic, first[0])
    if image.ndim != 2:
        raise RecordingError(f"topic {topic} of {path} holds colour images; depth has 16 bits or is 32FC1")
    times = file.times(topic)
    source = _frames(file, topic, color_topic(file, topic))
    camera = _camera(file, topic) if options.intrinsics is None else None
    return recording_of_source(
        path,
        source,
        camera or chosen_camera(options, image.shape, path),
        options,
        unit="m" if image.dtype == np.float32 else _unit(file, topic, first[1]),
        timestamps=1e-9 * (times - times[0]),
        up=_up(file),
    )


def _depth_topic(file: MessageFile, wanted: str | None) -> str:
    """Return the depth topic: the named one, or the only one; raw images are preferred to compressed ones."""
    images = [topic for topic, kind in file.topics.items() if kind in (IMAGE, COMPRESSED)]
    found = [topic for topic in images if "depth" in topic.lower() or topic == wanted]
    bases = {topic.removesuffix("/compressedDepth"): topic for topic in sorted(found, reverse=True)}
    there = ", ".join(images) or "none"
    if wanted is not None:
        if wanted not in found:
            raise RecordingError(f"{file.path} has no image topic {wanted!r}; it has: {there}")
        return wanted
    if not bases:
        raise RecordingError(f"{file.path} has no depth topic; its image topics are: {there}")
    if len(bases) > 1:
        names = ", ".join(sorted(bases))
        raise RecordingError(f"{file.path} has {len(bases)} depth topics; give --track TOPIC: {names}")
    return next(iter(bases.values()))


def color_topic(file: MessageFile, depth: str) -> str | None:
    """Return the colour topic to which depth is registered, by the names of RealSense and others."""
    if "aligned_depth_to_color" not in depth:
        return None
    return next((t for t, kind in sorted(file.topics.items()) if kind == IMAGE and "/color/image" in t), None)


def _camera(file: MessageFile, topic: str) -> Camera | None:
    """Return the camera of the `CameraInfo` topic whose name shares the longest prefix with the image's."""
    near = [(len(commonprefix([topic, t])), t) for t, kind in sorted(file.topics.items()) if kind == CAMERA]
    near = [(length, t) for length, t in near if "/" in topic[1:length]]
    if not near:
        return None
    name = max(near, key=lambda pair: pair[0])[1]
    first = file.first(name)
    if first is None:
        return None
    info = first[0]
    shape = (info.height, info.width)
    lens, matrix, projection = (info.D, info.K, info.P) if hasattr(info, "K") else (info.d, info.k, info.p)
    rectified = "rect" in topic.rsplit("/", 1)[-1] and projection.any()
    if rectified:  # then P is the camera of the image without distortion
        return Camera.from_intrinsics(projection[[0, 5, 2, 6]], shape)
    if info.distortion_model in ("equidistant", "fisheye") and lens.any():
        raise RecordingError(f"{name} of {file.path} is a fisheye lens, which is not read; give rectified images")
    return Camera.from_intrinsics(matrix[[0, 4, 2, 5]], shape, lens if lens.any() else None)


def _unit(file: MessageFile, topic: str, behind: bytes) -> str | float:
    """Return the unit of whole numbers: from the RealSense message, from the sensor option, else as defined by ROS."""
    if behind and 1e-6 < (unit := REALSENSE_UNIT.unpack(behind)[0]) < 0.1:
        return float(f"{unit:.6g}")
    sensor = topic.split("/Depth_")[0]
    for name in ("Depth Units", "Depth_Units"):
        option = f"{sensor}/option/{name}/value"
        if option in file.topics and (found := file.first(option)) is not None:
            with damaged(file.path):
                return float(found[0].data)
    return "mm"


def _up(file: MessageFile) -> np.ndarray | None:
    """Return the vertical from an accelerometer in the axes of the camera, or None."""
    accelerations = 2000  # number of accelerometer messages in the median of the vertical (some seconds)
    for topic, kind in sorted(file.topics.items()):
        if kind != IMU:
            continue
        read = [message for message, _ in islice(file.messages(topic), accelerations)]
        if read and (topic.endswith(REALSENSE_ACCELERATION) or "optical" in read[0].header.frame_id):
            forces = [message.linear_acceleration for message in read]
            return upright(np.array([(force.x, force.y, force.z) for force in forces]))
    return None
