"""Common parts of the readers: frames in files, camera, times, vertical, background, unit."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.errors import RecordingError, UsageError
from toolkit.io.safe_open import read_file
from toolkit.io.yaml_reader import read_json
from toolkit.people.vertical import find_vertical
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.sensing.camera import Camera
from toolkit.sensing.conversion import DepthConverter
from toolkit.sensing.image_sizes import USUAL_LENSES
from toolkit.sensing.recording import FrameSource, Recording

LARGEST_PICTURE, LARGEST_FILE = 1 << 26, 1 << 28
"""Maximum number of pixels of a picture, and of bytes of its file."""


def natural_key(path: Path) -> list[tuple[int, int | str]]:
    """Return the sort key of natural order (`frame_2` before `frame_10`)."""
    return [(0, int(part)) if part.isdigit() else (1, part) for part in re.split(r"(\d+)", path.name) if part]


def frame_times(count: int, options: ReaderOptions, rate: float = 30.0) -> np.ndarray:
    """Return evenly spaced times, float64 (count,), seconds, at the chosen frame rate, else at the format's `rate`."""
    return np.arange(count, dtype=np.float64) / (options.frame_rate or rate)


def array_frames(depth: np.ndarray) -> FrameSource:
    """Return the raw frames of an array (T, H, W)."""
    return FrameSource(len(depth), lambda i: np.asarray(depth[i]))


def file_frames(
    files: Sequence[Path], read: Callable[[Path], np.ndarray], color: Sequence[Path] | None = None
) -> FrameSource:
    """Return frames with one file each.

    Parameters
    ----------
    files : depth images
    read : reads one of them
    color : images of the same view, one for each frame, or none
    """

    def color_of(i: int) -> np.ndarray | None:
        if not color:
            return None
        import cv2

        return np.ascontiguousarray(_read_image(color[i], cv2.IMREAD_COLOR)[:, :, ::-1])

    return FrameSource(len(files), lambda i: read(files[i]), color_of)


def recording_of_source(
    path: Path,
    source: FrameSource,
    camera: Camera,
    options: ReaderOptions,
    *,
    name: str | None = None,
    unit: str | float = "mm",
    mirrored: bool = False,
    timestamps: np.ndarray | None = None,
    background: np.ndarray | None = None,
    up: np.ndarray | None = None,
    **joints: np.ndarray | None,
) -> Recording:
    """Return the recording of a file with its metadata, over which `options` have precedence.

    Parameters
    ----------
    source, camera : raw frames and their camera
    name : name of the recording; None = that of the path
    unit, mirrored : those of the raw depth, as in `ReaderOptions`
    timestamps : (T,), seconds; None = evenly, at the option's rate or 30 Hz
    background : raw depth of the empty scene
    up : the vertical in the camera frame
    joints : `joints`, `reference_joints` and `image_joints`, as in `Recording`
    """
    return Recording(
        name=path.stem if name is None else name,
        path=path,
        camera=camera,
        timestamps=frame_times(source.count, options) if timestamps is None else timestamps,
        source=source,
        converter=DepthConverter(
            unit if options.depth_unit is None else options.depth_unit,
            options.radial,
            mirrored if options.mirrored is None else options.mirrored,
        ),
        background=background if options.background is None else read_depth_png(Path(options.background)),
        stored_up=up if options.up_camera is None else np.asarray(options.up_camera, dtype=np.float64),
        find_vertical=find_vertical,
        options=options.given(),
        times_assumed=timestamps is None and options.frame_rate is None,
        **joints,
    )


def chosen_camera(
    options: ReaderOptions,
    shape: tuple[int, ...],
    path: Path,
    stored: np.ndarray | tuple[float, ...] | None = None,
    distortion: np.ndarray | None = None,
) -> Camera:
    """Return the camera of the option `intrinsics`, else of the stored values.

    Raises
    ------
    RecordingError
        Neither exists, or they are invalid.
    """
    size = (int(shape[0]), int(shape[1]))
    if isinstance(options.intrinsics, str):
        return _camera_from_json(Path(options.intrinsics), size)
    intrinsics = options.intrinsics if options.intrinsics is not None else stored
    if intrinsics is None:
        raise RecordingError(f"{path} has no intrinsics; {_usual_intrinsics(size)}")
    return Camera.from_intrinsics(np.asarray(intrinsics), size, distortion)


def _usual_intrinsics(shape: tuple[int, int]) -> str:
    """Return the advice for a recording without intrinsics: the usual ones of its (height, width), else their form."""
    lenses = USUAL_LENSES.get((shape[1], shape[0]), ())
    if not lenses:
        return "give --intrinsics fx,fy,cx,cy in pixels or a JSON file"
    usual = " or ".join(f"--intrinsics {','.join(f'{n:g}' for n in values)} ({name})" for name, values in lenses)
    return f"give {usual}, usual for {shape[1]}x{shape[0]} pixels, or a JSON file with those of your camera"


@contextmanager
def damaged(path: Path) -> Iterator[None]:
    """Turn all exceptions of a container library into one sentence."""
    try:
        yield
    except (RecordingError, UsageError):
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RecordingError(f"{path} is truncated or damaged ({reason}); copy or record it again") from error


