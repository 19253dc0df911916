"""Record3D recordings (`.r3d`, iPhone and iPad): a zip of LZFSE-compressed float32 metres, JPEG, and JSON metadata.

The metadata contain the colour camera `K` (column by column), its size `w`, `h`, the depth size `dw`, `dh`, the frame
rate and optionally times. Depth images cover the colour images at a lower resolution.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.errors import RecordingError, optional_package
from toolkit.io.yaml_reader import LARGEST_JSON, parse_json
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import (
    LARGEST_FILE,
    chosen_camera,
    damaged,
    decoded,
    recording_of_source,
)
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import FrameSource, Recording


def _frames(path: Path, shape: tuple[int, int]) -> FrameSource:
    """Return depth, float32 metres, and colour, scaled to the depth's size, of the archive."""
    lzfse = optional_package("lzfse", "record3d", f"reading {path}")
    archive = zipfile.ZipFile(path)
    names = set(archive.namelist())

    def member(name: str) -> bytes:
        if archive.getinfo(name).file_size > LARGEST_FILE:
            raise ValueError(f"{name} is too large")
        return archive.read(name)

    def depth(i: int) -> np.ndarray:
        with damaged(path):
            return np.frombuffer(lzfse.decompress(member(f"rgbd/{i}.depth")), "<f4").reshape(shape)

    def color(i: int) -> np.ndarray | None:
        import cv2

        if f"rgbd/{i}.jpg" not in names:
            return None
        with damaged(path):
            image = decoded(member(f"rgbd/{i}.jpg"), cv2.IMREAD_COLOR)
            if image is None:
                raise ValueError(f"the colour of frame {i} is no JPEG")
            small = cv2.resize(image, shape[::-1], interpolation=cv2.INTER_AREA)
        return np.ascontiguousarray(small[:, :, ::-1])

    return FrameSource(next(i for i in range(len(names) + 1) if f"rgbd/{i}.depth" not in names), depth, color)


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a Record3D file; requires the package `lzfse`."""
    with damaged(path), zipfile.ZipFile(path) as archive:
        if archive.getinfo("metadata").file_size > LARGEST_JSON:
            raise ValueError("its metadata are too large")
        text = archive.read("metadata").decode("utf-8")
    known = parse_json(text, f"the metadata of {path}", RecordingError, "export it again")
    with damaged(path):
        shape, own, times = _facts_of(known)
        source = _frames(path, shape)
    camera = own if options.intrinsics is None else chosen_camera(options, shape, path)
    stored = times if len(times) == source.count else None
    return recording_of_source(path, source, camera, options, unit="m", timestamps=stored)


def _facts_of(known: Any) -> tuple[tuple[int, int], Camera, np.ndarray]:
    """Return the shape of the depth images, their camera, and times in seconds (empty without)."""
    shape = (int(known["dh"]), int(known["dw"]))
    largest_side = 4096  # maximum number of depth pixels of a phone
    if not all(0 < side <= largest_side for side in shape):
        raise ValueError(f"depth of {shape[1]}x{shape[0]} pixels")
    k = np.array(known["K"], dtype=np.float64).reshape(3, 3, order="F")
    sx, sy = shape[1] / float(known["w"]), shape[0] / float(known["h"])
    centre = ((k[0, 2] + 0.5) * sx - 0.5, (k[1, 2] + 0.5) * sy - 0.5)
    camera = Camera.from_intrinsics(np.array([k[0, 0] * sx, k[1, 1] * sy, *centre]), shape)
    times = np.array(known.get("frameTimestamps", []), dtype=np.float64)
    return shape, camera, times - times[0] if len(times) else times
