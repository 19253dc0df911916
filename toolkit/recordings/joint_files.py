"""Joint files of a 2-D detector: a folder of OpenPose JSON, one file per frame (Qammaz, 2.2)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.errors import RecordingError
from toolkit.io.files import is_folder
from toolkit.io.yaml_reader import read_json
from toolkit.people.image_joints.joint_formats import BODY_25, COCO_17, COCO_18, POSE_MODEL, reported_rows
from toolkit.recordings.readers.base import natural_key
from toolkit.sensing.camera import Camera

FORMATS = {
    75: ("BODY_25", BODY_25),
    54: ("COCO-18", COCO_18),
    51: ("COCO-17", COCO_17),
    99: ("MediaPipe's 33 points", POSE_MODEL),
}
"""Number of values of a person -> name of the format, and its points."""
KEYS = ("pose_keypoints_2d", "keypoints")
"""Key of a person's values in OpenPose and in COCO files."""
HINT = "use the format of OpenPose"


def read_joints(folder: str | Path, count: int, camera: Camera, size: tuple[int, int] | None = None) -> np.ndarray:
    """Read the joints of a recording from a folder of JSON files.

    The folder has one file per frame in natural order, or fewer files whose last number is their frame. A file without
    people is a frame without joints; confidences above 1 are set to 1.

    Parameters
    ----------
    folder : `*_keypoints.json`, each with `people[].pose_keypoints_2d` as x, y, c: 75 numbers BODY_25, 54 COCO-18, 51
        COCO-17, 99 MediaPipe's points (c is their visibility)
    count : frames of the recording
    camera : camera of the images as they lie in the file, neither flipped nor turned
    size : width and height of the images of the detector, if they differ from the depth's

    Returns
    -------
    float32 (N, count, 20, 3), N at least 1: u, v in pixels of the depth image, confidence; NaN = unknown

    Raises
    ------
    RecordingError
        A file is missing, damaged or of another format, or its coordinates do not fit the image.
    """
    folder = Path(folder)
    people = {frame: _people(path) for frame, path in _files(folder, count).items()}
    known = [rows[rows[:, 2] > 0] for persons in people.values() for rows in persons]
    pixels = np.concatenate(known)[:, :2] if known else np.zeros((0, 2))
    normalised = 2.0  # maximum coordinate of a folder whose coordinates are fractions of the image instead of pixels
    if len(pixels) and np.abs(pixels).max() < normalised:
        raise RecordingError(
            f"the coordinates in {folder} are all below {np.abs(pixels).max():.2g}, fractions of the image; write them "
            "in pixels (OpenPose: keypoint_scale 0)"
        )
    width, height = size or (camera.width, camera.height)
    scale = np.array([camera.width / width, camera.height / height])
    inside = ((pixels >= 0) & (pixels < (width, height))).all(axis=1)
    if len(pixels) and 2 * np.count_nonzero(inside) < len(pixels):
        raise RecordingError(
            f"most joints in {folder} lie outside an image of {width}x{height}; name the size of the images in which "
            "they were found with --joints-size W,H"
        )
    table = np.full((max(map(len, people.values()), default=0) or 1, count, 20, 3), np.nan, dtype=np.float32)
    for frame, persons in people.items():
        for k, rows in enumerate(persons):
            table[k, frame] = rows
            table[k, frame, :, :2] = (rows[:, :2] + 0.5) * scale - 0.5
    return table


def _files(folder: Path, count: int) -> dict[int, Path]:
    """Return the file of each frame with one."""
    if not is_folder(folder):
        raise RecordingError(
            f"there is no folder {folder}; --joints is a folder of OpenPose JSON, or colour, depth or none"
        )
    paths = sorted(folder.glob("*_keypoints.json"), key=natural_key) or sorted(folder.glob("*.json"), key=natural_key)
    if not paths:
        raise RecordingError(f"{folder} holds no *_keypoints.json; let OpenPose write one for each frame")
    if len(paths) == count:
        return dict(enumerate(paths))
    numbers = [re.findall(r"\d+", path.stem.removesuffix("_keypoints")) for path in paths]
    by_number = {int(found[-1]): path for found, path in zip(numbers, paths, strict=True) if found}
    if len(by_number) < len(paths) or max(by_number) >= count:
        raise RecordingError(
            f"{folder} holds {len(paths)} files for {count} frames, and not all names contain a frame number; "
            "write one file for each frame"
        )
    return by_number


def _people(path: Path) -> list[np.ndarray]:
    """Return the people of one file with a known joint, float32 (20, 3) each."""
    value = read_json(path, RecordingError, HINT)
    people = value.get("people") if isinstance(value, dict) else None
    if not isinstance(people, list):
        raise RecordingError(f"{path} has no list 'people'; {HINT}")
    found = []
    for person in people:
        numbers = next((person[key] for key in KEYS if key in person), None) if isinstance(person, dict) else None
        rows = _rows(numbers, path)
        if np.isfinite(rows).any():
            found.append(rows)
    return found


def _rows(numbers: Any, path: Path) -> np.ndarray:
    """Return the flat list of one person as reported joints (20, 3)."""
    if not isinstance(numbers, list) or not all(isinstance(n, (int, float)) for n in numbers):
        raise RecordingError(f"a person in {path} has no list of numbers {KEYS[0]!r}; {HINT}")
    if len(numbers) not in FORMATS:
        formats = ", ".join(f"{n} ({name})" for n, (name, _) in FORMATS.items())
        raise RecordingError(f"a person in {path} has {len(numbers)} numbers; there are formats of {formats}")
    points = np.array(numbers, dtype=np.float64).reshape(-1, 3)
    if not np.isfinite(points).all():
        raise RecordingError(f"a person in {path} has a coordinate that is not finite; {HINT}")
    points[:, 2] = np.minimum(points[:, 2], 1.0)
    return reported_rows(points, FORMATS[len(numbers)][1])
