"""What a camera saw: the `Recording` protocol, the one class behind it, and opening and saving.

A recording is never mirrored: a person who faces the camera has the left hand at positive x. Frames are handed out
one at a time; a long recording is never read whole.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from toolkit.errors import RecordingError, UsageError
from toolkit.files import is_file, is_folder
from toolkit.sensing.camera import Camera, rotated_points
from toolkit.sensing.checks import check_joints, check_timestamps
from toolkit.sensing.conversion import DepthConverter, unit_in_metres
from toolkit.sensing.joints2d import Joints2D, check_rows, mirrored_rows, rotated_rows
from toolkit.sensing.stream import Frame
from toolkit.sensing.vertical import Vertical
from toolkit.sensing.writer import RecordingWriter, save_recording

__all__ = [
    "FrameSource",
    "ReaderOptions",
    "Recording",
    "RecordingWriter",
    "StoredRecording",
    "open_recording",
    "save_recording",
]


LENGTHS = {"intrinsics": 4, "size": 2, "up_camera": 3}
LARGEST_RATE = 1000.0  # frames a second: faster than any depth camera
LARGEST_SIDE = 20_000  # pixels: larger than any image


class Recording(Protocol):
    """A depth recording. Depth is uint16 (H, W), millimetres along z, 0 = no measurement.

    Attributes
    ----------
    name : stem of the file or name of the folder
    path : where it was read from
    camera : intrinsics of every frame, lens distortion included
    raw_camera : the same of the images as they lie in the file, before they are flipped or turned
    up_camera : float64 (3,), the vertical in the camera frame
    timestamps : float64 (T,), seconds
    background : uint16 (H, W), depth of the empty scene, or None
    joints : float32 (T, 20, 3), true joints, metres, camera frame, NaN = unknown, or None; of several people (or of
        nobody) (N, T, 20, 3), NaN while absent
    reference_joints : the same, another system's estimate, or None
    image_joints : float32 (N, T, 20, 3), joints that a detector found in the images of up to N people in no order: u, v
        in pixels of the depth image and confidence, NaN = unknown; or None
    options : the reader options it was opened with, fit for JSON
    """

    name: str
    path: Path
    camera: Camera
    raw_camera: Camera
    timestamps: np.ndarray
    background: np.ndarray | None
    joints: np.ndarray | None
    reference_joints: np.ndarray | None
    image_joints: np.ndarray | None
    options: dict[str, Any]

    @property
    def up_camera(self) -> np.ndarray:
        """The vertical in the camera frame, float64 (3,), of length 1."""
        ...

    @property
    def vertical(self) -> Vertical:
        """The same with how it is known."""
        ...

    def __len__(self) -> int: ...

    def depth(self, i: int) -> np.ndarray:
        """Frame `i`: uint16 (H, W), millimetres."""
        ...

    def color(self, i: int) -> np.ndarray | None:
        """Colour of frame `i`, uint8 (H, W, 3), RGB registered to depth, or None."""
        ...

    def joints_2d(self, i: int) -> tuple[Joints2D, ...]:
        """Joints of everybody whom a detector found in the image of frame `i`."""
        ...

    def give_joints_2d(self, rows: np.ndarray) -> None:
        """Take joints (T, 20, 3) or (N, T, 20, 3) found in the images as they were before they were flipped or turned.

        They replace `image_joints`. A detector that saw mirrored images called the sides by each other's names.
        """
        ...

    def frames(self) -> Iterator[np.ndarray]:
        """All depth frames in order, one at a time."""
        ...

    def stream(self, start: int = 0, *, color: bool = False) -> Iterator[Frame]:
        """See `Stream.stream`."""
        ...


class FrameSource(Protocol):
    """Raw frames as they lie in a file, before units, mirroring and projection are put right."""

    def __len__(self) -> int: ...

    def depth(self, i: int) -> np.ndarray:
        """Raw frame `i`: numbers (H, W)."""
        ...

    def frames(self) -> Iterator[np.ndarray]:
        """Raw frames in order."""
        ...

    def color(self, i: int) -> np.ndarray | None:
        """Colour of frame `i`, uint8 (H, W, 3), RGB, or None."""
        ...


@dataclass(frozen=True)
class ReaderOptions:
    """How to read a recording, where its files do not say so themselves.

    Attributes
    ----------
    format : a name of `readers.READERS`, such as "npz", "ros", "mkv" or "png"; guessed from the path if None
    mirrored : the source shows the scene as a mirror does; its images are flipped. None leaves it to the reader
    radial : pixels hold the distance to the camera's centre instead of the depth along z
    depth_unit : "mm", "m" or the metres of one unit, such as 0.0002; None is "mm", for clouds "m"
    intrinsics : fx, fy, cx, cy in pixels, or the path of a JSON file that holds them
    size : width and height in pixels, for raw files and for clouds without a pixel grid
    frame_rate : frames per second of a source without timestamps; None is the format's own, or 30
    up_camera : the vertical in the camera frame
    background : path of a 16-bit PNG with the depth of the empty scene
    skeleton : a reference skeleton's file, or the folder that holds it
    axes : "camera" (x right, y down, z forward) or "graphics" (x right, y up, z backward), for clouds
    rotate : degrees by which the images are turned clockwise, 0, 90, 180 or 270, for a camera that stands on its side
    track : name of the depth topic of a file that holds several
    """

    format: str | None = None
    mirrored: bool | None = None
    radial: bool = False
    depth_unit: str | float | None = None
    intrinsics: str | tuple[float, ...] | None = None
    size: tuple[int, int] | None = None
    frame_rate: float | None = None
    up_camera: tuple[float, float, float] | None = None
    background: str | None = None
    skeleton: str | None = None
    axes: str = "camera"
    rotate: int = 0
    track: str | None = None

    @classmethod
    def from_mapping(cls, options: dict[str, Any]) -> ReaderOptions:
        """Options by name; paths become text and lists tuples, so that they can be written as JSON and read back.

        Raises
        ------
        UsageError
            A name or a value is not one of those above.
        """
        names = [f.name for f in fields(cls)]
        unknown = sorted(set(options) - set(names))
        if unknown:
            raise UsageError(f"unknown reader option {unknown[0]!r}; there are: {', '.join(names)}")
        plain = {
            k: _numbers(k, v) if k in ("intrinsics", "size", "up_camera") else _plain(v) for k, v in options.items()
        }
        made = cls(**plain)
        rate = made.frame_rate
        if rate is not None and not (isinstance(rate, (int, float)) and 0 < rate <= LARGEST_RATE):
            raise UsageError(
                f"frame_rate {made.frame_rate} is not positive or above {LARGEST_RATE:g}; give frames a second"
            )
        if made.depth_unit is not None:
            unit_in_metres(made.depth_unit)
        if made.axes not in ("camera", "graphics"):
            raise UsageError(f"axes {made.axes!r} is neither 'camera' nor 'graphics'")
        if made.rotate not in (0, 90, 180, 270):
            raise UsageError(f"rotate {made.rotate!r} is none of: 0, 90, 180, 270")
        return made

    def unit(self, default: str | float) -> str | float:
        """The chosen depth unit, or the `default` of a format."""
        return default if self.depth_unit is None else self.depth_unit

    def given(self) -> dict[str, Any]:
        """The options that differ from their defaults."""
        default = asdict(ReaderOptions())
        return {k: v for k, v in asdict(self).items() if v != default[k]}


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    return value


def _numbers(name: str, value: Any) -> Any:
    """Numbers given as a list, an array or a text such as `320,240`; another text is a path."""
    if value is None:
        return None
    parts = value.split(",") if isinstance(value, str) else value
    try:
        numbers = tuple(float(part) for part in parts)
    except (TypeError, ValueError):
        if name == "intrinsics" and isinstance(value, (str, Path)):
            return str(value)
        raise UsageError(f"{name} {value!r} is not {LENGTHS[name]} numbers") from None
    if len(numbers) != LENGTHS[name] or not np.isfinite(numbers).all():
        raise UsageError(f"{name} {value!r} is not {LENGTHS[name]} numbers")
    if name == "size" and not all(0 < n <= LARGEST_SIDE and n == int(n) for n in numbers):
        raise UsageError(f"size {value!r} is no width and height in pixels")
    return tuple(int(n) for n in numbers) if name == "size" else numbers


@dataclass(eq=False)
class StoredRecording:
    """The one implementation of `Recording`: raw frames from a `FrameSource`, converted on the way out.

    Metadata are given in the frame of the raw images; a mirrored source has them flipped here, and a camera that stands
    on its side turned, together with its images.
    """

    name: str
    path: Path
    camera: Camera
    timestamps: np.ndarray
    source: FrameSource
    converter: DepthConverter
    background: np.ndarray | None = None
    joints: np.ndarray | None = None
    reference_joints: np.ndarray | None = None
    image_joints: np.ndarray | None = None
    stored_up: np.ndarray | None = None
    options: dict[str, Any] = field(default_factory=dict)
    raw_camera: Camera = field(init=False)

    def __post_init__(self) -> None:
        count, shape = len(self.source), self.camera.shape
        if count == 0:
            raise RecordingError(f"{self.path} holds no frame; check that it was written to its end")
        self.timestamps = check_timestamps(self.timestamps, count, self.path)
        self.joints = check_joints(self.joints, count, "joints", self.path)
        self.reference_joints = check_joints(self.reference_joints, count, "reference_joints", self.path)
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
        return self._convert(self.source.depth(self._checked(i)), i)

    def frames(self) -> Iterator[np.ndarray]:
        """All frames in order; only one is held at a time."""
        for i, raw in enumerate(self.source.frames()):
            yield self._convert(raw, i)

    def stream(self, start: int = 0, *, color: bool = False) -> Iterator[Frame]:
        """See `Stream.stream`."""
        for i, depth in islice(enumerate(self.frames()), start, None):
            yield Frame(depth, float(self.timestamps[i]), self.joints_2d(i), self.color(i) if color else None)

    def joints_2d(self, i: int) -> tuple[Joints2D, ...]:
        """Joints of everybody whom a detector found in the image of frame `i`."""
        if self.image_joints is None:
            return ()
        people = (Joints2D.of_rows(rows) for rows in self.image_joints[:, self._checked(i)])
        return tuple(person for person in people if person.confidence.any())

    def give_joints_2d(self, rows: np.ndarray) -> None:
        """See `Recording.give_joints_2d`."""
        joints = check_rows(rows, len(self), self.path)
        assert joints is not None
        if self.converter.mirrored:
            joints = mirrored_rows(joints, self.raw_camera.width)
        self.image_joints = rotated_rows(joints, self.raw_camera, self._turns)

    def color(self, i: int) -> np.ndarray | None:
        """Colour of frame `i`, uint8 (H, W, 3), RGB registered to depth, or None."""
        image = self.source.color(self._checked(i))
        if image is None:
            return None
        return self._upright(np.ascontiguousarray(image[:, ::-1]) if self.converter.mirrored else image)

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
        from toolkit.sensing.people.up import find_vertical

        return find_vertical(self)

    def _checked(self, i: int) -> int:
        if not 0 <= i < len(self):
            raise RecordingError(f"{self.path} has no frame {i}; it has frames 0 to {len(self) - 1}")
        return i

    def _convert(self, raw: np.ndarray, i: int) -> np.ndarray:
        return self._upright(self.converter.convert(raw, self.raw_camera, f"frame {i} of {self.path}"))


def open_recording(path: str | Path, **options: Any) -> Recording:
    """Open a depth recording of any known format; options are those of `ReaderOptions`.

    Raises
    ------
    RecordingError
        The path is missing, of no known format, or its contents cannot be used.
    UsageError
        An option is unknown.
    """
    from toolkit.sensing.readers import reader_for

    target = Path(path)
    if not (is_file(target) or is_folder(target)):
        raise RecordingError(f"there is no recording at {target}, a file or a folder; check the path")
    chosen = ReaderOptions.from_mapping(options)
    return reader_for(target, chosen.format)(target, chosen)
