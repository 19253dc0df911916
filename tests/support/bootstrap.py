"""Paired bootstrap of the difference between two trackers."""

from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import UsageError


@dataclass(frozen=True)
class PairedDifference:
    """Difference `first - second` over recordings with its 95 % interval, in the unit of the samples.

    `probability_above_zero` is the share of resamples whose mean difference is above zero.
    """

    mean: float
    low: float
    high: float
    probability_above_zero: float


def paired_bootstrap(
    first: np.ndarray, second: np.ndarray, rng: np.random.Generator, samples: int = 10_000
) -> PairedDifference:
    """Resample recordings with replacement, keeping the pairs together.

    Parameters
    ----------
    first, second : (R,), one figure per recording, the same recordings in the same order
    samples : number of resamples

    Raises
    ------
    UsageError
        The two differ in length or are empty.
    """
    if len(first) != len(second) or len(first) == 0:
        raise UsageError(f"{len(first)} and {len(second)} figures cannot be paired; give one per recording to both")
    from scipy.stats import bootstrap

    difference = np.asarray(first, np.float64) - np.asarray(second, np.float64)
    if len(difference) == 1:
        only = float(difference[0])
        return PairedDifference(only, only, only, float(only > 0))
    found = bootstrap((difference,), np.mean, n_resamples=samples, method="percentile", random_state=rng)
    low, high = found.confidence_interval
    above = float((found.bootstrap_distribution > 0).mean())
    return PairedDifference(float(difference.mean()), float(low), float(high), above)
