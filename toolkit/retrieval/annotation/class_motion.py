"""How a motion class moves: mean joint angles, spread, covariance and memory for each column of its template.

The thesis's priors of Chapter 6 are logical ones and poses of other stretches. Here a class also keeps the motion
itself, learnt from the clips that its template was learnt from, so that a hidden limb can be told by the class.
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
"""Where the A = 37 joint angles stand in a pose."""
ANGLE_COUNT = skeleton.POSE_SIZE - 6
POOLED = 4.0
"""Clips that the spread over the whole motion counts for, beside that of one column."""
LEAST_SPREAD = 0.03
"""Radians: what no class knows an angle better than."""
LAG = 5
"""Columns between which the memory is measured: neighbours differ by the noise of capture."""
MEMORY = (0.1, 2.0)
"""Seconds: shortest and longest memory that a few clips can tell."""
ROUNDS = 3
"""How often clips are aligned with their mean motion, the first time by the features alone."""
ANGLE_SHARE = 2.0
"""Radians of mean difference of the angles that count as much as all features being different."""


class Example(NamedTuple):
    """A clip of a class: its features, and the poses (T, P) of the same columns."""

    features: FeatureMatrix
    poses: np.ndarray


@dataclass(frozen=True, eq=False)
class ClassMotion:
    """How a class moves, by the N columns of its template (of weight about 1, as `expand` gives them).

    Attributes
    ----------
    mean, spread : float64 (N, A), radians: joint angles and their standard deviation
    covariance : float64 (A, A), of the deviations from the mean, pooled over the columns
    memory : seconds after which deviations are forgotten
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
    """The motion of a class from the clips that its template was fitted to.

    Clips are aligned with the template, then again with it and the mean motion, for features alone leave the way
    between two of their changes open.

    Raises
    ------
    RetrievalError
        No clips, or a clip with another number of poses than columns.
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
    for _ in range(ROUNDS - 1):
        mean = np.mean(warped, axis=0)
        warped = [_warped(values, example, mean) for example in examples]
    stack = np.stack(warped)
    mean = stack.mean(axis=0)
    away = stack - mean
    freedom = max(len(stack) - 1, 1) / max(len(stack), 1)
    variance, pooled = (away**2).mean(axis=0) / freedom, (away**2).mean(axis=(0, 1)) / freedom
    count = len(stack)
    spread = np.sqrt((count * variance + POOLED * pooled) / (count + POOLED) + LEAST_SPREAD**2)
    flat = away.reshape(-1, ANGLE_COUNT)
    return ClassMotion(mean, spread, flat.T @ flat / (len(flat) * freedom), _memory(away))


def _warped(values: np.ndarray, example: Example, mean: np.ndarray | None = None) -> np.ndarray:
    """Angles (N, A) of a clip on the columns of a template; `mean` (N, A) helps to align."""
    own = example.features.values.astype(np.float64)
    angles = example.poses[:, ANGLES]
    if mean is not None:
        # The kernel averages over rows: angles get as many rows' weight as they are to count.
        factor = len(own) / (ANGLE_SHARE * ANGLE_COUNT)
        values = np.concatenate([values, factor * mean.T])
        own = np.concatenate([own, factor * angles.T])
    _, path = dtw.align(
        np.ascontiguousarray(values), np.ones(values.shape[1]), np.ascontiguousarray(own), np.ones(own.shape[1])
    )
    return dtw.warp(path, np.ascontiguousarray(angles.T), np.ones(len(angles)), values.shape[1])[0].T


def _memory(away: np.ndarray) -> float:
    """Seconds in which the correlation of deviations (clips, N, A) falls to 1/e."""
    if away.shape[1] <= LAG:
        return MEMORY[0]
    total = float((away**2).mean())
    if total <= 0.0:
        return MEMORY[1]
    kept = float((away[:, LAG:] * away[:, :-LAG]).mean()) / total
    seconds = LAG / FEATURE_RATE / -np.log(min(max(kept, 1e-6), 1.0 - 1e-6))
    return float(np.clip(seconds, *MEMORY))
