"""Compiled conditional distributions of Gaussian mixtures with some known variables.

Sums run in a fixed order, so that the result does not depend on a linear algebra library.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels.linear import cholesky, substitute


@njit(cache=True)
def condition(
    covariances: np.ndarray,
    known: np.ndarray,
    unknown: np.ndarray,
    noise: float,
    factors: np.ndarray,
    gains: np.ndarray,
    remaining: np.ndarray,
) -> None:
    """Compute the parts of K conditional Gaussians of D variables that do not depend on the known values.

    Parameters
    ----------
    covariances : (K, D, D)
    known, unknown : int64 (A,) and (B,), known and unknown variables
    noise : standard deviation of the error of the known values
    factors : (K, A, A), filled with the Cholesky factors of the known variables' covariances, noise included
    gains : (K, B, A), filled with the change of the unknown variables per unit of each known one
    remaining : (K, B, B), filled with the conditional covariances of the unknown variables
    """
    a, b = known.shape[0], unknown.shape[0]
    for k in range(covariances.shape[0]):
        factor = factors[k]
        for i in range(a):
            for j in range(a):
                factor[i, j] = covariances[k, known[i], known[j]]
            factor[i, i] += noise * noise
        cholesky(factor)
        for i in range(b):
            for j in range(a):
                gains[k, i, j] = covariances[k, unknown[i], known[j]]
            substitute(factor, gains[k, i])
        for i in range(b):
            for j in range(b):
                total = covariances[k, unknown[i], unknown[j]]
                for m in range(a):
                    total -= gains[k, i, m] * covariances[k, unknown[j], known[m]]
                remaining[k, i, j] = total


@njit(cache=True)
def responsibilities(
    values: np.ndarray, log_weights: np.ndarray, means: np.ndarray, known: np.ndarray, factors: np.ndarray,
    out: np.ndarray,
) -> None:  # fmt: skip
    """Compute the probability of each of K Gaussians given the known variables.

    Fills `out` (K,). `values` (A,) belong to the variables `known` (A,); `means` (K, D); `factors` as filled by
    `condition`.
    """
    a, count = known.shape[0], means.shape[0]
    rest, solved = np.empty(a), np.empty(a)
    best = -np.inf
    for k in range(count):
        for i in range(a):
            rest[i] = values[i] - means[k, known[i]]
            solved[i] = rest[i]
        substitute(factors[k], solved)
        total = log_weights[k]
        for i in range(a):
            total -= 0.5 * rest[i] * solved[i] + np.log(factors[k, i, i]) + 0.5 * np.log(2.0 * np.pi)
        out[k] = total
        best = max(best, total)
    mass = 0.0
    for k in range(count):
        out[k] = np.exp(out[k] - best)
        mass += out[k]
    for k in range(count):
        out[k] /= mass


@njit(cache=True)
def expect(
    values: np.ndarray, shares: np.ndarray, means: np.ndarray, known: np.ndarray, unknown: np.ndarray,
    gains: np.ndarray, remaining: np.ndarray, mean: np.ndarray, covariance: np.ndarray,
) -> None:  # fmt: skip
    """Compute mean (B,) and covariance (B, B) of the unknown variables under the mixture; fills both.

    `shares` (K,) are the responsibilities; the rest is as in `condition` and `responsibilities`.
    """
    a, b, count = known.shape[0], unknown.shape[0], means.shape[0]
    each = np.empty((count, b))
    mean[:] = 0.0
    for k in range(count):
        for i in range(b):
            total = means[k, unknown[i]]
            for j in range(a):
                total += gains[k, i, j] * (values[j] - means[k, known[j]])
            each[k, i] = total
            mean[i] += shares[k] * total
    covariance[:] = 0.0
    for k in range(count):
        for i in range(b):
            for j in range(b):
                spread = (each[k, i] - mean[i]) * (each[k, j] - mean[j])
                covariance[i, j] += shares[k] * (remaining[k, i, j] + spread)
