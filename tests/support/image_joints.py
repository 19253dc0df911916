"""Image joints of a simulated detector, from the truth of a simulated recording."""

from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.sensing.camera import Camera

DERIVED = [skeleton.REPORTED.index(name) for name in ("pelvis", "spine", "neck")]
"""Joints that no detector reports."""
PERSISTENCE = 0.8
"""Fraction of a frame's error that persists in the next frame."""
FAR = 0.12
"""Metres of the error of a joint that the detector misses."""


@dataclass(frozen=True)
class DetectorErrors:
    """Errors of a detector; the defaults are those of the pose model on colour images of simulated people.

    Attributes
    ----------
    sigma : metres at the joint, standard deviation along each axis of the image
    missed : share of the joints that are `FAR` off, in a random direction
    swapped : share of the frames in which left and right are exchanged
    """

    sigma: float = 0.02
    missed: float = 0.04
    swapped: float = 0.017


def detected(
    truth: np.ndarray, camera: Camera, rng: np.random.Generator, errors: DetectorErrors | None = None
) -> np.ndarray:
    """Return the detector's estimates of true joints, (T, 20, 3) metres in the frame of an ideal `camera`.

    Returns float32 (T, 20, 3): u, v, confidence, as a recording holds them; NaN for joints that no detector tells.
    """
    errors = errors or DetectorErrors()
    wrong = np.empty((*truth.shape[:2], 2))
    wrong[0] = rng.normal(0.0, errors.sigma, wrong.shape[1:])
    fresh = np.sqrt(1.0 - PERSISTENCE**2) * errors.sigma
    for i in range(1, len(wrong)):
        wrong[i] = PERSISTENCE * wrong[i - 1] + rng.normal(0.0, fresh, wrong.shape[1:])
    missed = rng.random(truth.shape[:2]) < errors.missed
    angle = rng.uniform(-np.pi, np.pi, truth.shape[:2])
    wrong += FAR * np.where(missed[..., None], np.stack([np.cos(angle), np.sin(angle)], axis=-1), 0.0)
    z = truth[..., 2:]
    pixels = truth[..., :2] / z * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    rows = np.concatenate([pixels + wrong / z * [camera.fx, camera.fy], np.full_like(z, 0.9)], axis=-1)
    exchanged = rng.random(len(truth)) < errors.swapped
    rows[exchanged] = rows[exchanged][:, skeleton.OTHER_SIDE]
    rows[:, DERIVED] = np.nan
    return rows.astype(np.float32)
