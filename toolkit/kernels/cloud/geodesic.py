"""Geodesic extrema of a graph whose lengths are those of `cloud_graph`, compiled (Baak 2013, Algorithm 1)."""

from __future__ import annotations

import numpy as np
from numba import njit

UNREACHED = np.iinfo(np.int32).max
"""Distance of a node to which no path leads."""


@njit(cache=True)
def _relax_from(
    start: int,
    neighbours: np.ndarray,
    lengths: np.ndarray,
    more: np.ndarray,
    distances: np.ndarray,
    queue: np.ndarray,
    waiting: np.ndarray,
    stamps: np.ndarray,
    stamp: int,
) -> int:
    """Run one pass (Algorithm 1, lines 6 to 13) from `start`, whose distance is 0; return the number of visited nodes.

    Nodes are taken first come, first served, from a ring in which each waits at most once, and not nearest first: on
    the grid of a depth image hops and lengths grow alike, so that few nodes are corrected and taken again (which counts
    as one visit), and that costs far less than an order kept by length. The distances are the same.
    """
    places = queue.shape[0]
    queue[0] = start
    waiting[start] = True
    first, last = 0, 1 % places
    left = 1
    visits = 0
    while left > 0:
        # Indices of nodes are unsigned: Numba checks each signed index for values below 0, a fifth of the time.
        node = np.uint32(queue[first])
        first = first + 1 if first + 1 < places else 0
        left -= 1
        waiting[node] = False
        if stamps[node] != stamp:
            stamps[node] = stamp
            visits += 1
        base = distances[node]
        row = np.int64(node)
        while row >= 0:
            for side in range(neighbours.shape[1]):
                other = np.uint32(neighbours[row, side])
                length = base + lengths[row, side]
                if length >= distances[other]:
                    continue
                distances[other] = length
                if not waiting[other]:
                    waiting[other] = True
                    queue[last] = other
                    last = last + 1 if last + 1 < places else 0
                    left += 1
            row = np.int64(more[row])
    return visits


@njit(cache=True)
def farthest(distances: np.ndarray) -> int:
    """Return the lowest node with the largest finite distance (line 14 of Algorithm 1); -1 if that distance is 0."""
    largest = 0
    for node in range(distances.shape[0]):
        value = distances[node]
        largest = max(largest, value if value != UNREACHED else 0)
    if largest == 0:
        return -1
    for node in range(distances.shape[0]):
        if distances[node] == largest:
            return node
    return -1


@njit(cache=True)
def extrema(
    neighbours: np.ndarray,
    lengths: np.ndarray,
    more: np.ndarray,
    source: int,
    distances: np.ndarray,
    from_source: np.ndarray,
    queue: np.ndarray,
    waiting: np.ndarray,
    stamps: np.ndarray,
    nodes: np.ndarray,
    reach: np.ndarray,
    visited: np.ndarray,
) -> int:
    """Run Algorithm 1: fill `nodes`, `reach` (units) and `visited` (n,); return the number of extrema.

    Edges of a node stand in its row of the table `neighbours`, `lengths` (R, D), and in the rows that `more` (R,) names
    from there on, -1 ending the chain; a free place names its own node and length 0. `from_source` (N,) receives the
    distances after the first pass. `distances`, `queue`, `waiting` (bool) and `stamps` (N,) are working memory. Fewer
    than n are found where no node is left at a positive distance.
    """
    distances[:] = UNREACHED
    waiting[:] = False
    stamps[:] = -1
    start = source
    for i in range(nodes.shape[0]):
        distances[start] = 0
        visited[i] = _relax_from(start, neighbours, lengths, more, distances, queue, waiting, stamps, i)
        if i == 0:
            from_source[:] = distances
        start = farthest(distances)
        if start < 0:
            return i
        nodes[i] = start
        reach[i] = distances[start]
    return nodes.shape[0]


@njit(cache=True)
def path_to_source(
    neighbours: np.ndarray,
    lengths: np.ndarray,
    more: np.ndarray,
    from_source: np.ndarray,
    node: int,
    path: np.ndarray,
) -> int:
    """Fill `path` with a shortest path from `node` to the source of `from_source` (N,), and return its length.

    Of several shortest ways on, the first in the table is taken. `node` must be reached.
    """
    count = 1
    path[0] = node
    while from_source[node] > 0:
        row = np.int64(node)
        found = np.int64(-1)
        while row >= 0 and found < 0:
            for side in range(neighbours.shape[1]):
                length = lengths[row, side]
                other = np.int64(neighbours[row, side])
                # Lengths are whole numbers, so that the sum is exact.
                if length > 0 and from_source[other] == from_source[node] - length:
                    found = other
                    break
            row = np.int64(more[row])
        node = found
        path[count] = node
        count += 1
    return count


@njit(cache=True)
def nearest_in_component(points: np.ndarray, roots: np.ndarray, root: int, centre: np.ndarray) -> int:
    """Return the lowest of the nodes of the component `root` that are nearest to `centre` (3,); -1 if it has none."""
    best = np.inf
    nearest = -1
    for node in range(points.shape[0]):
        if roots[node] != root:
            continue
        dx, dy, dz = points[node, 0] - centre[0], points[node, 1] - centre[1], points[node, 2] - centre[2]
        squared = dx * dx + dy * dy + dz * dz
        if squared < best:
            best = squared
            nearest = node
    return nearest
