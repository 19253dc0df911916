"""The project's own recording format: one NPZ file, read frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from toolkit.archives import Column, archive_names, check_columns, load_archive
from toolkit.errors import RecordingError
from toolkit.recordings.npz_stream import RECORD_AGAIN, MemberReader
from toolkit.recordings.readers.common import LARGEST_PICTURE, chosen_background, chosen_camera, chosen_up, frame_times
from toolkit.recordings.stored import StoredRecording
from toolkit.sensing.conversion import DepthConverter
from toolkit.sensing.recording import ReaderOptions, Recording

METADATA = {
    "intrinsics": Column("iuf"),
    "timestamps": Column("iuf"),
    "distortion": Column("iuf"),
    "background": Column("iuf", gaps=True),
    "up_camera": Column("iuf"),
    "joints": Column("iuf", gaps=True),
    "reference_joints": Column("iuf", gaps=True),
    "joints_2d": Column("iuf", gaps=True),
}
"""What is read at once; the rest of the file is read frame by frame, or is none of ours."""
NUMBER, SMALL, MOST_NUMBERS = 16, 1 << 16, 64 * 20 * 10
"""Bytes of a number at most, numbers beside frames and background, and numbers of a frame: of 64 people's joints."""
MOST_FRAMES = 50_000_000
"""Two weeks and more at 30 frames a second."""


def matches(path: Path) -> bool:
    """Whether `path` is an NPZ file by its name."""
    return path.suffix == ".npz"


class NpzFrames:
    """Frames of the members `depth` and `color` of an NPZ file."""

    def __init__(self, path: Path, names: list[str]) -> None:
        self._depth = MemberReader(path, "depth")
        self._color = MemberReader(path, "color") if "color" in names else None
        if len(self._depth.shape) != 3:
            raise RecordingError(f"depth in {path} has shape {self._depth.shape}; expected (frames, height, width)")
        count, height, width = self._depth.shape
        if count > MOST_FRAMES or height * width > LARGEST_PICTURE:
            raise RecordingError(f"{path} states {count} frames of {width}x{height} pixels; {RECORD_AGAIN}")
        expected = (*self._depth.shape, 3)
        if self._color is not None and (self._color.shape != expected or self._color.dtype != np.uint8):
            raise RecordingError(
                f"color in {path} is {self._color.dtype} {self._color.shape}; expected uint8 {expected}"
            )
        self.shape = self._depth.shape[1:]

    def __len__(self) -> int:
        return self._depth.shape[0]

    def depth(self, i: int) -> np.ndarray:
        """Raw frame `i`; reading in order is fast, going back in a compressed file starts over."""
        return self._depth.row(i)

    def frames(self) -> Iterator[np.ndarray]:
        """Raw frames in order."""
        return self._depth.rows()

    def color(self, i: int) -> np.ndarray | None:
        """Colour of frame `i`, or None."""
        return None if self._color is None else self._color.row(i)


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open an NPZ recording (keys: see ARCHITECTURE in the documentation); nothing but metadata is read yet."""
    names = archive_names(path, RecordingError, RECORD_AGAIN)
    if "depth" not in names:
        raise RecordingError(f"{path} has no 'depth'; it has: {', '.join(names) or 'nothing'}")
    source = NpzFrames(path, names)
    count, (height, width) = len(source), source.shape
    most = NUMBER * (2 * height * width + count * MOST_NUMBERS + SMALL)
    small = load_archive(path, RecordingError, RECORD_AGAIN, only=METADATA, most=most)
    check_columns(small, METADATA, RecordingError, str(path), "write it as the documentation says")
    camera = chosen_camera(options, source.shape, path, small.get("intrinsics"), small.get("distortion"))
    return StoredRecording(
        name=path.stem,
        path=path,
        camera=camera,
        timestamps=small.get("timestamps", frame_times(count, options)),
        source=source,
        converter=DepthConverter(options.unit("mm"), options.radial, bool(options.mirrored)),
        background=chosen_background(options, small.get("background")),
        joints=small.get("joints"),
        reference_joints=small.get("reference_joints"),
        image_joints=small.get("joints_2d"),
        stored_up=chosen_up(options, small.get("up_camera")),
        options=options.given(),
    )
