"""Folders of the Stray Scanner (iPhone and iPad with LiDAR): `depth/`, `camera_matrix.csv`, `odometry.csv`.

The matrix belongs to the colour video with 1,920 columns; depth covers the same image at a lower resolution.
The odometry maps the camera frame (x right, y down, z forward) to a world with y up, which gives the vertical. The
video is not read.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.io.files import is_file, is_folder
from toolkit.io.yaml_reader import read_table, read_text
from toolkit.recordings.reader_options import ReaderOptions
from toolkit.recordings.readers.base import (
    chosen_camera,
    file_frames,
    natural_key,
    read_depth_png,
    recording_of_source,
)
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording

MATRIX, ODOMETRY = "camera_matrix.csv", "odometry.csv"


def matches(path: Path) -> bool:
    """Return whether `path` is a folder with a `camera_matrix.csv` and depth images."""
    return is_folder(path) and is_file(path / MATRIX) and is_folder(path / "depth")


def _camera_of(path: Path, shape: tuple[int, int]) -> Camera:
    """Return the camera of depth images of a shape (height, width) from the matrix of the video."""
    text = read_text(path, RecordingError, "give --intrinsics fx,fy,cx,cy")
    try:
        matrix = np.array([[float(word) for word in line.split(",")] for line in text.splitlines() if line.strip()])
        fx, fy, cx, cy = matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]
    except (ValueError, IndexError) as error:
        raise RecordingError(f"{path} is no matrix of 3x3 numbers ({error}); give --intrinsics fx,fy,cx,cy") from error
    video_width = 1920  # pixels
    scale = shape[1] / video_width
    scaled = (fx * scale, fy * scale, (cx + 0.5) * scale - 0.5, (cy + 0.5) * scale - 0.5)
    return Camera.from_intrinsics(np.array(scaled), shape)


def _odometry_of(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return times (T,), seconds, and the vertical in the camera's frame (3,), the median over all frames."""
    from scipy.spatial.transform import Rotation

    rows = read_table(path, RecordingError, "copy the recording again")
    plain = [{key.strip(): value for key, value in row.items()} for row in rows]
    try:
        times = np.array([float(row["timestamp"]) for row in plain])
        turns = Rotation.from_quat([[float(row[key]) for key in ("qx", "qy", "qz", "qw")] for row in plain])
        return times, np.median(turns.inv().apply([0.0, 1.0, 0.0]), axis=0)
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{path} has no times and orientations ({error!r}); copy the recording again") from error


def read(path: Path, options: ReaderOptions) -> Recording:
    """Open a folder of the Stray Scanner."""
    files = sorted((path / "depth").glob("*.png"), key=natural_key)
    if not files:
        raise RecordingError(f"{path / 'depth'} holds no PNG file; copy the recording again")
    source = file_frames(files, read_depth_png)
    shape: tuple[int, int] = source.depth(0).shape
    times, up = None, None
    if is_file(path / ODOMETRY):
        measured, up = _odometry_of(path / ODOMETRY)
        if len(measured) >= len(files):
            times = measured[: len(files)] - measured[0]
    given = options.intrinsics is not None
    camera = chosen_camera(options, shape, path) if given else _camera_of(path / MATRIX, shape)
    return recording_of_source(path, source, camera, options, timestamps=times, up=up)
