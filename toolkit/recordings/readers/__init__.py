"""Readers of recordings, one per format, selected by the path."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from toolkit.io.errors import RecordingError, UsageError
from toolkit.io.files import is_file
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers import cloud, mkv, npy, npz, png, raw, record3d, ros, stray, tum, utd_mhad
from toolkit.sensing.recording import Recording

Reader = Callable[[Path, ReaderOptions], Recording]


def _ends_in(suffix: str) -> Callable[[Path], bool]:
    return lambda path: path.suffix.lower() == suffix and is_file(path)


READERS: dict[str, tuple[Callable[[Path], bool], Reader]] = {
    "npz": (_ends_in(".npz"), npz.read),
    "npy": (_ends_in(".npy"), npy.read),
    "utd_mhad": (_ends_in(".mat"), utd_mhad.read),
    "ros": (ros.matches, ros.read),
    "mkv": (_ends_in(".mkv"), mkv.read),
    "record3d": (_ends_in(".r3d"), record3d.read),
    "tum": (tum.matches, tum.read),
    "stray": (stray.matches, stray.read),
    "png": (png.matches, png.read),
    "cloud": (cloud.matches, cloud.read),
    "raw": (raw.matches, raw.read),
}
"""Format -> (test of a path, reader), tested in this order."""


def reader_for(path: Path, name: str | None) -> Reader:
    """Return the reader called `name`, or the first one whose test accepts `path`.

    Raises
    ------
    UsageError
        No reader has this name.
    RecordingError
        No reader accepts the path.
    """
    if name is not None:
        if name not in READERS:
            raise UsageError(f"unknown recording format {name!r}; there are: {', '.join(READERS)}")
        return READERS[name][1]
    if path.suffix == ".oni":
        raise RecordingError(
            f"{path} is a recording of OpenNI, which is not read; save its frames as 16-bit PNG with OpenNI's tools, "
            "and give the folder with --intrinsics"
        )
    for matches, read in READERS.values():
        if matches(path):
            return read
    raise RecordingError(
        f"{path} has no supported format; supported are .npz, .npy, .db3, .bag, .mcap, .mkv and .r3d files, "
        "a UTD-MHAD *_depth.mat file, a folder of 16-bit PNG, of TUM RGB-D or of a Stray Scanner, a .pcd or .ply file "
        "or a folder of them, or a folder of raw uint16 frames (--format raw); name each recording of a folder of many"
    )
