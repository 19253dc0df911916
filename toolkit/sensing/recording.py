"""Depth recordings: frames of one camera in a canonical form, with their metadata.

A recording is never mirrored: a person who faces the camera has the left hand at positive x. Frames are read one at a
time; a long recording is never read whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import compress, islice
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import RecordingError
from toolkit.sensing.camera import Camera, rotated_points
from toolkit.sensing.conversion import DepthConverter
from toolkit.sensing.joints2d import Joints2D, check_rows, mirrored_rows, rotated_rows
from toolkit.sensing.stream import Frame

JOINT_COUNT = len(skeleton.REPORTED)


@dataclass(frozen=True, eq=False)
class Vertical:
    """Vertical direction and its source.

    Attributes
    ----------
    up_camera : float64 (3,), camera frame, length 1
    source : "option" (given when the recording was opened), "file" (stored in it), "floor" (a detected floor) or
        "assumed" (from walls and people, else the image's vertical)
    height : metres of the camera above the floor, None without a detected floor
    """

    up_camera: np.ndarray
    source: str
    height: float | None = None


@dataclass(frozen=True, eq=False)
class FrameSource:
    """Raw frames as stored in files, before the conversion of units, mirroring and projection.

    Attributes
    ----------
    count : number of frames
    depth : function that returns raw frame `i`: numbers (H, W)
    color : function that returns the colour of frame `i`, uint8 (H, W, 3), RGB, or None
    in_order : function that returns the raw frames in order, where `depth` is slower; None = `depth`
    """

    count: int
    depth: Callable[[int], np.ndarray]
    color: Callable[[int], np.ndarray | None] = lambda i: None
    in_order: Callable[[], Iterator[np.ndarray]] | None = None

    def frames(self) -> Iterator[np.ndarray]:
        """Return the raw frames in order."""
        return map(self.depth, range(self.count)) if self.in_order is None else self.in_order()


def memory_path(name: str) -> Path:
    """Return the placeholder path of a recording of arrays in memory; no file has this name."""
    return Path(f"<{name}>")


@dataclass(eq=False)
class Recording:
    """Depth recording: raw frames of a `FrameSource`, converted when they are read.

    Depth is uint16 (H, W), millimetres along z, 0 = no measurement. Metadata are given in the frame of the raw images.
    For a mirrored source they are flipped here; for a camera on its side they are rotated together with the images.

    Attributes
    ----------
    name : stem of the file or name of the folder
    path : file or folder of the recording
    camera : intrinsics of every frame, lens distortion included
    timestamps : float64 (T,), seconds
    source, converter : raw frames and their converter
    find_vertical : estimates the vertical, if it is not stored
    background : uint16 (H, W), depth of the empty scene, or None
    joints : float32 (T, 20, 3), true joints, metres, camera frame, NaN = unknown, or None; of several people (or of
        no person) (N, T, 20, 3), NaN while absent
    reference_joints : the same as estimated by another system, or None
    image_joints : float32 (N, T, 20, 3), detected joints in the images of up to N people in any order: u, v in pixels
        of the depth image and confidence, NaN = unknown; or None
    stored_up : (3,), the vertical in the camera frame as stored, or None
    options : options of the reader, JSON-compatible
    times_assumed : True if neither the file nor an option has times or a frame rate
    raw_camera : camera of the stored images, before they are flipped or rotated
    """

    name: str
    path: Path
    camera: Camera
    timestamps: np.ndarray
    source: FrameSource
    converter: DepthConverter
    find_vertical: Callable[[Recording], Vertical]
    background: np.ndarray | None = None
    joints: np.ndarray | None = None
    reference_joints: np.ndarray | None = None
    image_joints: np.ndarray | None = None
    stored_up: np.ndarray | None = None
    options: dict[str, Any] = field(default_factory=dict)
    times_assumed: bool = False
    raw_camera: Camera = field(init=False)

    def __post_init__(self) -> None:
        count = self.source.count
        if count == 0:
            raise RecordingError(f"{self.path} holds no frame; check that it was written to its end")
        self.timestamps = check_timestamps(self.timestamps, count, self.path)
        self.joints = check_joints(self.joints, count, "joints", self.path)
        self.reference_joints = check_joints(self.reference_joints, count, "reference_joints", self.path)
        self._kept = np.flatnonzero(np.diff(self.timestamps, prepend=-np.inf) > 0)
        self.timestamps = self.timestamps[self._kept]
        self._change(lambda joints: joints[..., self._kept, :, :], "joints", "reference_joints")
        if self.background is not None:
            self.background = self.converter.convert(
                np.asarray(self.background), self.camera, "background", check=False
            )
        self.raw_camera = self.camera
        if self.converter.mirrored:
            self.camera = self.camera.mirrored()
            mirror = np.array([-1, 1, 1], dtype=np.float32)
            self._change(lambda vectors: vectors * mirror, "joints", "reference_joints", "stored_up")
        self._turns = int(self.options.get("rotate", 0)) // 90
        if self._turns:
            self.camera = self.camera.rotated(self._turns)
            self._change(lambda v: rotated_points(v, self._turns), "joints", "reference_joints", "stored_up")
            if self.background is not None:
                self.background = self._upright(self.background)
        if self.image_joints is not None:
            self.give_joints_2d(self.image_joints)

    def _change(self, function: Callable[[np.ndarray], np.ndarray], *names: str) -> None:
        for name in names:
            if (value := getattr(self, name)) is not None:
                setattr(self, name, function(value))

    def _upright(self, image: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(np.rot90(image, -self._turns)) if self._turns else image

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def stored_frames(self) -> int:
        """Number of frames in the file; those that repeat the previous timestamp are left out with their joints."""
        return self.source.count

    def depth(self, i: int) -> np.ndarray:
        """Return frame `i`, 0 <= i < len: uint16 (H, W), millimetres along z, 0 = no measurement."""
        return self.convert(self.source.depth(self._kept[self._checked(i)]), i)

    def frames(self) -> Iterator[np.ndarray]:
        """Yield all frames in order; only one is in memory at a time."""
        chosen = np.isin(np.arange(self.source.count), self._kept)
        for i, raw in enumerate(compress(self.source.frames(), chosen)):
            yield self.convert(raw, i)

    def stream(self, start: int = 0, *, color: bool = False) -> Iterator[Frame]:
        """Yield the frames from number `start` on, with their colour if `color` is set."""
        for i, depth in islice(enumerate(self.frames()), start, None):
            yield Frame(depth, float(self.timestamps[i]), self.joints_2d(i), self.color(i) if color else None)

    def joints_2d(self, i: int) -> tuple[Joints2D, ...]:
        """Return the detected joints of all people in the image of frame `i`."""
        if self.image_joints is None:
            return ()
        people = (Joints2D.of_rows(rows) for rows in self.image_joints[:, self._checked(i)])
        return tuple(person for person in people if person.confidence.any())

    def give_joints_2d(self, rows: np.ndarray) -> None:
        """Replace `image_joints` by joints (T, 20, 3) or (N, T, 20, 3), detected in the stored images.

        T is `stored_frames`. The joints are flipped and rotated like the images. A detector on mirrored images
        exchanges left and right.
        """
        joints = check_rows(rows, self.stored_frames, self.path)
        assert joints is not None
        joints = joints[:, self._kept]
        if self.converter.mirrored:
            joints = mirrored_rows(joints, self.raw_camera.width)
        self.image_joints = rotated_rows(joints, self.raw_camera, self._turns)

    @property
    def has_color(self) -> bool:
        """True if the frames have colour."""
        return self.color(0) is not None

    def color(self, i: int) -> np.ndarray | None:
        """Return the colour of frame `i`, uint8 (H, W, 3), RGB registered to depth, or None."""
        image = self.source.color(self._kept[self._checked(i)])
        if image is None:
            return None
        return self._upright(np.ascontiguousarray(image[:, ::-1]) if self.converter.mirrored else image)

    @property
    def in_memory(self) -> bool:
        """True if the frames are arrays in memory, without a file."""
        return self.path == memory_path(self.name)

    @property
    def up_camera(self) -> np.ndarray:
        """Vertical in the camera frame, float64 (3,), of length 1."""
        return self.vertical.up_camera

    @cached_property
    def vertical(self) -> Vertical:
        """Vertical as stored, else from a detected floor, else from walls and people of the first seconds."""
        if self.stored_up is not None:
            up = np.asarray(self.stored_up, dtype=np.float64)
            if up.shape != (3,) or not np.isfinite(up).all() or math.hypot(*up) < 1e-6:
                raise RecordingError(f"up_camera {up.tolist()} of {self.path} is no direction; give three numbers")
            return Vertical(up / math.hypot(*up), "option" if "up_camera" in self.options else "file")
        return self.find_vertical(self)

    def _checked(self, i: int) -> int:
        if not 0 <= i < len(self):
            raise RecordingError(f"{self.path} has no frame {i}; it has frames 0 to {len(self) - 1}")
        return i

    def convert(self, raw: np.ndarray, i: int) -> np.ndarray:
        """Return a raw frame with number `i` in canonical form: uint16 (H, W), millimetres."""
        return self._upright(self.converter.convert(raw, self.raw_camera, f"frame {i} of {self.path}"))


def check_timestamps(timestamps: np.ndarray, count: int, path: Path) -> np.ndarray:
    """Return timestamps as float64 (count,).

    Raises
    ------
    RecordingError
        They have a wrong length, are not finite, decrease, are all equal, or are not seconds.
    """
    times = np.asarray(timestamps, dtype=np.float64)
    if times.shape != (count,):
        raise RecordingError(f"{path} has {count} frames and timestamps of shape {times.shape}; write one per frame")
    if not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise RecordingError(f"the timestamps of {path} are not finite or run backwards; write seconds, in order")
    if count > 1 and times[0] == times[-1]:
        raise RecordingError(f"all timestamps of {path} are {times[0]:g}; write one per frame, or leave them out")
    longest_step = 10.0  # largest median step of the timestamps, seconds; a larger one means milliseconds
    if count > 1 and (step := float(np.median(np.diff(times)))) > longest_step:
        raise RecordingError(f"the timestamps of {path} are {step:g} s apart; write seconds, not milliseconds")
    return times


def frame_rate_of(timestamps: np.ndarray) -> float:
    """Return the frames per second of `timestamps` (T,), seconds, from their median step; 30 if undefined."""
    steps = np.diff(timestamps)
    return 1.0 / float(np.median(steps)) if len(steps) and np.median(steps) > 0 else 30.0


def check_joints(joints: np.ndarray | None, count: int, key: str, path: Path) -> np.ndarray | None:
    """Return a copy as float32 (count, 20, 3), or (N, count, 20, 3) of N people; NaN = unknown.

    Raises
    ------
    RecordingError
        The shape is wrong.
    """
    if joints is None:
        return None
    array = np.array(joints, dtype=np.float32)
    expected = (count, JOINT_COUNT, 3)
    if array.shape != expected and not (array.ndim == 4 and array.shape[1:] == expected):
        raise RecordingError(
            f"{key} of {path} has shape {array.shape}; expected {expected}, or one such array for each of N people"
        )
    return np.where(np.isfinite(array), array, np.float32(np.nan))
