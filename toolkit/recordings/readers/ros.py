"""Depth recordings as ROS messages: RealSense `.db3` and old `.bag`, ROS 1 bags, ROS 2 `.db3`, mcap and folders.

The depth topic is found by its type, name and first message, its camera by the `CameraInfo` topic with the most similar
name. RealSense files contain the metres per unit; otherwise 16-bit values are millimetres and 32FC1 metres, as defined
by ROS. Colour is read if it is registered to depth. The vertical comes from an accelerometer with the axes of the
camera.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import islice
from os.path import commonprefix
from pathlib import Path

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.io.files import is_file, is_folder
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers import ros_messages as decode
from toolkit.recordings.readers.base import FileFacts, chosen_camera, damaged, recording_of_source, upright
from toolkit.recordings.readers.ros_files import BAG_SUFFIXES, METADATA, SQLITE_SUFFIX, MessageFile, open_messages
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import FrameSource, Recording

IMAGE, COMPRESSED, CAMERA, IMU = (
    f"sensor_msgs/{name}" for name in ("Image", "CompressedImage", "CameraInfo", "Imu")
)  # fmt: skip
REALSENSE_ACCELERATION = "/Accel_0/imu/data"
"""Last part of the SDK's acceleration topic, in the axes of its depth camera."""


def matches(path: Path) -> bool:
    """Return whether `path` is a `.db3`, `.bag` or `.mcap` file, or a ROS 2 folder."""
    if is_file(path):
        return path.suffix.lower() in (*BAG_SUFFIXES, SQLITE_SUFFIX)
    return is_folder(path) and is_file(path / METADATA)


class _RosFrames(FrameSource):
    """Depth images of a topic, with the nearest colour images in time of another topic."""

    def __init__(self, path: Path, file: MessageFile, depth: str, color: str | None) -> None:
        self._path, self._file, self._depth, self._color = path, file, depth, color
        self.times = file.times(depth)
        self._color_times = file.times(color) if color else np.empty(0, np.int64)
        self._ahead: tuple[int, Iterator[decode.Picture]] = (0, self._pictures(depth, 0))

    def __len__(self) -> int:
        return len(self.times)

    def depth(self, i: int) -> np.ndarray:
        """Return raw frame `i`; reading in order is fast."""
        at, pictures = self._ahead
        if at != i:
            pictures = self._pictures(self._depth, i)
        picture = next(pictures, None)
        if picture is None:
            raise RecordingError(f"{self._path} ends before frame {i} of {self._depth}; copy or record it again")
        self._ahead = (i + 1, pictures)
        return picture.pixels

    def frames(self) -> Iterator[np.ndarray]:
        """Yield the raw frames in order."""
        return (picture.pixels for picture in self._pictures(self._depth, 0))

    def color(self, i: int) -> np.ndarray | None:
        """Return the colour at the time of frame `i` if it is registered to depth, else None."""
        if self._color is None or not len(self._color_times):
            return None
        nearest = int(np.abs(self._color_times - self.times[i]).argmin())
        return next(self._pictures(self._color, nearest)).pixels

    def _pictures(self, topic: str, start: int) -> Iterator[decode.Picture]:
        for data in self._file.messages(topic, start):
            yield picture_of(self._path, self._file, topic, data)


