"""Errors of an upper body: seven joints, in millimetres and in pixels of a 640x480 image (Lopez-Mendez 2011, 4)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.sensing.camera import Camera
from toolkit.tracks import TRACKED

JOINTS = ("head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_hand", "right_hand")
ROWS: np.ndarray = np.array([skeleton.REPORTED.index(name) for name in JOINTS])
"""Rows of the reported joints."""
HANDS = slice(5, 7)
"""Indices of the hands among the seven joints."""
COLUMNS = 640
"""Width of the image in which pixels are counted."""
THRESHOLDS = tuple(range(0, 61, 10))
"""Thresholds of the success rate in pixels (Fig. 10)."""
BAD = 60.0
"""Mean error of a wrong frame, pixels."""
FAR = 100.0
"""Error of a lost hand, and of each joint of an undetected person, pixels."""


@dataclass(frozen=True, eq=False)
class UpperScore:
    """One recording: errors float64 (T, 7), NaN where the truth is unknown.

    Attributes
    ----------
    name : of the recording
    pixels : in a 640x480 image
    mm : millimetres, NaN where the truth is in the image only
    tracked : bool (T,)
    """

    name: str
    pixels: np.ndarray
    mm: np.ndarray
    tracked: np.ndarray


def pixel_errors(found: np.ndarray, truth_pixels: np.ndarray, camera: Camera) -> np.ndarray:
    """Return distances (T, 7) of joints (T, 7, 3), camera frame, from image points (T, 7, 2), in pixels of 640x480."""
    pixels = camera.project(found.reshape(-1, 3)).reshape(truth_pixels.shape)
    return np.linalg.norm(np.nan_to_num(pixels, nan=1e4) - truth_pixels, axis=-1) * COLUMNS / camera.width


def score_upper(name: str, joints: np.ndarray, states: np.ndarray, truth: np.ndarray, camera: Camera) -> UpperScore:
    """Compare a track with the true joints, both (T, 20, 3), camera frame, metres; all seven joints count.

    A joint is off by `BAD` pixels at most twice over, so that a person not yet found does not decide alone.
    """
    found, known = joints[:, ROWS].astype(np.float64), truth[:, ROWS].astype(np.float64)
    pixels = camera.project(known.reshape(-1, 3)).reshape(*known.shape[:2], 2)
    mm = 1000.0 * np.linalg.norm(found - known, axis=-1)
    capped = np.minimum(pixel_errors(found, pixels, camera), 2 * BAD)
    return UpperScore(name, capped, np.minimum(mm, 1000.0), states == TRACKED)


def upper_figures(scores: Sequence[UpperScore]) -> dict[str, Any]:
    """Return figures over recordings, by name: means over the recordings, `first_px` of their first tracked frames."""
    if not scores:
        return {}
    pixels = np.concatenate([score.pixels for score in scores])
    first = [score.pixels[int(np.argmax(score.tracked))] for score in scores if score.tracked.any()]
    wrong = np.concatenate([np.nanmean(score.pixels, axis=1) > BAD for score in scores])
    tracked = np.concatenate([score.tracked for score in scores])
    return {
        "recordings": len(scores),
        "frames": len(pixels),
        "upper_px": float(np.mean([np.nanmean(score.pixels) for score in scores])),
        "median_px": float(np.nanmedian(pixels)),
        "hands_px": float(np.mean([np.nanmean(score.pixels[:, HANDS]) for score in scores])),
        "upper_mm": float(np.mean([score.mm.mean() for score in scores])),
        "first_px": float(np.nanmean(first)) if first else None,
        "hands_near": float(np.mean(pixels[:, HANDS] <= FAR)),
        "tracked": float(tracked.mean()),
        "wrong_tracked": float(tracked[wrong].mean()) if wrong.any() else 0.0,
        "curve": {str(limit): float(np.mean(pixels <= limit)) for limit in THRESHOLDS},
    }
