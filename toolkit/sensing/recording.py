"""A depth recording: frames of one camera, put right, with what is known beside them.

A recording is never mirrored: a person who faces the camera has the left hand at positive x. Frames are handed out
one at a time; a long recording is never read whole.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
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
LONGEST_STEP = 10.0
"""Seconds: frames farther apart, in the median, are no motion, but milliseconds taken for seconds."""


@dataclass(frozen=True, eq=False)
class Vertical:
    """Where up is.

    Attributes
    ----------
    up_camera : float64 (3,), camera frame, length 1
    source : "option" (given when the recording was opened), "file" (stored in it), "floor" (a floor is seen) or
        "assumed" (from walls and people, else the image's own vertical)
    height : metres of the camera above the floor, None where no floor is seen
    """

    up_camera: np.ndarray
    source: str
    height: float | None = None


class FrameSource(ABC):
    """Raw frames as they lie in files, before units, mirroring and projection are put right."""

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def depth(self, i: int) -> np.ndarray:
        """Raw frame `i`: numbers (H, W)."""

    def frames(self) -> Iterator[np.ndarray]:
        """Raw frames in order."""
        return (self.depth(i) for i in range(len(self)))

    def color(self, i: int) -> np.ndarray | None:
        """Colour of frame `i`, uint8 (H, W, 3), RGB, or None, as here."""
        return None


class SelectedFrames(FrameSource):
    """Some frames of another source, in order.

    Parameters
    ----------
    source : all frames
    numbers : int (N,), those that are kept, rising
    """

    def __init__(self, source: FrameSource, numbers: np.ndarray) -> None:
        self._source, self._numbers = source, numbers.tolist()

    def __len__(self) -> int:
        return len(self._numbers)

    def depth(self, i: int) -> np.ndarray:
        """Raw frame `i`."""
        return self._source.depth(self._numbers[i])

    def frames(self) -> Iterator[np.ndarray]:
        """Raw frames in order."""
        kept = set(self._numbers)
        return (raw for i, raw in enumerate(self._source.frames()) if i in kept)

    def color(self, i: int) -> np.ndarray | None:
        """Colour of frame `i`, or None."""
        return self._source.color(self._numbers[i])


def memory_path(name: str) -> Path:
    """What stands for the path of a recording of arrays in memory: no file has this name."""
    return Path(f"<{name}>")


@dataclass(eq=False)
class Recording:
    """A depth recording: raw frames from a `FrameSource`, converted on the way out.

    Depth is uint16 (H, W), millimetres along z, 0 = no measurement. Metadata are given in the frame of the raw images;
    a mirrored source has them flipped here, and a camera that stands on its side turned, together with its images.

    Attributes
    ----------
    name : stem of the file or name of the folder
    path : where it was read from
    camera : intrinsics of every frame, lens distortion included
    timestamps : float64 (T,), seconds
    source, converter : raw frames, and what puts them right
    find_vertical : finds where up is, where it is not stored
    background : uint16 (H, W), depth of the empty scene, or None
    joints : float32 (T, 20, 3), true joints, metres, camera frame, NaN = unknown, or None; of several people (or of
        no person) (N, T, 20, 3), NaN while absent
    reference_joints : the same, another system's estimate, or None
    image_joints : float32 (N, T, 20, 3), joints that a detector found in the images of up to N people in no order: u, v
        in pixels of the depth image and confidence, NaN = unknown; or None
    stored_up : (3,), the vertical in the camera frame as stored, or None
    options : the reader options it was opened with, fit for JSON
    times_assumed : True where neither the file nor an option has times or a frame rate
    raw_camera : the camera of the images as they lie in the file, before they are flipped or turned
    stored_frames : number of frames in the file. A frame that repeats the timestamp of the frame before is left out,
        with its joints, so that this can be more than the length
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
    stored_frames: int = field(init=False)

    def __post_init__(self) -> None:
        count, shape = len(self.source), self.camera.shape
        if count == 0:
            raise RecordingError(f"{self.path} holds no frame; check that it was written to its end")
        self.timestamps = check_timestamps(self.timestamps, count, self.path)
        self.joints = check_joints(self.joints, count, "joints", self.path)
        self.reference_joints = check_joints(self.reference_joints, count, "reference_joints", self.path)
        self.stored_frames = count
        self._kept = np.flatnonzero(np.diff(self.timestamps, prepend=-np.inf) > 0)
        if len(self._kept) < count:
            self.source, self.timestamps = SelectedFrames(self.source, self._kept), self.timestamps[self._kept]
            for name in ("joints", "reference_joints"):
                if getattr(self, name) is not None:
                    setattr(self, name, getattr(self, name)[..., self._kept, :, :])
        if self.background is not None:
            self.background = self.converter.convert(
                np.asarray(self.background), self.camera, "background", check=False
            )
            if self.background.shape != shape:
                raise RecordingError(
                    f"the background of {self.path} has shape {self.background.shape}, the frames have {shape}; "
                    "give one of the same size"
                )
        self.raw_camera = self.camera
        if self.converter.mirrored:
            self.camera = self.camera.mirrored()
            for joints in (self.joints, self.reference_joints):
                if joints is not None:
                    joints[..., 0] *= -1.0
            if self.stored_up is not None:
                self.stored_up = np.asarray(self.stored_up) * (-1.0, 1.0, 1.0)
        self._turns = int(self.options.get("rotate", 0)) // 90
        if self._turns:
            self._turn()
        if self.image_joints is not None:
            self.give_joints_2d(self.image_joints)

    def _turn(self) -> None:
        self.camera = self.camera.rotated(self._turns)
        for name in ("joints", "reference_joints", "stored_up"):
            value = getattr(self, name)
            if value is not None:
                setattr(self, name, rotated_points(value, self._turns))
        if self.background is not None:
            self.background = self._upright(self.background)

    def _upright(self, image: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(np.rot90(image, -self._turns)) if self._turns else image

    def __len__(self) -> int:
        return len(self.source)

    def depth(self, i: int) -> np.ndarray:
        """Frame `i`, 0 <= i < len: uint16 (H, W), millimetres along z, 0 = no measurement."""
        return self.convert(self.source.depth(self._checked(i)), i)

    def frames(self) -> Iterator[np.ndarray]:
        """All frames in order; only one is held at a time."""
        for i, raw in enumerate(self.source.frames()):
            yield self.convert(raw, i)

    def stream(self, start: int = 0, *, color: bool = False) -> Iterator[Frame]:
        """Frames from number `start` on, one at a time, with their colour if asked for."""
        for i, depth in islice(enumerate(self.frames()), start, None):
            yield Frame(depth, float(self.timestamps[i]), self.joints_2d(i), self.color(i) if color else None)

    def joints_2d(self, i: int) -> tuple[Joints2D, ...]:
        """Joints of all people whom a detector found in the image of frame `i`."""
        if self.image_joints is None:
            return ()
        people = (Joints2D.of_rows(rows) for rows in self.image_joints[:, self._checked(i)])
        return tuple(person for person in people if person.confidence.any())

    def give_joints_2d(self, rows: np.ndarray) -> None:
        """Take joints (T, 20, 3) or (N, T, 20, 3) found in the images as they were before they were flipped or turned.

        T is `stored_frames`. They replace `image_joints`. A detector that saw mirrored images called the sides by each
        other's names.
        """
        joints = check_rows(rows, self.stored_frames, self.path)
        assert joints is not None
        joints = joints[:, self._kept]
        if self.converter.mirrored:
            joints = mirrored_rows(joints, self.raw_camera.width)
        self.image_joints = rotated_rows(joints, self.raw_camera, self._turns)

    @property
    def has_color(self) -> bool:
        """Whether the frames come with colour."""
        return self.color(0) is not None

    def color(self, i: int) -> np.ndarray | None:
        """Colour of frame `i`, uint8 (H, W, 3), RGB registered to depth, or None."""
        image = self.source.color(self._checked(i))
        if image is None:
            return None
        return self._upright(np.ascontiguousarray(image[:, ::-1]) if self.converter.mirrored else image)

    @property
    def in_memory(self) -> bool:
        """Whether the frames are arrays that were handed over: no file holds them."""
        return self.path == memory_path(self.name)

    @property
    def up_camera(self) -> np.ndarray:
        """The vertical in the camera frame, float64 (3,), of length 1."""
        return self.vertical.up_camera

    @cached_property
    def vertical(self) -> Vertical:
        """Where up is: as stored, else from a visible floor, else from the walls and people of the first seconds."""
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
        """A raw frame as it is handed out under the number `i`: uint16 (H, W), millimetres."""
        return self._upright(self.converter.convert(raw, self.raw_camera, f"frame {i} of {self.path}"))


def check_timestamps(timestamps: np.ndarray, count: int, path: Path) -> np.ndarray:
    """Timestamps as float64 (count,), or RecordingError: wrong length, not finite, backwards, all equal, no seconds."""
    times = np.asarray(timestamps, dtype=np.float64)
    if times.shape != (count,):
        raise RecordingError(f"{path} has {count} frames and timestamps of shape {times.shape}; write one per frame")
    if not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise RecordingError(f"the timestamps of {path} are not finite or run backwards; write seconds, in order")
    if count > 1 and times[0] == times[-1]:
        raise RecordingError(f"all timestamps of {path} are {times[0]:g}; write one per frame, or leave them out")
    if count > 1 and (step := float(np.median(np.diff(times)))) > LONGEST_STEP:
        raise RecordingError(f"the timestamps of {path} are {step:g} s apart; write seconds, not milliseconds")
    return times


def check_joints(joints: np.ndarray | None, count: int, key: str, path: Path) -> np.ndarray | None:
    """A copy as float32 (count, 20, 3), or (N, count, 20, 3) of N people (NaN = unknown), or RecordingError."""
    if joints is None:
        return None
    array = np.array(joints, dtype=np.float32)
    expected = (count, JOINT_COUNT, 3)
    if array.shape != expected and not (array.ndim == 4 and array.shape[1:] == expected):
        raise RecordingError(
            f"{key} of {path} has shape {array.shape}; expected {expected}, or one such array for each of N people"
        )
    return np.where(np.isfinite(array), array, np.float32(np.nan))
