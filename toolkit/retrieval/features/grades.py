"""Graded features: signed distance of each feature's quantity from its threshold, in place of a Boolean.

Two people who perform the same motion cross a feature's threshold at different times, or one of them does not reach it.
A Boolean then differs all the time, a grade only a little. A grade is `127 tanh(m / s)` with the margin m of the
quantity over the middle of the feature's two thresholds, and the feature's usual range s. Not part of the thesis.
"""

from __future__ import annotations

import numpy as np

FULL = 127
"""Largest grade; `-FULL` is the smallest."""
BLOCK_COLUMNS = 4
"""Number of columns of graded features (30 Hz) whose mean is one coarse column (7.5 Hz)."""

SCALES: np.ndarray = np.array(
    [
        1.8, 1.8, 2.5, 2.5, 1.3, 1.3, 32, 32, 0.37, 1.5, 0.99, 0.99, 3.1, 3.1,
        0.78, 0.78, 0.15, 0.15, 0.32, 34, 34, 0.92, 0.49, 0.49, 1.7, 1.7,
        35, 35, 43, 43, 0.31, 23, 1.7, 1.7, 0.21, 0.21, 0.25, 0.61, 2.1, 26,
    ]
)  # fmt: skip
"""float64 (40,): range of each feature's quantity, in the feature's unit: half of the difference between its 16th and
84th percentile in mocap of everyday motion and sport (HDM05 actors bd and bk, CMU subjects 2 to 8), equal for left
and right."""

SPREADS: np.ndarray = np.array(
    [
        72, 72, 72, 72, 71, 71, 79, 79, 26, 73, 66, 66, 69, 69,
        77, 77, 34, 34, 18, 81, 81, 23, 52, 46, 85, 85,
        69, 69, 78, 78, 81, 65, 63, 63, 51, 51, 81, 74, 79, 44,
    ],
    dtype=np.float64,
)  # fmt: skip
"""float64 (40,): standard deviation of each feature's grades in the same mocap. `training/motion_scales.py` prints
both."""


def grade(margins: np.ndarray) -> np.ndarray:
    """Return the grades int8 (40, T) of margins (40, T), each in its feature's unit, positive on the side of a 1."""
    return np.rint(FULL * np.tanh(margins / SCALES[:, None])).astype(np.int8)


def importance(grades: np.ndarray) -> np.ndarray:
    """Return the weight of each feature in a comparison with an example's grades (40, T): float64 (40,), sum 1.

    The weight grows with the standard deviation of the example's grades relative to the usual one: features that the
    example changes characterise its motion.
    """
    idle_feature_weight = 0.3  # weight of a feature that an example does not change, relative to 1 for the usual change
    weights = idle_feature_weight + grades.std(axis=1) / SPREADS
    return weights / weights.sum()


def coarse(grades: np.ndarray) -> np.ndarray:
    """Return means of blocks of `BLOCK_COLUMNS` columns of grades (40, T): int8 (40, B); the last may be shorter."""
    return np.ascontiguousarray(coarse_rows(grades.T, np.array([0, grades.shape[1]]))[0].T)


def coarse_rows(rows: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the means of `BLOCK_COLUMNS` columns of many consecutive documents.

    Parameters
    ----------
    rows : int8 (N, 40), graded columns of all documents
    starts : int64 (D + 1,), first column of each document, ending with N

    Returns
    -------
    means : int8 (M, 40); no block contains columns of two documents
    coarse_starts : int64 (D + 1,), first block of each document, ending with M
    """
    counts = -(-np.diff(starts) // BLOCK_COLUMNS)
    coarse_starts = np.concatenate([[0], np.cumsum(counts)])
    within = np.arange(coarse_starts[-1]) - np.repeat(coarse_starts[:-1], counts)
    firsts = np.repeat(starts[:-1], counts) + BLOCK_COLUMNS * within
    sums = np.add.reduceat(rows, firsts, axis=0, dtype=np.float32)
    means = np.rint(sums / np.diff(np.append(firsts, len(rows)))[:, None].astype(np.float32))
    return means.astype(np.int8), coarse_starts