def picture_of(path: Path, file: MessageFile, topic: str, data: bytes) -> decode.Picture:
    """Decode the image of one message; raises RecordingError for another kind or truncated data."""
    decoded = decode.picture if file.topics[topic] == IMAGE else decode.compressed_picture
    try:
        return decoded(data, file.cdr)
    except (ValueError, struct.error) as error:
        raise RecordingError(f"topic {topic} of {path}: {error}; record it again as 16-bit images") from error


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a file of ROS messages; the option `track` names one of several depth topics."""
    file = open_messages(path)
    topic = depth_topic(path, file, options.track)
    first = next(iter(file.messages(topic)), None)
    if first is None:
        raise RecordingError(f"topic {topic} of {path} has no message; record it again")
    picture = picture_of(path, file, topic, first)
    if picture.encoding not in decode.ENCODINGS:
        raise RecordingError(f"topic {topic} of {path} holds {picture.encoding} images; depth has 16 bits or is 32FC1")
    source = _RosFrames(path, file, topic, color_topic(file, topic))
    camera = _camera(path, file, topic) if options.intrinsics is None else None
    return recording_of_source(
        path,
        source,
        camera or chosen_camera(options, picture.pixels.shape, path),
        options,
        FileFacts(
            unit=unit_of(path, file, topic, picture),
            timestamps=1e-9 * (source.times - source.times[0]),
            up=_up(path, file),
        ),
    )


def depth_topic(path: Path, file: MessageFile, wanted: str | None) -> str:
    """Return the depth topic: the named one, or the only one; raw images are preferred to compressed ones.

    Raises
    ------
    RecordingError
        No depth topic exists, or several and none is named.
    """
    images = [topic for topic, kind in file.topics.items() if kind in (IMAGE, COMPRESSED)]
    found = [topic for topic in images if "depth" in topic.lower() or topic == wanted]
    bases = {topic.removesuffix("/compressedDepth"): topic for topic in sorted(found, reverse=True)}
    if wanted is not None:
        if wanted not in found:
            raise RecordingError(f"{path} has no image topic {wanted!r}; it has: {', '.join(images) or 'none'}")
        return wanted
    if not bases:
        raise RecordingError(f"{path} has no depth topic; its image topics are: {', '.join(images) or 'none'}")
    if len(bases) > 1:
        raise RecordingError(f"{path} has {len(bases)} depth topics; give --track TOPIC: {', '.join(sorted(bases))}")
    return next(iter(bases.values()))


def color_topic(file: MessageFile, depth: str) -> str | None:
    """Return the colour topic to which depth is registered, by the names of RealSense and others."""
    if "aligned_depth_to_color" not in depth:
        return None
    return next((t for t, kind in sorted(file.topics.items()) if kind == IMAGE and "/color/image" in t), None)


def _camera(path: Path, file: MessageFile, topic: str) -> Camera | None:
    """Return the camera of the `CameraInfo` topic whose name shares the longest prefix with the image's."""
    near = [(len(commonprefix([topic, t])), t) for t, kind in sorted(file.topics.items()) if kind == CAMERA]
    near = [(length, t) for length, t in near if "/" in topic[1:length]]
    if not near:
        return None
    name = max(near, key=lambda pair: pair[0])[1]
    data = next(iter(file.messages(name)), None)
    if data is None:
        return None
    with damaged(path):
        info = decode.camera_info(data, file.cdr)
    rectified = "rect" in topic.rsplit("/", 1)[-1] and any(info.P)
    if rectified:  # then P is the camera of the image without distortion
        return Camera.from_intrinsics(np.array([info.P[0], info.P[5], info.P[2], info.P[6]]), info.shape)
    if info.model in ("equidistant", "fisheye") and any(info.D):
        raise RecordingError(f"{name} of {path} is a fisheye lens, which is not read; give rectified images")
    lens = np.array(info.D) if any(info.D) else None
    return Camera.from_intrinsics(np.array([info.K[0], info.K[4], info.K[2], info.K[5]]), info.shape, lens)


def unit_of(path: Path, file: MessageFile, topic: str, picture: decode.Picture) -> str | float:
    """Return the metres per unit: from the RealSense message, from the sensor option, else as defined by ROS."""
    if picture.encoding == "32FC1":
        return "m"
    if len(picture.behind) == 4 and 1e-6 < (unit := struct.unpack("<f", picture.behind)[0]) < 0.1:
        return float(f"{unit:.6g}")
    sensor = topic.split("/Depth_")[0]
    for name in ("Depth Units", "Depth_Units"):
        option = f"{sensor}/option/{name}/value"
        if option in file.topics and (data := next(iter(file.messages(option)), None)) is not None:
            with damaged(path):
                text = file.topics[option] == "std_msgs/String"
                return float(decode.string(data, file.cdr)) if text else decode.single(data, file.cdr)
    return "mm"


def _up(path: Path, file: MessageFile) -> np.ndarray | None:
    """Return the vertical from an accelerometer in the axes of the camera, or None."""
    accelerations = 2000  # number of accelerometer messages in the median of the vertical (some seconds)
    for topic, kind in sorted(file.topics.items()):
        if kind != IMU:
            continue
        with damaged(path):
            read = [decode.acceleration(data, file.cdr) for data in islice(file.messages(topic), accelerations)]
        if read and (topic.endswith(REALSENSE_ACCELERATION) or "optical" in read[0][0]):
            return upright(np.array([acceleration for _, acceleration in read]))
    return None
