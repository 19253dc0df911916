"""Person network: log-odds of a person and of a head in each pixel of a coarse depth image, by a small network.

A U-Net of depthwise separable convolutions; `docs/models.md` describes its training and its errors, `training/` holds
the scripts. Its sums are exact (`toolkit.sensing.exact_network`), so that the log-odds are the same to the bit
everywhere.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np

from toolkit.sensing.camera import Camera
from toolkit.sensing.exact_network import ExactNetwork

ASSET = Path(__file__).parent / "assets" / "people.onnx"
SHAPE = (1, 4, 128, 160)
"""Shape of the input of a Kinect; height and width are multiples of 16."""
NEAREST, FARTHEST = 300, 20_000
"""Millimetres: nearer and farther depths count as these."""
INPUT_EXPONENT, INPUT_RANGE = -6, 256
"""The input is in steps of 1/64; its largest whole number."""
STEP = 1 / 64
"""Resolution of the log-odds."""

_UNIT = 2.0**-INPUT_EXPONENT
_DEPTHS = [max(millimetres, NEAREST) / 1000.0 for millimetres in range(FARTHEST + 1)]
_INVERSES = np.array([0.0, *(round(_UNIT / z) for z in _DEPTHS[1:])], dtype=np.float32)
_LOGARITHMS = np.array([0.0, *(round(_UNIT * math.log(z)) for z in _DEPTHS[1:])], dtype=np.float32)


class PersonNetwork:
    """A person network, that of the package unless another file is named.

    Raises
    ------
    ModelError
        The installed OpenCV cannot run it.
    """

    def __init__(self, path: Path = ASSET) -> None:
        self._net = ExactNetwork(path, SHAPE, ("log_odds",))

    def odds(self, depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Return the log-odds of a person and of a head's centre in the pixels of a depth image.

        Both are multiples of 1/64, so that their sums are exact in any order.

        Parameters
        ----------
        depth : float32 (h, w), a whole coarse image, metres along z, 0 = no measurement
        camera : its camera

        Returns
        -------
        Log-odds that pixels show a person and not a room, 0 without measurement, and log-odds of a head's centre, with
        a peak at each head: float32 (h, w) each.
        """
        height, width = depth.shape
        multiple = 16  # divides height and width of the input
        rows, columns = (-(-size // multiple) * multiple for size in depth.shape)
        whole = np.zeros((rows, columns), dtype=np.int64)
        top, left = (rows - height) // 2, (columns - width) // 2
        inner = np.s_[top : top + height, left : left + width]
        training_focal = 142.0  # pixels; depths of other cameras are scaled to it
        scaled = np.rint(depth * (1000.0 * training_focal / camera.fx))
        whole[inner] = np.where(depth > 0, np.clip(scaled, 1, FARTHEST), 0)
        (found,) = self._net.run(features(whole)[None])
        largest = 6.9  # log-odds: a probability of 0.999
        odds = (np.rint(np.clip(found[0], -largest, largest) / STEP) * STEP).astype(np.float32)
        people, heads = (np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)[inner] for image in odds)
        return np.where(depth > 0, people, np.float32(0.0)), heads


def features(millimetres: np.ndarray) -> np.ndarray:
    """Return the input of the network, whole numbers float32 (4, H, W), of depths int64 (H, W), 0 = no measurement.

    Measured or not, inverse depth, log of the depth, and depth against the mean of the surroundings.
    """
    import cv2

    measured = (millimetres > 0).astype(np.float64)
    side = 15  # pixels of the surroundings
    sums, counts = (
        cv2.boxFilter(image, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)
        for image in (millimetres.astype(np.float64), measured)
    )
    relief_unit = 400.0  # millimetres of depth against the mean around that count as 1
    relief = np.clip((millimetres - sums / np.maximum(counts, 1.0)) / relief_unit, -2.0, 2.0)
    parts = (measured * _UNIT, _INVERSES[millimetres], _LOGARITHMS[millimetres], np.rint(_UNIT * relief) * measured)
    return np.stack([part.astype(np.float32) for part in parts])


@cache
def person_network() -> PersonNetwork:
    """Load the network of the package once."""
    return PersonNetwork()
