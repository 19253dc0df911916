"""Calibration error of confidences."""

import numpy as np

BINS = 10
"""Number of equal bins of the confidence for the calibration error."""


def calibration_error(confidence: np.ndarray, correct: np.ndarray, weight: np.ndarray | None = None) -> float:
    """Return the expected calibration error (Guo 2017, Eq. 3), in [0, 1]; NaN of nothing.

    Mean over the bins, weighted by their number of samples, of the difference between the mean confidence and the share
    that is correct.

    Parameters
    ----------
    confidence : (S,), in [0, 1]
    correct : bool (S,)
    weight : (S,), with a sum of 1; default: equal
    """
    if len(confidence) == 0:
        return float("nan")
    number = np.minimum((np.asarray(confidence, dtype=np.float64) * BINS).astype(np.int64), BINS - 1)
    apart = np.asarray(confidence, np.float64) - correct
    if weight is not None:
        return float(np.abs(np.bincount(number, weights=weight * apart, minlength=BINS)).sum())
    return float(np.abs(np.bincount(number, weights=apart, minlength=BINS)).sum() / len(confidence))
