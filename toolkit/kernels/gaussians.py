"""Mixtures of Gaussians of which some variables are known: what that says about the others, compiled.

Sums run in a fixed order, so that the result does not depend on a linear algebra library.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def _cholesky(matrix: np.ndarray) -> None:
    """Lower Cholesky factor of a positive definite matrix (N, N), in place; what is above the diagonal stays."""
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(max(total, 1e-12)) if i == j else total / matrix[j, j]


@njit(cache=True)
def _solve_lower(factor: np.ndarray, vector: np.ndarray) -> None:
    """Solve L x = b in place."""
    for i in range(len(vector)):
        total = vector[i]
        for k in range(i):
            total -= factor[i, k] * vector[k]
        vector[i] = total / factor[i, i]


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
    """What depends on which variables are known but not on their values, for K Gaussians of D variables.

    Parameters
    ----------
    covariances : (K, D, D)
    known, unknown : int64 (A,) and (B,), variables whose values are, and are not, given
    noise : standard deviation of the given values about the true ones
    factors : (K, A, A), filled with the Cholesky factors of the known variables' covariances, noise included
    gains : (K, B, A), filled with what unknown variables change by per unit of each known one
    remaining : (K, B, B), filled with the covariances of the unknown ones once the others are known
    """
    a, b = known.shape[0], unknown.shape[0]
    for k in range(covariances.shape[0]):
        factor = factors[k]
        for i in range(a):
            for j in range(a):
                factor[i, j] = covariances[k, known[i], known[j]]
            factor[i, i] += noise * noise
        _cholesky(factor)
        # Half of the way: W = L^-1 C_known,unknown; then remaining = C - W^T W, and gains = W^T L^-1.
        for i in range(b):
            half = gains[k, i]
            for j in range(a):
                half[j] = covariances[k, unknown[i], known[j]]
            _solve_lower(factor, half)
        for i in range(b):
            for j in range(b):
                total = covariances[k, unknown[i], unknown[j]]
                for m in range(a):
                    total -= gains[k, i, m] * gains[k, j, m]
                remaining[k, i, j] = total
        for i in range(b):
            half = gains[k, i]
            for j in range(a - 1, -1, -1):
                total = half[j]
                for m in range(j + 1, a):
                    total -= factor[m, j] * half[m]
                half[j] = total / factor[j, j]


@njit(cache=True)
def responsibilities(
    values: np.ndarray, log_weights: np.ndarray, means: np.ndarray, known: np.ndarray, factors: np.ndarray,
    out: np.ndarray,
) -> float:  # fmt: skip
    """Probability of each of K Gaussians given the known variables: fills `out` (K,); returns their log density.

    `values` (A,) belong to the variables `known` (A,); `means` (K, D); `factors` as `condition` fills them.
    """
    a, count = known.shape[0], means.shape[0]
    rest = np.empty(a)
    best = -np.inf
    for k in range(count):
        for i in range(a):
            rest[i] = values[i] - means[k, known[i]]
        _solve_lower(factors[k], rest)
        total = log_weights[k]
        for i in range(a):
            total -= 0.5 * rest[i] * rest[i] + np.log(factors[k, i, i]) + 0.5 * np.log(2.0 * np.pi)
        out[k] = total
        best = max(best, total)
    mass = 0.0
    for k in range(count):
        out[k] = np.exp(out[k] - best)
        mass += out[k]
    for k in range(count):
        out[k] /= mass
    return best + np.log(mass)


@njit(cache=True)
def expect(
    values: np.ndarray, shares: np.ndarray, means: np.ndarray, known: np.ndarray, unknown: np.ndarray,
    gains: np.ndarray, remaining: np.ndarray, mean: np.ndarray, covariance: np.ndarray,
) -> None:  # fmt: skip
    """Mean (B,) and covariance (B, B) of the unknown variables under the mixture: fills both.

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
