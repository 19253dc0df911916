"""Folders of the TUM RGB-D benchmark: `depth.txt` lists time and file of each image, `rgb.txt` those of colour.

Depth has 5000 units per metre and is registered to colour. The default camera for images of 640x480 pixels is that
recommended by the benchmark (525, 525, 319.5, 239.5); a JSON file in the folder or the option `intrinsics` overrides
it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.io.files import is_file, is_folder
from toolkit.io.yaml_reader import read_text
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import (
    camera_beside,
    chosen_camera,
    file_frames,
    read_depth_png,
    recording_of_source,
)
from toolkit.sensing.recording import Recording

DEPTH_LIST, COLOR_LIST = "depth.txt", "rgb.txt"
CAMERA = {(480, 640): (525.0, 525.0, 319.5, 239.5)}
"""Image shape -> camera recommended by the benchmark."""


def matches(path: Path) -> bool:
    """Return whether `path` is a folder with a `depth.txt`."""
    return is_folder(path) and is_file(path / DEPTH_LIST)


def _listed(path: Path) -> tuple[np.ndarray, list[Path]]:
    """Return times (T,), seconds, and files of a list: a time and a relative path per line, `#` for comments."""
    hint = "write a time and a file on each line"
    times, files = [], []
    for number, line in enumerate(read_text(path, RecordingError, hint).splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            time, name = float(words[0]), words[1]
            file = path.parent / name
            inside = path.parent.resolve() in file.resolve().parents  # ValueError for invalid file names
        except (ValueError, IndexError):
            raise RecordingError(f"line {number} of {path} is {line[:80]!r}; {hint}") from None
        if not inside:
            raise RecordingError(f"line {number} of {path} leads out of the folder: {name!r}; {hint}")
        times.append(time)
        files.append(file)
    if not files:
        raise RecordingError(f"{path} lists no image; {hint}")
    return np.array(times), files


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a folder; colour is the nearest image in time."""
    times, files = _listed(path / DEPTH_LIST)
    color: list[Path] = []
    if is_file(path / COLOR_LIST):
        color_times, color_files = _listed(path / COLOR_LIST)
        color = [color_files[int(np.abs(color_times - time).argmin())] for time in times]
    source = file_frames(files, read_depth_png, color)
    shape: tuple[int, int] = source.depth(0).shape
    camera = None if options.intrinsics is not None else camera_beside([path], path / "depth", shape)
    camera = camera or chosen_camera(options, shape, path, CAMERA.get(shape))
    unit = 0.0002  # metres per unit of depth
    return recording_of_source(path, source, camera, options, unit=unit, timestamps=times - times[0])
