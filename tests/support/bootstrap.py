"""Paired bootstrap of the difference between two trackers."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PairedDifference:
    """Difference `first - second` over recordings with its 95 % interval, in the unit of the samples."""

    mean: float
    low: float
    high: float


def paired_bootstrap(
    first: np.ndarray, second: np.ndarray, rng: np.random.Generator, samples: int = 10_000
) -> PairedDifference:
    """Resample recordings with replacement, keeping the pairs together.

    Parameters
    ----------
    first, second : (R,), one figure per recording, the same recordings in the same order
    samples : number of resamples
    """
    from scipy.stats import bootstrap

    difference = np.asarray(first, np.float64) - np.asarray(second, np.float64)
    if len(difference) == 1:
        only = float(difference[0])
        return PairedDifference(only, only, only)
    found = bootstrap((difference,), np.mean, n_resamples=samples, method="percentile", random_state=rng)
    low, high = found.confidence_interval
    return PairedDifference(float(difference.mean()), float(low), float(high))
