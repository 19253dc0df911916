"""Sources of live depth frames: a RealSense camera, or a recording that is played at its own pace.

A source is anything with the attributes of `LiveSource`: `depthmocap live` needs no more of another camera.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from toolkit.io.errors import RecordingError, UsageError
from toolkit.recordings.opening import open_upright, recording_of
from toolkit.sensing.recording import Recording
from toolkit.sensing.stream import Frame

FILE = "file:"
REALSENSE = "realsense"


class LiveSource(Protocol):
    """A source of depth frames in real time.

    Attributes
    ----------
    name : for messages
    first : a recording of one frame: camera, vertical, background and the unit of the frames that follow
    """

    name: str
    first: Recording

    def frames(self) -> Iterator[Frame]:
        """Yield each frame as soon as it exists, until the source ends; a second call starts a file again.

        Raises
        ------
        RecordingError
            The camera is unplugged or a frame cannot be read.
        """
        ...

    def close(self) -> None:
        """Release the camera or the file."""
        ...


def live_source(text: str, **options: Any) -> LiveSource:
    """Open a source by its name.

    Parameters
    ----------
    text : "realsense", or "file:" and the path of a recording
    options : of `ReaderOptions`; for a camera `up_camera`, `background` and `rotate`

    Raises
    ------
    UsageError
        There is no such source.
    RecordingError
        The camera is not connected, or the recording cannot be read.
    """
    if text == REALSENSE:
        return RealSenseSource(**options)
    if text.startswith(FILE) and text != FILE:
        return RecordingSource(open_upright(text.removeprefix(FILE), **options))
    hint = f"; for a recording type {FILE}{text}" if Path(text).exists() else ""
    raise UsageError(f"{text!r} is no live source; give {REALSENSE}, or {FILE}RECORDING{hint}")


class RecordingSource:
    """A recording as a live source: each frame comes at its timestamp, counted from the call of `frames`."""

    def __init__(self, recording: Recording) -> None:
        self.name = recording.name
        self._recording = recording
        self.first = recording_of(
            recording.depth(0)[None],
            timestamps=recording.timestamps[:1],
            background=recording.background,
            name=recording.name,
            intrinsics=recording.camera.intrinsics,
            up_camera=tuple(recording.up_camera),
        )
        self.first.camera = recording.camera

    def frames(self) -> Iterator[Frame]:
        """See `LiveSource.frames`."""
        begun, first = time.perf_counter(), float(self._recording.timestamps[0])
        for frame in self._recording.stream():
            wait = begun + frame.timestamp - first - time.perf_counter()
            if wait > 0:
                time.sleep(wait)
            yield frame

    def close(self) -> None:
        """See `LiveSource.close`."""


class RealSenseSource:
    """The first connected Intel RealSense camera, through Open3D; depth is registered to its colour image.

    Parameters
    ----------
    options : of `ReaderOptions`
    """

    name = REALSENSE

    def __init__(self, **options: Any) -> None:
        from open3d.t.io import RealSenseSensor

        if not RealSenseSensor.enumerate_devices():
            raise RecordingError("no RealSense camera is connected; plug one in, or give file:RECORDING")
        self._sensor = RealSenseSensor()
        try:
            self._sensor.init_sensor()
            self._sensor.start_capture()
            metadata = self._sensor.get_metadata()
        except RuntimeError as error:
            raise RecordingError(
                f"the RealSense camera cannot be opened: {_reason(error)}; plug it in again"
            ) from error
        matrix = np.asarray(metadata.intrinsics.intrinsic_matrix)
        intrinsics = (matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
        self._millimetres = 1000.0 / float(metadata.depth_scale)
        frame = self._next()
        self.first = recording_of(
            frame[0][None], timestamps=np.array([frame[1]]), name=self.name, **{"intrinsics": intrinsics, **options}
        )

    def frames(self) -> Iterator[Frame]:
        """See `LiveSource.frames`."""
        number = 0
        while True:
            depth, timestamp = self._next()
            yield Frame(self.first.convert(depth, number), timestamp)
            number += 1

    def close(self) -> None:
        """See `LiveSource.close`."""
        self._sensor.stop_capture()

    def _next(self) -> tuple[np.ndarray, float]:
        """Return the next depth image, uint16 (H, W), millimetres, and its time in seconds."""
        # Without a frame of a camera after which it counts as unplugged; librealsense waits as long for a frame set.
        silent_seconds = 5.0
        deadline = time.perf_counter() + silent_seconds
        while time.perf_counter() < deadline:
            try:
                images = self._sensor.capture_frame(True, True)
            except RuntimeError as error:
                raise RecordingError(f"the RealSense camera stopped: {_reason(error)}; plug it in again") from error
            if not images.is_empty():
                depth = np.asarray(images.depth.to_legacy(), dtype=np.uint16)
                if self._millimetres != 1.0:
                    depth = np.minimum(np.rint(depth * self._millimetres), 65534).astype(np.uint16)
                return depth, self._sensor.get_timestamp() / 1e6
        raise RecordingError(f"the RealSense camera gave no frame for {silent_seconds:g} s; plug it in again")


def _reason(error: RuntimeError) -> str:
    """Return the last line of a message of Open3D, without colours."""
    lines = [line for line in str(error).replace("\x1b[0;m", "").splitlines() if line.strip()]
    return lines[-1].strip() if lines else "no reason given"
