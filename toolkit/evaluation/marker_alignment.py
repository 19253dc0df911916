"""One clock and one frame for a track and a marker recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from toolkit.inertial.synchronise import Signal, correlations
from toolkit.io.errors import RecordingError

RATE = 100.0
"""Samples a second of the common clock, the rate of most marker systems."""
SMOOTHING = 0.05
"""Seconds, standard deviation of the Gaussian before speeds are compared."""
LEAST_OVERLAP = 1.0
"""Seconds that both recordings have to share."""


@dataclass(frozen=True, eq=False)
class RigidAlignment:
    """Rigid motion that maps marker coordinates to the level frame of the track.

    Attributes
    ----------
    rotation : float64 (3, 3)
    translation : float64 (3,), metres
    residual : metres, median distance of the aligned joints
    mirrored_residual : metres, the same if the markers' left and right are exchanged
    """

    rotation: np.ndarray
    translation: np.ndarray
    residual: float
    mirrored_residual: float

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Return points (..., 3) in the level frame."""
        return np.asarray(points @ self.rotation.T + self.translation)


def resampled(times: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Interpolate values (T, ...) linearly at other times; NaN outside and across gaps longer than 0.1 s."""
    flat = values.reshape(len(values), -1)
    out = np.full((len(at), flat.shape[1]), np.nan)
    for k in range(flat.shape[1]):
        known = np.isfinite(flat[:, k])
        if known.sum() < 2:
            continue
        own = times[known]
        out[:, k] = np.interp(at, own, flat[known, k], left=np.nan, right=np.nan)
        after = np.clip(np.searchsorted(own, at), 1, len(own) - 1)
        typical = 1.5 * float(np.median(np.diff(own)))
        out[own[after] - own[after - 1] > max(0.1, typical), k] = np.nan
    return out.reshape(len(at), *values.shape[1:])


def speeds(times: np.ndarray, points: np.ndarray) -> Signal:
    """Return the smoothed speeds (S, J), m/s, of points (T, J, D), `RATE` a second from the first time on.

    Speeds do not depend on the coordinate axes, so two recordings can be synchronised before they are aligned.
    """
    at = np.arange(times[0], times[-1], 1.0 / RATE)
    places = resampled(times, points, at)
    known = np.isfinite(places)
    filled = np.where(known, places, 0.0)
    weight = gaussian_filter1d(known.astype(float), SMOOTHING * RATE, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        smooth = gaussian_filter1d(filled, SMOOTHING * RATE, axis=0) / weight
    smooth[~known] = np.nan
    found = np.linalg.norm(np.gradient(smooth, 1.0 / RATE, axis=0), axis=2)
    return Signal(found, np.isfinite(found), float(at[0]))


def synchronise(
    times: np.ndarray, points: np.ndarray, other_times: np.ndarray, other_points: np.ndarray
) -> tuple[float, float]:
    """Return the lag, seconds, that added to the other clock gives this clock, and the correlation of the speeds there.

    Parameters
    ----------
    times, points : (T,), (T, J, D), the track
    other_times, other_points : (S,), (S, J, D), the same joints, or angles, by the other system

    Raises
    ------
    RecordingError
        No lag gives `LEAST_OVERLAP` and a sufficient correlation: no movement, another movement, or no overlap in time.
    """
    own, other = speeds(times, points), speeds(other_times, other_points)
    shortest = int(LEAST_OVERLAP * RATE)
    lags = np.arange(shortest - len(other), len(own) - shortest + 1)
    found = correlations(other, own, lags, shortest)
    overlap = np.minimum(len(own), lags + len(other)) - np.maximum(lags, 0)
    # A short overlap correlates by chance: the lower end of its confidence interval decides (Fisher).
    scores = found - 1.0 / np.sqrt(np.maximum(overlap * SMOOTHING, 2.0))
    best = int(np.nanargmax(scores)) if np.isfinite(scores).any() else 0
    least_correlation = 0.5  # of speeds; below it two recordings do not show the same movement
    if not np.isfinite(scores).any() or found[best] < least_correlation:
        raise RecordingError(
            "the marker file and the track do not show the same movement at any lag; check that both are of one trial, "
            "or give --lag SECONDS if no person moves"
        )
    return float(own.start + lags[best] / RATE - other.start), float(found[best])


def refined_lag(
    times: np.ndarray, points: np.ndarray, other_times: np.ndarray, other_points: np.ndarray, lag: float
) -> float:
    """Return the lag within two samples of `lag` at which the aligned joints are nearest, seconds."""

    def residual(shift: float) -> float:
        moved = resampled(other_times + lag + shift, other_points, times)
        return align(moved, points).residual

    reach = 2.0 * max(1.0 / RATE, float(np.median(np.diff(times))))
    return lag + float(minimize_scalar(residual, bounds=(-reach, reach), method="bounded", options={"xatol": 1e-3}).x)


def align(moving: np.ndarray, fixed: np.ndarray, iterations: int = 10) -> RigidAlignment:
    """Find the rigid motion that maps points (T, J, 3) to others, robustly.

    Least squares (Kabsch) with Cauchy weights, whose scale is the median residual of the step before.

    Raises
    ------
    RecordingError
        Fewer than three points are known in both.
    """
    known = np.isfinite(moving).all(axis=2) & np.isfinite(fixed).all(axis=2)
    a, b = moving[known], fixed[known]
    if len(a) < 3:
        raise RecordingError("the marker file and the track have no joint in common at any time; check both files")
    weights = np.ones(len(a))
    for _ in range(iterations):
        rotation, translation = _kabsch(a, b, weights)
        distance = np.linalg.norm(a @ rotation.T + translation - b, axis=1)
        weights = 1.0 / (1.0 + (distance / max(float(np.median(distance)), 1e-6)) ** 2)
    return RigidAlignment(rotation, translation, float(np.median(distance)), _mirrored_residual(a, b))


def _mirrored_residual(a: np.ndarray, b: np.ndarray) -> float:
    mirrored = a * np.array([-1.0, 1.0, 1.0])
    rotation, translation = _kabsch(mirrored, b, np.ones(len(a)))
    return float(np.median(np.linalg.norm(mirrored @ rotation.T + translation - b, axis=1)))


def _kabsch(a: np.ndarray, b: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    middle_a, middle_b = (np.average(points, axis=0, weights=weights) for points in (a, b))
    rotation = Rotation.align_vectors(b - middle_b, a - middle_a, weights)[0].as_matrix()
    return rotation, middle_b - rotation @ middle_a
