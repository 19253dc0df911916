"""Small linear algebra with a fixed order of summation, compiled.

Decisions between hypotheses must not depend on the memory layout of an array or on the processor, because the last bit
can decide a close choice and change a whole track. The sums of BLAS and LAPACK depend on both; these sums run from the
first to the last element.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit


def rotated(points: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the rows of `points` (..., 3) times `rotation` (3, 3), as `points @ rotation`: float64 (..., 3)."""
    rows = np.ascontiguousarray(points, dtype=np.float64)
    out = np.empty_like(rows)
    _rotate(rows.reshape(-1, 3), np.ascontiguousarray(rotation, dtype=np.float64), out.reshape(-1, 3))
    return out


def times(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return `matrix @ vector` of (M, N) and (N,): float64 (M,)."""
    out = np.empty(len(matrix))
    _times(_plain(matrix), _plain(vector), out)
    return out


def combined(weights: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the sum over k of `weights[k] * rows[k]`, (K,) and (K, ...): float64 (...); zero without rows."""
    flat = _plain(rows).reshape(len(rows), math.prod(rows.shape[1:]))
    out = np.zeros(flat.shape[1])
    _combine(_plain(weights), flat, out)
    return out.reshape(rows.shape[1:])


def dot(first: np.ndarray, second: np.ndarray) -> float:
    """Return the scalar product of two vectors (N,)."""
    return float(_dot(_plain(first), _plain(second)))


def lengths(vectors: np.ndarray) -> np.ndarray:
    """Return the length of each of `vectors` (N, 3): float64 (N,); NaN stays NaN."""
    out = np.empty(len(vectors))
    _lengths(_plain(vectors), out)
    return out


def dots(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the scalar product of each row of `first` and of `second`, both (N, 3): float64 (N,)."""
    out = np.empty(len(first))
    _dots(_plain(first), _plain(second), out)
    return out


def gram(columns: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return `columns' diag(weights) columns` of (N, K) and (N,): float64 (K, K)."""
    out = np.zeros((columns.shape[1], columns.shape[1]))
    _gram(_plain(columns), _plain(weights), out)
    return out


def moments(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean (D,) and covariance (D, D), divided by N - 1, of `rows` (N, D); zeros for a single row."""
    plain = _plain(rows)
    mean = combined(np.full(len(plain), 1.0 / len(plain)), plain)
    return mean, gram(plain - mean, np.full(len(plain), 1.0 / max(len(plain) - 1, 1)))


def solved(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return the x of `matrix @ x = vector` for a symmetric positive definite matrix (N, N): float64 (N,).

    Raises
    ------
    ValueError
        The matrix is not positive definite.
    """
    factor, x = np.array(matrix, dtype=np.float64), np.array(vector, dtype=np.float64)
    if not cholesky(factor):
        raise ValueError("the matrix is not positive definite")
    substitute(factor, x)
    return x


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a symmetric positive definite matrix (N, N): float64 (N, N), symmetric.

    Raises
    ------
    ValueError
        The matrix is not positive definite.
    """
    columns = np.stack([solved(matrix, unit) for unit in np.eye(len(matrix))])
    return 0.5 * (columns + columns.T)


def principal_axes(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues (3,), rising, and unit eigenvectors (3, 3), its columns, of a symmetric `matrix` (3, 3)."""
    diagonal, vectors = np.array(matrix, dtype=np.float64), np.eye(3)
    _jacobi(diagonal, vectors)
    order = sorted(range(3), key=lambda axis: diagonal[axis, axis])
    return diagonal.diagonal()[order], vectors[:, order]


def _plain(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array, dtype=np.float64)


@njit(cache=True)
def _rotate(points: np.ndarray, rotation: np.ndarray, out: np.ndarray) -> None:
    for n in range(points.shape[0]):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        for a in range(3):
            out[n, a] = x * rotation[0, a] + y * rotation[1, a] + z * rotation[2, a]


@njit(cache=True)
def _times(matrix: np.ndarray, vector: np.ndarray, out: np.ndarray) -> None:
    for m in range(matrix.shape[0]):
        total = 0.0
        for n in range(matrix.shape[1]):
            total += matrix[m, n] * vector[n]
        out[m] = total


@njit(cache=True)
def _combine(weights: np.ndarray, rows: np.ndarray, out: np.ndarray) -> None:
    for k in range(rows.shape[0]):
        w = weights[k]
        for n in range(rows.shape[1]):
            out[n] += w * rows[k, n]


@njit(cache=True)
def _dot(first: np.ndarray, second: np.ndarray) -> float:
    total = 0.0
    for n in range(first.shape[0]):
        total += first[n] * second[n]
    return total


@njit(cache=True)
def _lengths(vectors: np.ndarray, out: np.ndarray) -> None:
    for n in range(vectors.shape[0]):
        x, y, z = vectors[n, 0], vectors[n, 1], vectors[n, 2]
        out[n] = np.sqrt(x * x + y * y + z * z)


@njit(cache=True)
def _dots(first: np.ndarray, second: np.ndarray, out: np.ndarray) -> None:
    for n in range(first.shape[0]):
        out[n] = first[n, 0] * second[n, 0] + first[n, 1] * second[n, 1] + first[n, 2] * second[n, 2]


@njit(cache=True)
def _gram(columns: np.ndarray, weights: np.ndarray, out: np.ndarray) -> None:
    for n in range(columns.shape[0]):
        for i in range(columns.shape[1]):
            weighted = weights[n] * columns[n, i]
            for j in range(i + 1):
                out[i, j] += weighted * columns[n, j]
    for i in range(columns.shape[1]):
        for j in range(i):
            out[j, i] = out[i, j]


@njit(cache=True)
def cholesky(a: np.ndarray) -> bool:
    """Factor a symmetric matrix (N, N) in place, lower triangle; False where it is not positive definite."""
    for i in range(a.shape[0]):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            if i == j:
                if total <= 1e-12:
                    return False
                a[i, i] = np.sqrt(total)
            else:
                a[i, j] = total / a[j, j]
    return True


@njit(cache=True)
def substitute(factor: np.ndarray, y: np.ndarray) -> None:
    """Solve `factor factor' x = y` for a lower triangle (N, N); x takes the place of `y` (N,)."""
    size = y.shape[0]
    for i in range(size):
        total = y[i]
        for k in range(i):
            total -= factor[i, k] * y[k]
        y[i] = total / factor[i, i]
    for i in range(size - 1, -1, -1):
        total = y[i]
        for k in range(i + 1, size):
            total -= factor[k, i] * y[k]
        y[i] = total / factor[i, i]


@njit(cache=True)
def _jacobi(a: np.ndarray, vectors: np.ndarray) -> None:
    """Turn a symmetric `a` (3, 3) into a diagonal one by plane rotations, gathered in `vectors` (3, 3)."""
    sweeps = 30  # Jacobi sweeps; five are enough for all digits
    for _ in range(sweeps):
        if a[0, 1] == 0.0 and a[0, 2] == 0.0 and a[1, 2] == 0.0:
            return
        for p in range(2):
            for q in range(p + 1, 3):
                if a[p, q] == 0.0:
                    continue
                theta = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
                t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):
                    left, right = a[k, p], a[k, q]
                    a[k, p], a[k, q] = c * left - s * right, s * left + c * right
                for k in range(3):
                    left, right = a[p, k], a[q, k]
                    a[p, k], a[q, k] = c * left - s * right, s * left + c * right
                a[p, q] = a[q, p] = 0.0
                for k in range(3):
                    left, right = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = c * left - s * right, s * left + c * right
