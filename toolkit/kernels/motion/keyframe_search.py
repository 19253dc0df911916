"""Compiled keyframe-based search (thesis, Section 3.5).

Frames are counted from 0 through all documents; a segment [start, end] includes its end.
"""

from __future__ import annotations

import numpy as np
from numba import njit

UNBOUNDED: int = 1 << 40
"""Largest admissible distance in frames of two keyframes without an upper bound."""


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

    The segments of frames that match keyframe k are `starts[offsets[k] : offsets[k + 1]]` with the same part of `ends`;
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