def upright(accelerations: np.ndarray) -> np.ndarray | None:
    """Return the vertical in the camera frame from accelerations (N, 3), m/s^2, which point upwards at rest.

    None if their median differs from gravity, because the camera moved or the unit is another.
    """
    median = np.median(accelerations, axis=0)
    length = math.hypot(*median)
    gravity, gravity_tolerance = 9.81, 1.0  # gravity, and tolerance for a cheap accelerometer, m/s^2
    return median / length if abs(length - gravity) < gravity_tolerance else None


def decoded(content: bytes | memoryview, flag: int) -> np.ndarray | None:
    """Decode a picture by OpenCV with `flag`; None for invalid data or more than `LARGEST_PICTURE` pixels."""
    import cv2
    from PIL import Image

    try:
        width, height = Image.open(io.BytesIO(content)).size  # reads only the header
        return cv2.imdecode(np.frombuffer(content, np.uint8), flag) if width * height <= LARGEST_PICTURE else None
    except Exception:  # damaged pictures raise a dozen exception types in either library
        return None


def _camera_from_json(path: Path, shape: tuple[int, int]) -> Camera:
    """Read a camera from a JSON file: `intrinsic_matrix` (column-major, as in Open3D), `K` or `camera_matrix`
    (row-major), or `fx, fy` with `cx, cy` or `ppx, ppy`, at the top or one level below; optionally `distortion`,
    `coeffs` or `dist`.

    `shape` is the (height, width) of the images; a size in the file that differs is an error.
    """
    top = read_json(path, RecordingError, "give a JSON file with fx, fy, cx, cy")
    tables = [t for t in (top, *(top.values() if isinstance(top, dict) else ())) if isinstance(t, dict)]
    for table in tables:
        bent = next((table[k] for k in ("distortion", "coeffs", "dist") if table.get(k)), None)
        try:
            values = _intrinsics_of(table)
            distortion = None if bent is None else np.asarray(bent, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise RecordingError(f"the intrinsics in {path} are no numbers ({error}); give fx, fy, cx, cy") from error
        if values is None:
            continue
        size = (table.get("height", shape[0]), table.get("width", shape[1]))
        if size != shape:
            raise RecordingError(
                f"{path} describes images of {size[1]}x{size[0]} pixels, these have {shape[1]}x{shape[0]}; "
                "give the intrinsics of this size"
            )
        return Camera.from_intrinsics(np.asarray(values), shape, distortion)
    raise RecordingError(f"{path} holds no intrinsics; expected fx, fy, cx, cy, K or intrinsic_matrix")


def camera_beside(own: list[Path], around: Path, shape: tuple[int, int]) -> Camera | None:
    """Return the camera of the JSON files in the first folder with one: that of the recording, then its parent.

    None without such a file. Other JSON files beside a recording are ignored.

    Raises
    ------
    RecordingError
        Two files of one folder contain different cameras, or no file of the recording contains one.
    """
    problems: list[RecordingError] = []
    for folder in [*own, around]:
        found: dict[Path, Camera] = {}
        for table in sorted(folder.glob("*.json")):
            try:
                found[table] = _camera_from_json(table, shape)
            except RecordingError as error:
                problems += [error] if folder in own else []
        if len(set(found.values())) > 1:
            named = " and ".join(str(table) for table in found)
            raise RecordingError(f"{named} contain different cameras; give --intrinsics FILE for the right one")
        if found:
            return next(iter(found.values()))
    if problems:
        raise problems[0]
    return None


def _intrinsics_of(table: dict[str, Any]) -> list[float] | None:
    for key, order in (("intrinsic_matrix", "F"), ("K", "C"), ("camera_matrix", "C")):
        if key in table:
            matrix = np.asarray(table[key], dtype=np.float64).ravel()
            if matrix.size != 9:
                return None
            k = matrix.reshape(3, 3, order="F" if order == "F" and np.ndim(table[key]) == 1 else "C")
            return [k[0, 0], k[1, 1], k[0, 2], k[1, 2]]
    for names in (("fx", "fy", "cx", "cy"), ("fx", "fy", "ppx", "ppy")):
        if all(n in table for n in names):
            return [float(table[n]) for n in names]
    return None


def read_depth_png(path: Path) -> np.ndarray:
    """Read a 16-bit PNG as uint16 (H, W); too large images are refused by their header.

    Raises
    ------
    RecordingError
        The file cannot be read, or has not a single channel of 16 bits.
    """
    import cv2

    image = _read_image(path, cv2.IMREAD_UNCHANGED)
    if image.dtype != np.uint16 or image.ndim != 2:
        what = f"{image.dtype} of shape {image.shape}"
        raise RecordingError(
            f"{path} is {what}, a picture and no depth; depth is one channel of 16 bits: name the folder of the depth "
            "images"
        )
    return image


def _read_image(path: Path, flags: int) -> np.ndarray:
    """Read an image file by OpenCV; raises RecordingError."""
    try:
        image = decoded(read_file(path, LARGEST_FILE), flags)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read as an image: {error.strerror or error}") from error
    if image is None:
        raise RecordingError(
            f"{path} cannot be read as an image; it is truncated, of another format or larger than any camera's"
        )
    return image
