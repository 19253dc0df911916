"""Nearest neighbours of a few low-dimensional queries among some ten thousand rows, by a scan of all, compiled.

Of 29,388 rows of 15 columns, 12 queries take 0.6 ms: a tree of them gains little.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def _insert(value: np.float32, row: int, distances: np.ndarray, indices: np.ndarray) -> None:
    """Insert a row into the ascending list of the nearest ones, behind equals; its last entry is removed."""
    place = distances.shape[0] - 1
    while place > 0 and distances[place - 1] > value:
        distances[place] = distances[place - 1]
        indices[place] = indices[place - 1]
        place -= 1
    distances[place] = value
    indices[place] = row


@njit(cache=True)
def weighted_nearest(
    queries: np.ndarray, weights: np.ndarray, columns: np.ndarray, distances: np.ndarray, indices: np.ndarray
) -> None:
    """Find the rows of `columns` (D, N) with the smallest weighted squared distances to each of `queries` (M, D).

    Fills `distances` (M, K), squared, and `indices` (M, K), K at most N, nearest first, ties to the lower row. All are
    float32, also `weights` (M, D). Block by block and column after column, so that each pass runs with vector
    instructions over memory that stays in the cache.
    """
    distances[:] = np.inf
    block = 1024  # rows per block (4 KB of squares)
    squares = np.empty(block, dtype=np.float32)
    total = columns.shape[1]
    for m in range(queries.shape[0]):
        for begin in range(0, total, block):
            size = min(block, total - begin)
            squares[:size] = 0.0
            for d in range(columns.shape[0]):
                w, value = weights[m, d], queries[m, d]
                if w == 0.0:
                    continue
                column = columns[d, begin : begin + size]
                for n in range(size):
                    difference = column[n] - value
                    squares[n] += w * difference * difference
            for n in range(size):
                if squares[n] < distances[m, -1]:
                    _insert(squares[n], begin + n, distances[m], indices[m])


@njit(cache=True)
def smallest_gap(first: np.ndarray, second: np.ndarray) -> float:
    """Return the smallest distance between a point of `first` (N, 3) and one of `second` (M, 3); infinite without."""
    best = np.inf
    for n in range(first.shape[0]):
        x, y, z = first[n, 0], first[n, 1], first[n, 2]
        for m in range(second.shape[0]):
            dx, dy, dz = second[m, 0] - x, second[m, 1] - y, second[m, 2] - z
            best = min(best, dx * dx + dy * dy + dz * dz)
    return np.sqrt(best)
