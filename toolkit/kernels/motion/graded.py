"""Compiled search by example in graded features: subsequence DTW over whole documents, and its hits."""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels.motion.dtw import best_alignment, minima_below

TILE: int = 1024
"""Number of document columns that are compared at a time, so that a tile stays in the processor's cache."""


@njit(cache=True)
def graded_distances(
    template: np.ndarray, weights: np.ndarray, columns: np.ndarray, document_starts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the subsequence DTW of an example with each of many documents (thesis 5.2, Eq. 5.3, on graded features).

    A cell costs the weighted sum of absolute differences. Steps, template by document: (1,1) and (1,2) with weight 1,
    (2,1) with weight 2 on its last cell. No step stays in a row, so a whole row is computed at once, in tiles of all
    documents. An alignment that ends in a tile starts at most 2 (N - 1) columns before it, and the tile is computed
    from there. Steps from the previous document are reset.

    Parameters
    ----------
    template : float32 (N, F), the example's columns, F a multiple of 4
    weights : float32 (F,)
    columns : int8 (M, F), all documents, one after the other
    document_starts : int64 (D + 1,), first column of each document, ending with M

    Returns
    -------
    cost : float32 (M,), cheapest alignment that ends in each column, infinite if none does
    start : int32 (M,), first column of that alignment, counted within the document
    """
    n, features = template.shape
    length = columns.shape[0]
    cost, start = np.empty(length, np.float32), np.empty(length, np.int32)
    halo = 2 * (n - 1)
    widest = min(TILE + halo, length)
    weighted = np.empty((features, widest), np.float32)
    costs = np.empty((3, widest), np.float32)
    starts = np.empty((3, widest), np.int32)
    cell = np.empty(widest, np.float32)
    document = 0
    for begin in range(0, length, TILE):
        first, stop = max(0, begin - halo), min(length, begin + TILE)
        width = stop - first
        while document > 0 and document_starts[document] >= first:
            document -= 1
        while document_starts[document] < first:
            document += 1
        for f in range(features):
            weight = weights[f]
            for j in range(width):
                weighted[f, j] = weight * np.float32(columns[first + j, f])
        for i in range(n):
            _cells(template[i], weights, weighted, width, cell)
            row, row_starts = costs[i % 3], starts[i % 3]
            if i == 0:
                for j in range(width):
                    row[j] = cell[j]
                    row_starts[j] = first + j
                continue
            before, before_starts = costs[(i - 1) % 3], starts[(i - 1) % 3]
            _step(row, row_starts, before, before_starts, cell, width)
            if i > 1:
                _skip(row, row_starts, costs[(i - 2) % 3], starts[(i - 2) % 3], cell, width)
            for d in range(document, document_starts.size - 1):
                j = document_starts[d] - first
                if j >= width:
                    break
                row[j], row_starts[j] = np.inf, -1
                if j + 1 < width and document_starts[d + 1] - first > j + 1:
                    row[j + 1], row_starts[j + 1] = before[j] + cell[j + 1], before_starts[j]
                    other = costs[(i - 2) % 3, j] + cell[j + 1] + cell[j + 1]
                    if i > 1 and other < row[j + 1]:
                        row[j + 1], row_starts[j + 1] = other, starts[(i - 2) % 3, j]
        cost[begin:stop] = costs[(n - 1) % 3, begin - first : width]
        start[begin:stop] = starts[(n - 1) % 3, begin - first : width]
    for d in range(document_starts.size - 1):
        for j in range(document_starts[d], document_starts[d + 1]):
            if start[j] >= 0:
                start[j] -= document_starts[d]
    return cost, start


@njit(cache=True)
def _cells(column: np.ndarray, weights: np.ndarray, columns: np.ndarray, width: int, cell: np.ndarray) -> None:
    """Compute the cost of one template column (F,) with each of `width` weighted document columns (F, W)."""
    for j in range(width):
        cell[j] = 0.0
    for f in range(0, column.shape[0], 4):
        a, b = column[f] * weights[f], column[f + 1] * weights[f + 1]
        c, d = column[f + 2] * weights[f + 2], column[f + 3] * weights[f + 3]
        row_a, row_b, row_c, row_d = columns[f], columns[f + 1], columns[f + 2], columns[f + 3]
        for j in range(width):
            cell[j] += (abs(row_a[j] - a) + abs(row_b[j] - b)) + (abs(row_c[j] - c) + abs(row_d[j] - d))


@njit(cache=True)
def _step(
    row: np.ndarray, row_starts: np.ndarray, before: np.ndarray, before_starts: np.ndarray, cell: np.ndarray, width: int
) -> None:
    """Compute a row of DTW with the steps (1,1) and (1,2)."""
    row[0], row_starts[0] = np.inf, -1
    if width > 1:
        row[1], row_starts[1] = before[0] + cell[1], before_starts[0]
    for j in range(2, width):
        near, far = before[j - 1], before[j - 2]
        row[j] = min(near, far) + cell[j]
        row_starts[j] = before_starts[j - 2] if far < near else before_starts[j - 1]


@njit(cache=True)
def _skip(
    row: np.ndarray, row_starts: np.ndarray, before: np.ndarray, before_starts: np.ndarray, cell: np.ndarray, width: int
) -> None:
    """Improve a row of DTW by the step (2,1) from the second row before."""
    for j in range(1, width):
        other = before[j - 1] + cell[j] + cell[j]
        better = other < row[j]
        row[j] = other if better else row[j]
        row_starts[j] = before_starts[j - 1] if better else row_starts[j]


@njit(cache=True)
def distinct_hits(
    cost: np.ndarray, start: np.ndarray, document_starts: np.ndarray, threshold: float, most: int
) -> np.ndarray:
    """Return the cheapest hits of a distance function: document, first and last column, int64 (H, 3).

    Hits end in local minima of the cost. They are processed in order of cost (the earlier on ties); a hit of which more
    than half is covered by earlier hits is dropped.

    Parameters
    ----------
    cost, start, document_starts : as in `graded_distances`
    threshold : cost of the cheapest rejected hit
    most : largest number of hits
    """
    ends, owners = np.empty(cost.shape[0], np.int64), np.empty(cost.shape[0], np.int64)
    count = 0
    for d in range(document_starts.size - 1):
        for end in minima_below(cost[document_starts[d] : document_starts[d + 1]], threshold):
            ends[count], owners[count] = document_starts[d] + end, d
            count += 1
    ends = ends[:count]
    hits = np.empty((min(most, ends.size), 3), np.int64)
    taken = np.zeros(cost.shape[0], np.bool_)
    found = 0
    for k in np.argsort(cost[ends], kind="mergesort"):
        if found == hits.shape[0]:
            break
        begin = document_starts[owners[k]]
        first, last = begin + start[ends[k]], ends[k]
        covered = 0
        for j in range(first, last + 1):
            covered += taken[j]
        if 2 * covered > last + 1 - first:
            continue
        taken[first : last + 1] = True
        hits[found, 0], hits[found, 1], hits[found, 2] = owners[k], first - begin, last - begin
        found += 1
    return hits[:found]


@njit(cache=True)
def nearest_example(
    examples: np.ndarray,
    example_starts: np.ndarray,
    weights: np.ndarray,
    chosen: np.ndarray,
    columns: np.ndarray,
    document_starts: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the smallest distance of several examples in each column of many documents.

    Parameters
    ----------
    examples : float32 (S, F), columns of all examples, one after the other
    example_starts : int64 (E + 1,), first column of each example, ending with S
    weights : float32 (E, F)
    chosen : int64 (C,), examples to compare; the first of equals is returned
    columns, document_starts : as for `graded_distances`

    Returns
    -------
    cost : float32 (M,)
    start : int32 (M,), first column of the alignment, counted within the document
    example : int32 (M,), example of the alignment
    """
    cost = np.full(columns.shape[0], np.inf, np.float32)
    start = np.full(columns.shape[0], -1, np.int32)
    example = np.full(columns.shape[0], -1, np.int32)
    for e in chosen:
        other, origin = graded_distances(
            examples[example_starts[e] : example_starts[e + 1]], weights[e], columns, document_starts
        )
        for j in range(cost.shape[0]):
            if other[j] < cost[j]:
                cost[j], start[j], example[j] = other[j], origin[j], e
    return cost, start, example


@njit(cache=True)
def differences(
    examples: np.ndarray, example_starts: np.ndarray, weights: np.ndarray, columns: np.ndarray, hits: np.ndarray
) -> np.ndarray:
    """Return the differences of an example and its match by feature along the best alignment: float32 (H, F).

    Steps as in `graded_distances`; means over the example's columns of the absolute differences.

    Parameters
    ----------
    examples, example_starts, weights : as for `nearest_example`
    columns : int8 (M, F), all documents
    hits : int64 (H, 3), example, first and last column of its match
    """
    features = examples.shape[1]
    found = np.zeros((hits.shape[0], features), np.float32)
    for h in range(hits.shape[0]):
        e, first, last = hits[h]
        template = examples[example_starts[e] : example_starts[e + 1]]
        n, length = template.shape[0], last + 1 - first
        cells = np.empty((n, length))
        for i in range(n):
            for j in range(length):
                cell = 0.0
                for f in range(features):
                    cell += weights[e, f] * abs(template[i, f] - np.float32(columns[first + j, f]))
                cells[i, j] = cell
        for i, j, count in best_alignment(cells, 0)[1]:
            for f in range(features):
                found[h, f] += count * abs(template[i, f] - np.float32(columns[first + j, f])) / n
    return found
