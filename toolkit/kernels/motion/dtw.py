"""Compiled dynamic time warping: whole sequences for motion templates, subsequences of a document for annotation."""

from __future__ import annotations

import numpy as np
from numba import njit

GAP: int = 2
"""Longest step of an alignment in columns, and number of excluded columns before a document and between its pieces."""


@njit(cache=True)
def align(
    reference: np.ndarray, reference_weights: np.ndarray, warped: np.ndarray, warped_weights: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return the cheapest path through two weighted sequences with steps (1,1), (1,0), (0,1).

    A cell costs the mean absolute difference of its columns times the mean of their weights.

    Parameters
    ----------
    reference, warped : float64 (F, N) and (F, M), columns over time
    reference_weights, warped_weights : float64 (N,) and (M,)

    Returns
    -------
    cost : sum over the cells of the path
    path : int64 (S, 2), columns of reference and warped from first to last; on ties the diagonal wins, then the step
        that advances the warped sequence alone
    """
    features, n = reference.shape
    m = warped.shape[1]
    total = np.zeros((n, m))
    for i in range(n):
        row = total[i]
        for f in range(features):
            value = reference[f, i]
            for j in range(m):
                row[j] += abs(value - warped[f, j])
        for j in range(m):
            row[j] *= 0.5 * (reference_weights[i] + warped_weights[j]) / features
    for j in range(1, m):
        total[0, j] += total[0, j - 1]
    for i in range(1, n):
        total[i, 0] += total[i - 1, 0]
        for j in range(1, m):
            total[i, j] += min(total[i - 1, j - 1], total[i, j - 1], total[i - 1, j])

    path = np.empty((n + m - 1, 2), dtype=np.int64)
    i, j, k = n - 1, m - 1, n + m - 2
    path[k, 0], path[k, 1] = i, j
    while i > 0 or j > 0:
        if i == 0:
            j -= 1
        elif j == 0:
            i -= 1
        else:
            diagonal, along, down = total[i - 1, j - 1], total[i, j - 1], total[i - 1, j]
            if diagonal <= along and diagonal <= down:
                i -= 1
                j -= 1
            elif along <= down:
                j -= 1
            else:
                i -= 1
        k -= 1
        path[k, 0], path[k, 1] = i, j
    return total[n - 1, m - 1], path[k:]


@njit(cache=True)
def warp(path: np.ndarray, warped: np.ndarray, weights: np.ndarray, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Resample a sequence (F, M) with weights (M,) to the time axis of a reference of `length` columns.

    A reference column receives the weighted mean of the columns matched with it and the sum of their weights. If one
    column was matched with r reference columns, the weights of these are divided by r.

    Returns
    -------
    values, new_weights : float64 (F, length) and (length,)
    """
    features = warped.shape[0]
    values = np.zeros((features, length))
    new_weights = np.zeros(length)
    partners = np.zeros(warped.shape[1])
    for k in range(path.shape[0]):
        i, j = path[k, 0], path[k, 1]
        partners[j] += 1.0
        new_weights[i] += weights[j]
        for f in range(features):
            values[f, i] += weights[j] * warped[f, j]
    for i in range(length):
        for f in range(features):
            values[f, i] /= new_weights[i]
    for k in range(path.shape[0]):
        new_weights[path[k, 0]] /= partners[path[k, 1]]
    return values, new_weights


@njit(cache=True)
def ones(word: np.uint64) -> np.uint64:
    """Number of set bits of a 64-bit word."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (word * np.uint64(0x0101010101010101)) >> np.uint64(56)


@njit(cache=True)
def distance_function(
    bits: np.ndarray, mask: np.ndarray, scale: np.ndarray, document: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the subsequence DTW of a quantised template with a document (thesis 5.2, Equations 5.2 and 5.3).

    Steps, template by document: (1,1) and (1,2) with weight 1, (2,1) with weight 2 on the cell that it arrives at.

    Parameters
    ----------
    bits, mask : uint64 (N,), the template's columns as bit words: ones, and rows other than wildcards
    scale : float64 (N,), factor from the number of mismatching rows of a column to its cost
    document : uint64 (L,), the document's columns

    Returns
    -------
    cost : float64 (L,), cheapest alignment that ends in each frame, infinite if none does
    start : int64 (L,), first frame of that alignment, -1 if there is none
    """
    return _distances(bits, mask, scale, document, np.empty(0, np.int64))


@njit(cache=True)
def _distances(
    bits: np.ndarray, mask: np.ndarray, scale: np.ndarray, document: np.ndarray, closed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return `distance_function` of a document with excluded columns (C,)."""
    n, length = bits.shape[0], document.shape[0]
    costs = np.full((3, GAP + length), np.inf)  # padding columns before the document
    starts = np.full((3, GAP + length), -1, dtype=np.int64)
    for j in range(length):
        costs[0, GAP + j] = scale[0] * ones((document[j] ^ bits[0]) & mask[0])
        starts[0, GAP + j] = j
    _close(costs[0], starts[0], closed)
    for i in range(1, n):
        row, before, earlier = i % 3, (i - 1) % 3, (i - 2) % 3
        cost, far, near, over = costs[row, GAP:], costs[before], costs[before, 1:], costs[earlier, 1:]
        start, from_far, from_near, from_over = (
            starts[row, GAP:],
            starts[before],
            starts[before, 1:],
            starts[earlier, 1:],
        )
        for j in range(length):  # without branches, for vectorisation
            cell = scale[i] * ones((document[j] ^ bits[i]) & mask[i])
            origin_far, origin_near, origin_over = from_far[j], from_near[j], from_over[j]
            best = far[j] if far[j] < near[j] else near[j]
            origin = origin_far if far[j] < near[j] else origin_near
            skipped = over[j] + cell
            cost[j] = (skipped if skipped < best else best) + cell
            start[j] = origin_over if skipped < best else origin
        _close(costs[row], starts[row], closed)
    return costs[(n - 1) % 3, GAP:], starts[(n - 1) % 3, GAP:]


@njit(cache=True)
def _close(cost: np.ndarray, start: np.ndarray, closed: np.ndarray) -> None:
    """Exclude document columns (C,) from all alignments."""
    for j in closed:
        cost[GAP + j], start[GAP + j] = np.inf, -1


@njit(cache=True)
def best_alignment(cells: np.ndarray, least: int) -> tuple[float, np.ndarray]:
    """Return the cheapest subsequence alignment that ends in or after a document column.

    The steps are those of `distance_function`.

    Parameters
    ----------
    cells : float64 (N, L), cost of each template column with each document column
    least : first document column in which the alignment may end

    Returns
    -------
    cost : infinite if there is no alignment
    path : int64 (S, 3), template column, document column and weight of each cell, the last cell first
    """
    n, length = cells.shape
    total = np.full((n, length), np.inf)
    steps = np.zeros((n, length), dtype=np.int8)
    total[0] = cells[0]
    for i in range(1, n):
        for j in range(1, length):
            best, step = total[i - 1, j - 1], 1
            if j > 1 and total[i - 1, j - 2] < best:
                best, step = total[i - 1, j - 2], 2
            if i > 1 and total[i - 2, j - 1] + cells[i, j] < best:
                best, step = total[i - 2, j - 1] + cells[i, j], 3
            total[i, j], steps[i, j] = best + cells[i, j], step
    path = np.empty((n, 3), dtype=np.int64)
    count, i, j = 0, n - 1, least + np.argmin(total[n - 1, least:])
    cost = total[i, j]
    while np.isfinite(cost):
        step = steps[i, j]
        path[count] = i, j, 2 if step == 3 else 1
        count += 1
        if i == 0:
            break
        i, j = i - (2 if step == 3 else 1), j - (2 if step == 2 else 1)
    return cost, path[:count]


@njit(cache=True)
def minima_below(values: np.ndarray, threshold: float) -> np.ndarray:
    """Return the last frames, int64, of the plateaus (of at least one frame) below `threshold` and their neighbours."""
    found = np.empty(values.shape[0], dtype=np.int64)
    count, falling = 0, True
    for j in range(values.shape[0]):
        if j > 0 and values[j] != values[j - 1]:
            falling = values[j] < values[j - 1]
        if falling and values[j] < threshold and (j + 1 == values.shape[0] or values[j] < values[j + 1]):
            found[count] = j
            count += 1
    return found[:count]


@njit(cache=True)
def spread_hits(cost: np.ndarray, start: np.ndarray, threshold: float, overlap: float) -> np.ndarray:
    """Return the modified distance function (thesis 5.2): each hit's cost over all frames of its alignment.

    Hits end in local minima below the threshold, at a plateau's last frame, and are processed in order of cost (the
    earlier on ties). Each sets its cost in the unset frames of its alignment.

    Parameters
    ----------
    cost, start : float64 and int64 (L,), from `distance_function`
    threshold : costs at or above it are no hits
    overlap : largest fraction of a hit that may already be set; the thesis has 1

    Returns
    -------
    float64 (L,), infinite outside all hits
    """
    modified = np.full(cost.shape[0], np.inf)
    candidates = minima_below(cost, threshold)
    for end in candidates[np.argsort(cost[candidates], kind="mergesort")]:
        covered = 0
        for frame in range(start[end], end + 1):
            covered += modified[frame] < np.inf
        if covered > overlap * (end + 1 - start[end]):
            continue
        for frame in range(start[end], end + 1):
            if modified[frame] == np.inf:
                modified[frame] = cost[end]
    return modified


@njit(cache=True)
def search_pieces(
    bits: np.ndarray,
    mask: np.ndarray,
    scale: np.ndarray,
    document: np.ndarray,
    pieces: np.ndarray,
    threshold: float,
    overlap: float,
    modified: np.ndarray,
) -> None:
    """Lower `modified` (L,) to the modified distance function of a template on pieces of a document.

    The pieces are concatenated, because one long sequence takes half the time of many short ones.

    Parameters
    ----------
    bits, mask, scale, document : as for `distance_function`
    pieces : int64 (P, 2), first frame and the one after the last, within the document
    threshold, overlap : as for `spread_hits`
    modified : float64 (L,), changed in place
    """
    longer = np.maximum(pieces[:, 1] - pieces[:, 0], 0) + GAP
    edges = np.concatenate((np.zeros(1, np.int64), np.cumsum(longer)))
    joined = np.zeros(edges[-1], dtype=document.dtype)
    closed = np.empty((pieces.shape[0], GAP), dtype=np.int64)
    for p in range(pieces.shape[0]):
        joined[edges[p] : edges[p + 1] - GAP] = document[pieces[p, 0] : max(pieces[p])]
        closed[p] = np.arange(edges[p + 1] - GAP, edges[p + 1])
    cost, start = _distances(bits, mask, scale, joined, closed.ravel())
    for p in range(pieces.shape[0]):
        own = slice(edges[p], edges[p + 1] - GAP)
        hits = spread_hits(cost[own], start[own] - edges[p], threshold, overlap)
        for k in range(hits.shape[0]):
            modified[pieces[p, 0] + k] = min(modified[pieces[p, 0] + k], hits[k])


@njit(cache=True)
def widen_runs(decided: np.ndarray, distances: np.ndarray, visible: float) -> np.ndarray:
    """Widen each run of a class while its modified distance does not rise away from the run (thesis 5.2).

    Parameters
    ----------
    decided : int64 (L,), class per frame, -1 for none
    distances : float64 (P, L), modified distance functions
    visible : smallest fraction of a widened run that is decided for its class; other runs are dropped

    Returns
    -------
    bool (P, L): labels of each frame, several if widened runs overlap
    """
    classes, length = distances.shape
    frames = np.zeros((classes, length), dtype=np.bool_)
    start = 0
    while start < length:
        row, stop = decided[start], start + 1
        while stop < length and decided[stop] == row:
            stop += 1
        if row >= 0:
            first, last = start, stop - 1
            while first > 0 and distances[row, first - 1] <= distances[row, first]:
                first -= 1
            while last + 1 < length and distances[row, last + 1] <= distances[row, last]:
                last += 1
            seen = 0
            for frame in range(first, last + 1):
                seen += decided[frame] == row
            if seen >= visible * (last + 1 - first):
                frames[row, first : last + 1] = True
        start = stop
    return frames
