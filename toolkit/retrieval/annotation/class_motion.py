"""Mean motion of a class: joint angles, spread, covariance and correlation time along its template.

The priors of the thesis's Chapter 6 are logical ones and poses of other segments. Here a class also stores its mean
motion, learnt from the clips of its template, which predicts occluded limbs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion import dtw
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix
from toolkit.retrieval.templates import MotionTemplate, expand

ANGLES = slice(6, skeleton.POSE_SIZE)
"""Entries of the A = 37 joint angles in a pose."""
ANGLE_COUNT = skeleton.POSE_SIZE - 6


class Example(NamedTuple):
    """Clip of a class: its features, and the poses (T, P) of the same columns."""

    features: FeatureMatrix
    poses: np.ndarray


@dataclass(frozen=True, eq=False)
class ClassMotion:
    """Mean motion of a class along the N expanded columns of its template.

    Attributes
    ----------
    mean, spread : float64 (N, A), radians: joint angles and their standard deviation
    covariance : float64 (A, A), of the deviations from the mean, pooled over the columns
    memory : seconds, correlation time of the deviations
    """

    mean: np.ndarray
    spread: np.ndarray
    covariance: np.ndarray
    memory: float

    def __post_init__(self) -> None:
        columns = len(self.mean)
        shapes = (self.mean.shape, self.spread.shape, self.covariance.shape)
        if shapes != ((columns, ANGLE_COUNT), (columns, ANGLE_COUNT), (ANGLE_COUNT, ANGLE_COUNT)) or not columns:
            raise RetrievalError(f"a class motion has arrays of shapes {shapes}; learn the classes again")

    def __len__(self) -> int:
        return len(self.mean)


def learn_motion(template: MotionTemplate, examples: Sequence[Example]) -> ClassMotion:
    """Return the mean motion of a class from the clips of its template.

    Clips are aligned with the template, then again with it and the mean motion, because features alone do not determine
    the alignment between two of their changes.

    Raises
    ------
    RetrievalError
        There are no clips, or the number of poses of a clip differs from its columns.
    """
    if not examples:
        raise RetrievalError("a class without clips has no motion; give at least one training clip")
    for example in examples:
        if len(example.features) != len(example.poses):
            raise RetrievalError(
                f"clip {example.features.name!r} has {len(example.features)} columns but {len(example.poses)} poses"
            )
    values, _ = expand(template.values, template.weights)
    warped = [_warped(values, example) for example in examples]
    rounds = 3  # number of alignments of clips, the first by the features alone
    for _ in range(rounds - 1):
        mean = np.mean(warped, axis=0)
        warped = [_warped(values, example, mean) for example in examples]
    stack = np.stack(warped)
    mean = stack.mean(axis=0)
    away = stack - mean
    freedom = max(len(stack) - 1, 1) / max(len(stack), 1)
    variance, pooled = (away**2).mean(axis=0) / freedom, (away**2).mean(axis=(0, 1)) / freedom
    count = len(stack)
    pooled_clips = 4.0  # number of clips that the spread over the whole motion counts for, besides that of one column
    least_spread = 0.03  # radians, smallest standard deviation of an angle
    spread = np.sqrt((count * variance + pooled_clips * pooled) / (count + pooled_clips) + least_spread**2)
    flat = away.reshape(-1, ANGLE_COUNT)
    return ClassMotion(mean, spread, flat.T @ flat / (len(flat) * freedom), _memory(away))


def _warped(values: np.ndarray, example: Example, mean: np.ndarray | None = None) -> np.ndarray:
    """Return the angles (N, A) of a clip on the columns of a template; `mean` (N, A) refines the alignment."""
    own = example.features.values.astype(np.float64)
    angles = example.poses[:, ANGLES]
    angle_scale = 2.0  # radians of mean angle difference with the weight of a difference in all features
    if mean is not None:
        # The kernel averages over rows: the factor gives the angles their share of the weight.
        factor = len(own) / (angle_scale * ANGLE_COUNT)
        values = np.concatenate([values, factor * mean.T])
        own = np.concatenate([own, factor * angles.T])
    _, path = dtw.align(
        np.ascontiguousarray(values), np.ones(values.shape[1]), np.ascontiguousarray(own), np.ones(own.shape[1])
    )
    return dtw.warp(path, np.ascontiguousarray(angles.T), np.ones(len(angles)), values.shape[1])[0].T


def _memory(away: np.ndarray) -> float:
    """Return the seconds in which the correlation of deviations (clips, N, A) falls to 1/e."""
    lag = 5  # columns between the samples of the correlation time, because the difference of neighbours is noise
    memory_range = (0.1, 2.0)  # seconds, smallest and largest correlation time that a few clips determine
    if away.shape[1] <= lag:
        return memory_range[0]
    total = float((away**2).mean())
    if total <= 0.0:
        return memory_range[1]
    kept = float((away[:, lag:] * away[:, :-lag]).mean()) / total
    seconds = lag / FEATURE_RATE / -np.log(min(max(kept, 1e-6), 1.0 - 1e-6))
    return float(np.clip(seconds, *memory_range))
