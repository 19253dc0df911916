"""Summits of a function on the nodes of a graph by its component tree (max-tree), with dynamics and areas, compiled.

A component of the nodes at or above a level is a branch; branches join as the level falls. Where two meet, the one with
the lower summit ends: the height of its summit above that level is its *dynamics*, its number of nodes its *area*. On a
geodesic map the summits are the extremities of a body (Lopez-Mendez 2011, 2.2).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels.image.components import root_of


@njit(cache=True)
def summits(
    values: np.ndarray,
    order: np.ndarray,
    neighbours: np.ndarray,
    more: np.ndarray,
    sizes: np.ndarray,
    nodes: np.ndarray,
    dynamics: np.ndarray,
    areas: np.ndarray,
) -> int:
    """Find the summits of `values` (N,) with their dynamics and areas; returns their number.

    `order` holds the nodes that take part, by falling value (equal ones by rising node). Edges stand in the table
    `neighbours` (R, D) with its further rows `more` (R,), as in `geodesic.extrema`; those between nodes that take no
    part are ignored. `sizes` (N,) is the area of each node. Fills `nodes`, `dynamics`, `areas` (at least one place for
    each regional maximum) in the order in which the summits end; of equally high ones the one with the lower node ends
    last. A summit that never meets a higher one stands above the lowest value that its component reaches, and has all
    of its area.
    """
    # Of the component of a root: its highest node, its area, and that of the highest node's branch above its level.
    roots, highest = np.full(values.shape[0], -1, dtype=np.int64), np.empty(values.shape[0], dtype=np.int64)
    area, above = np.zeros(values.shape[0]), np.zeros(values.shape[0])
    found = 0
    for node in order:
        roots[node], highest[node], area[node] = node, node, sizes[node]
        row = np.int64(node)
        while row >= 0:
            for other in neighbours[row]:
                branch = root_of(roots, other) if roots[other] >= 0 else node
                if branch == node:
                    continue
                summit, ended = highest[branch], above[branch] if values[branch] == values[node] else area[branch]
                if _is_higher(values, summit, highest[node]):
                    summit, highest[node] = highest[node], summit
                    ended, above[node] = above[node], ended
                if values[summit] > values[node]:
                    nodes[found], dynamics[found], areas[found] = summit, values[summit] - values[node], ended
                    found += 1
                area[node] += area[branch]
                roots[branch] = node
            row = np.int64(more[row])
    for node in order:
        if roots[node] == node:
            nodes[found], dynamics[found], areas[found] = (
                highest[node],
                values[highest[node]] - values[node],
                area[node],
            )
            found += 1
    return found


@njit(cache=True)
def _is_higher(values: np.ndarray, first: int, second: int) -> bool:
    """Return whether the first of two nodes is the higher one, of equally high ones the lower node."""
    return values[first] > values[second] or (values[first] == values[second] and first < second)
