"""Exact nearest neighbours of a few low-dimensional queries among some ten thousand rows, compiled.

The rows are sorted into the leaves of a k-d tree and stored column by column, so that leaves are compared with vector
instructions. A leaf whose box is farther than the neighbours found so far is skipped. The worst case is a linear scan.
A query may use a subset of the columns, because a box bounds each subset.
"""

from __future__ import annotations

import numpy as np
from numba import njit

LEAF = 256
"""Maximum number of rows in a leaf."""


def leaf_order(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut rows (N, D) at the median of their widest column until each part has at most `LEAF` rows.

    Returns
    -------
    order : int64 (N,), rows in the order of the leaves, ascending within a leaf
    starts : int64 (L + 1,), where each leaf begins in `order`
    """
    leaves: list[np.ndarray] = []
    parts = [np.arange(len(rows))]
    while parts:
        part = parts.pop()
        if len(part) <= LEAF:
            leaves.append(np.sort(part))
            continue
        column = np.ptp(rows[part], axis=0).argmax()
        half = len(part) // 2
        ranks = np.argpartition(rows[part, column], half)
        parts += [part[ranks[half:]], part[ranks[:half]]]
    return np.concatenate(leaves), np.cumsum([0] + [len(leaf) for leaf in leaves])


def boxes(columns: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest value (L, D) of each leaf of `columns` (D, N)."""
    ends = (extreme.reduceat(columns, starts[:-1], axis=1) for extreme in (np.minimum, np.maximum))
    low, high = (np.ascontiguousarray(end.T) for end in ends)
    return low, high


@njit(cache=True)
def _insert(value: np.float32, row: int, distances: np.ndarray, indices: np.ndarray) -> None:
    """Insert a row into the ascending list of the nearest ones; its last entry is removed."""
    place = distances.shape[0] - 1
    while place > 0 and (distances[place - 1] > value or (distances[place - 1] == value and indices[place - 1] > row)):
        distances[place] = distances[place - 1]
        indices[place] = indices[place - 1]
        place -= 1
    distances[place] = value
    indices[place] = row


@njit(cache=True)
def nearest(
    queries: np.ndarray,
    used: np.ndarray,
    columns: np.ndarray,
    order: np.ndarray,
    starts: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    distances: np.ndarray,
    indices: np.ndarray,
) -> None:
    """Fill squared `distances` and `indices` (M, K), K at most N, nearest first, the lowest index of equals first.

    `queries` float32 (M, D) and `used` bool (M, D), the columns that count; `columns` float32 (D, N) in the order
    `order` with its leaves `starts` (see `leaf_order`) and their `boxes`.
    """
    leaves, dimensions = low.shape
    bound = np.empty(leaves, np.float32)
    squares = np.empty(LEAF, np.float32)
    # Factor on the squared distance to a box, above the rounding error of a float32 sum of 15 squares (about 1e-6).
    slack = np.float32(1.0 - 1e-5)
    for m in range(queries.shape[0]):
        distances[m] = np.inf
        indices[m] = columns.shape[1]
        bound[:] = 0.0
        for leaf in range(leaves):
            for d in range(dimensions):
                if used[m, d]:
                    outside = max(low[leaf, d] - queries[m, d], queries[m, d] - high[leaf, d], np.float32(0.0))
                    bound[leaf] += outside * outside
        for _ in range(leaves):
            leaf = 0  # the nearest of the remaining leaves
            for other in range(1, leaves):
                if bound[other] < bound[leaf]:
                    leaf = other
            if bound[leaf] * slack > distances[m, -1] or bound[leaf] == np.inf:
                break
            bound[leaf] = np.inf
            begin = starts[leaf]
            size = starts[leaf + 1] - begin
            squares[:size] = 0.0
            for d in range(dimensions):
                if used[m, d]:
                    column = columns[d, begin : begin + size]
                    value = queries[m, d]
                    for i in range(size):
                        difference = column[i] - value
                        squares[i] += difference * difference
            for i in range(size):
                row = order[begin + i]
                if squares[i] < distances[m, -1] or (squares[i] == distances[m, -1] and row < indices[m, -1]):
                    _insert(squares[i], row, distances[m], indices[m])


@njit(cache=True)
def weighted_nearest(
    query: np.ndarray, weights: np.ndarray, columns: np.ndarray, distances: np.ndarray, indices: np.ndarray
) -> None:
    """Find the rows of `columns` (D, N) with the smallest weighted squared distances to `query` (D,) by a linear scan.

    Fills `distances` (K,), squared, and `indices` (K,), K at most N, nearest first, ties to the lower row. Block by
    block and column after column, so that each pass runs with vector instructions over memory that stays in the cache.
    """
    distances[:] = np.inf
    block = 1024  # rows per block (4 KB of squares)
    squares = np.empty(block, dtype=np.float32)
    total = columns.shape[1]
    for begin in range(0, total, block):
        size = min(block, total - begin)
        squares[:size] = 0.0
        for d in range(columns.shape[0]):
            w, value = weights[d], query[d]
            column = columns[d, begin : begin + size]
            for n in range(size):
                difference = column[n] - value
                squares[n] += w * difference * difference
        for n in range(size):
            if squares[n] < distances[-1]:
                _insert(squares[n], begin + n, distances, indices)


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
