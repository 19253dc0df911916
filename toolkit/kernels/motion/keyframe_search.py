"""Compiled inverted keyframe lists and keyframe-based search (thesis, Sections 3.3 to 3.5).

A feature vector is an unsigned integer, bit i being feature i of its set. A keyframe is a pair (mask, value); it
matches every vector v with `v & mask == value`. Frames are counted from 0 through all documents; a segment [start, end]
includes its end.
"""

from __future__ import annotations

import numpy as np
from numba import njit

UNBOUNDED: int = 1 << 40
"""Largest admissible distance in frames of two keyframes without an upper bound."""


@njit(cache=True)
def keyframe_list(
    codes: np.ndarray,
    list_offsets: np.ndarray,
    list_runs: np.ndarray,
    run_starts: np.ndarray,
    document_runs: np.ndarray,
    mask: int,
    value: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the inverted keyframe list of one keyframe, Eq. 3.4 and 3.5: maximal segments of matching frames.

    The inverted lists of the matching vectors `codes` (U,) are `list_runs[list_offsets[u] : list_offsets[u + 1]]`.
    Their runs are marked and read back in order; neighbours are merged within a document. The time is linear in the
    listed runs, plus one read per eight marks. Returns first and last frames (L,) of the segments.
    """
    ticks = np.zeros((run_starts.size + 7) // 8 * 8, np.uint8)
    listed = 0
    for u in range(codes.size):
        if (codes[u] & mask) == value:
            listed += list_offsets[u + 1] - list_offsets[u]
            for i in range(list_offsets[u], list_offsets[u + 1]):
                ticks[list_runs[i]] = 1
    starts = np.empty(listed, np.int64)
    ends = np.empty(listed, np.int64)
    count = 0
    document = 0
    previous = -2
    eights = ticks.view(np.uint64)
    for word in range(eights.size):
        if eights[word] == 0:
            continue
        for run in range(8 * word, 8 * word + 8):
            if ticks[run] == 0:
                continue
            while document_runs[document + 1] <= run:
                document += 1
            if run != previous + 1 or run == document_runs[document]:
                starts[count] = run_starts[run]
                count += 1
            ends[count - 1] = run_starts[run + 1] - 1
            previous = run
    return starts[:count], ends[:count]


@njit(cache=True)
def listed_runs(codes: np.ndarray, list_offsets: np.ndarray, mask: int, value: int) -> int:
    """Number of runs in the inverted lists of a keyframe."""
    count = 0
    for u in range(codes.size):
        if (codes[u] & mask) == value:
            count += list_offsets[u + 1] - list_offsets[u]
    return count


@njit(cache=True)
def windows_around(
    starts: np.ndarray, ends: np.ndarray, least: int, greatest: int, document_starts: np.ndarray
) -> tuple[np.ndarray, int]:
    """Return the frames at a distance of `least` to `greatest` from ordered segments, inside each one's document.

    Returns first and last frames of disjoint ordered windows, int64 (W, 2), and their number of frames.
    """
    windows = np.empty((starts.size, 2), np.int64)
    count = 0
    document = 0
    total = 0
    for i in range(starts.size):
        while document_starts[document + 1] <= starts[i]:
            document += 1
        first = max(starts[i] + least, document_starts[document])
        last = min(ends[i] + greatest, document_starts[document + 1] - 1)
        if last < first:
            continue
        if count > 0 and first <= windows[count - 1, 1]:
            total += last - windows[count - 1, 1]
            windows[count - 1, 1] = last
        else:
            total += last - first + 1
            windows[count, 0] = first
            windows[count, 1] = last
            count += 1
    return windows[:count].copy(), total


@njit(cache=True)
def keyframe_list_near(
    windows: np.ndarray, run_vectors: np.ndarray, run_starts: np.ndarray, mask: int, value: int, capacity: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the parts of the segments of `keyframe_list` in disjoint ordered `windows`, read from their runs.

    No window crosses a document's end. `capacity` is the number of frames in the windows. Returns first and last frames
    of the parts.
    """
    starts = np.empty(capacity, np.int64)
    ends = np.empty(capacity, np.int64)
    count = 0
    run = 0
    stride = 16  # runs that are skipped in one step towards the next window
    for i in range(windows.shape[0]):
        while run + stride < run_vectors.size and run_starts[run + stride] <= windows[i, 0]:
            run += stride
        while run_starts[run + 1] <= windows[i, 0]:
            run += 1
        open_part = False
        while run < run_vectors.size and run_starts[run] <= windows[i, 1]:
            if (run_vectors[run] & mask) == value:
                if not open_part:
                    starts[count] = max(run_starts[run], windows[i, 0])
                    count += 1
                ends[count - 1] = min(run_starts[run + 1] - 1, windows[i, 1])
                open_part = True
            else:
                open_part = False
            run += 1
        run -= 1
    return starts[:count], ends[:count]


@njit(cache=True)
def _first_frame(low: np.ndarray, high: np.ndarray, minimum: np.ndarray, maximum: np.ndarray) -> int:
    """Return the smallest frame of the first keyframe among the hits of the present match, by backtracking."""
    start = low[-1]
    end = high[-1]
    for k in range(low.size - 2, -1, -1):
        start = max(low[k], start - maximum[k])
        end = min(high[k], end - minimum[k])
    return start


@njit(cache=True)
def keyframe_search(
    starts: np.ndarray,
    ends: np.ndarray,
    offsets: np.ndarray,
    minimum: np.ndarray,
    maximum: np.ndarray,
    document_starts: np.ndarray,
) -> np.ndarray:
    """Return the union of the hit-relevant ranges of all matches (Algorithm 1), int64 (H, 2), first and last frame.

    The inverted keyframe list of keyframe k is `starts[offsets[k] : offsets[k + 1]]` with the same part of `ends`;
    `minimum` and `maximum` (K - 1,) are the admissible distances of neighbouring keyframes in frames. Ranges that share
    a frame are merged. The recursion of the thesis is a loop over `level` with one admissible range [first, last] per
    level.

    The pointers only move forwards, so some matches are not visited. They are irrelevant: for each there is an earlier
    path through segments that are nowhere later. The componentwise minimum of two hits is a hit, because the conditions
    on distances are differences, so the earlier path starts no later and ends no earlier. For the same reason ranges
    are found in order of their starts, and merging with the last one suffices.
    """
    keyframes = offsets.size - 1
    pointers = offsets[:-1].copy()
    first = np.empty(keyframes, np.int64)
    last = np.empty(keyframes, np.int64)
    low = np.empty(keyframes, np.int64)
    high = np.empty(keyframes, np.int64)
    incremented = np.empty(keyframes, np.bool_)
    ranges = np.empty((starts.size, 2), np.int64)
    count = 0
    document = 0
    for segment in range(offsets[0], offsets[1]):
        while document_starts[document + 1] <= starts[segment]:
            document += 1
        document_end = document_starts[document + 1] - 1
        first[0] = starts[segment]
        last[0] = ends[segment]
        pointers[0] = segment
        level = 0
        entered = True
        while level >= 0:
            if entered:
                while pointers[level] < offsets[level + 1] and ends[pointers[level]] < first[level]:
                    pointers[level] += 1
                incremented[level] = False
                entered = False
            if pointers[level] < offsets[level + 1] and starts[pointers[level]] <= last[level]:
                low[level] = max(starts[pointers[level]], first[level])
                high[level] = min(ends[pointers[level]], last[level])
                if level < keyframes - 1:
                    first[level + 1] = low[level] + minimum[level]
                    last[level + 1] = min(high[level] + maximum[level], document_end)
                    level += 1
                    entered = True
                    continue
                count = _join(ranges, count, _first_frame(low, high, minimum, maximum), high[level])
                pointers[level] += 1
                incremented[level] = True
            else:
                if incremented[level]:
                    pointers[level] -= 1
                level -= 1
                if level >= 0:
                    pointers[level] += 1
                    incremented[level] = True
    return ranges[:count].copy()


@njit(cache=True)
def _join(ranges: np.ndarray, count: int, start: int, end: int) -> int:
    """Add [start, end] to the `count` ranges found so far, merged with the last one if they share a frame."""
    if count > 0 and start <= ranges[count - 1, 1]:
        ranges[count - 1, 1] = max(ranges[count - 1, 1], end)
        return count
    ranges[count, 0] = start
    ranges[count, 1] = end
    return count + 1
