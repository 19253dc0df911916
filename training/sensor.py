"""Losses and noise of a depth sensor in the training images."""

from __future__ import annotations

import cv2
import numpy as np

PROJECTOR = 0.075
"""Metres from the camera to the projector at its right."""


def sensed(inverse_depth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return uint16 millimetres (H, W) with noise that grows with depth, gaps, coarse steps and worn contours."""
    if rng.random() < 0.35:
        inverse_depth = _stereo(inverse_depth, rng)
    seen = inverse_depth > 0.0
    z = np.where(seen, 1.0 / np.where(seen, inverse_depth, 1.0), 0.0)
    z += rng.normal(0.0, 0.003 * rng.random(), z.shape) * z
    if rng.random() < 0.5:
        step = 0.0028 * z * z
        z = np.where(seen, np.rint(z / np.maximum(step, 1e-6)) * step, 0.0)
    if rng.random() < 0.5:
        worn = cv2.erode(seen.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
        seen = np.where(rng.random(seen.shape) < rng.random(), worn, seen)
    seen = seen & (rng.random(seen.shape) > 0.02)
    return np.where(seen, np.rint(z * 1000.0), 0.0).astype(np.uint16)


def lossy(
    inverse: np.ndarray, cosine: np.ndarray, reflectance: np.ndarray, focal: float, rng: np.random.Generator
) -> np.ndarray:
    """Return uint16 millimetres (H, W) of `sensed`, without surfaces that reflect too little light or lie in shadow.

    Parameters
    ----------
    inverse : inverse depth, 1/m, 0 = nothing
    cosine : between ray and surface
    reflectance : reflected fraction of infrared light
    focal : focal length, pixels
    """
    z = 1.0 / np.maximum(inverse, 1e-6)
    amplitude = reflectance * cosine / z**2
    dimmest = np.exp(rng.uniform(np.log(5e-4), np.log(0.012))) * rng.lognormal(0.0, 0.3, z.shape)
    lost = (amplitude < dimmest) | (cosine < rng.uniform(0.0, 0.2)) | (z > rng.uniform(3.5, 10.0))
    lost |= z < rng.choice([0.3, 0.5, 0.8])
    if rng.random() < 0.5:
        lost |= _in_shadow(inverse, focal) if rng.random() < 0.5 else _in_shadow(inverse[:, ::-1], focal)[:, ::-1]
    return sensed(np.where(lost, 0.0, inverse), rng)


def _stereo(inverse_depth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the inverse depth that a stereo camera measures: smooth over its window, with wider contours and waves."""
    seen = (inverse_depth > 0.0).astype(np.float64)
    window = rng.uniform(0.4, 1.8)  # standard deviation, pixels
    weight = cv2.GaussianBlur(seen, (0, 0), window)
    smooth = cv2.GaussianBlur(inverse_depth, (0, 0), window) / np.maximum(weight, 1e-9)
    size = max(2, round(len(seen) / rng.uniform(2.0, 8.0)))
    waves = cv2.resize(rng.normal(0.0, 1.0, (size, size)), seen.shape[::-1], interpolation=cv2.INTER_CUBIC)
    error = rng.uniform(0.0, 0.004)  # 1/m: 36 mm at 3 m, a disparity of a fifth of a pixel of a RealSense D435
    return np.where(weight > rng.uniform(0.25, 0.6), np.maximum(smooth + error * waves, 1e-3), 0.0)


def _in_shadow(inverse: np.ndarray, focal: float) -> np.ndarray:
    """Return bool (H, W): surfaces that a projector to the right of the camera does not light."""
    column = np.arange(inverse.shape[1]) - PROJECTOR * focal * inverse
    blocking = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(column > blocking + 0.5)
