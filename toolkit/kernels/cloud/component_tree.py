"""Component tree (max-tree) of a function on the nodes of a graph with dynamics and areas, compiled.

A component of the nodes at or above a level is a branch; branches join as the level falls. Where two meet, the one with
the lower summit ends: the height of its summit above that level is its *dynamics*, its number of nodes its *area*. On a
geodesic map the summits are the extremities of a body (Lopez-Mendez 2011, 2.2).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels.image.components import root_of


@njit(cache=True)
def max_tree(
    values: np.ndarray, order: np.ndarray, neighbours: np.ndarray, more: np.ndarray, parents: np.ndarray
) -> None:
    """Fill `parents` (N,): the node that each node hangs below in the component tree of `values` (N,).

    `order` holds the nodes that take part, by falling value (equal ones by rising node). Edges stand in the table
    `neighbours` (R, D) with its further rows `more` (R,), as in `geodesic.extrema`; those between nodes that take no
    part are ignored. A branch is named by the last of its nodes in `order` at its level, the node at which its level
    ends; all other nodes of that level hang directly below it. A root hangs below itself, what takes no part
    below -1.
    """
    roots = np.full(values.shape[0], -1, dtype=np.int64)
    parents[:] = -1
    for node in order:
        roots[node] = node
        parents[node] = node
        row = np.int64(node)
        while row >= 0:
            for other in neighbours[row]:
                if other == node or roots[other] < 0:
                    continue
                branch = root_of(roots, other)
                if branch != node:
                    parents[branch] = node
                    roots[branch] = node
            row = np.int64(more[row])
    for i in range(order.shape[0] - 1, -1, -1):
        node = order[i]
        above = parents[node]
        if values[parents[above]] == values[above]:
            parents[node] = parents[above]


@njit(cache=True)
def summits(
    values: np.ndarray,
    order: np.ndarray,
    parents: np.ndarray,
    sizes: np.ndarray,
    nodes: np.ndarray,
    dynamics: np.ndarray,
    areas: np.ndarray,
) -> int:
    """Find the summits of a tree with their dynamics and areas; returns their number.

    `sizes` (N,) is the area of each node. Fills `nodes`, `dynamics`, `areas` (at least one place for each regional
    maximum) in the order in which the summits end; of equally high ones the lower node lives on. A summit that never
    meets a higher one stands above the lowest value that its component reaches, and has all of its area.
    """
    highest = np.full(values.shape[0], -1, dtype=np.int64)
    area = np.zeros(values.shape[0])
    for node in order:
        above = parents[node]
        level = above if values[above] == values[node] else node
        area[level] += sizes[node]
        highest[level] = _higher(values, highest[level], node)
    found = 0
    for node in order:
        above = parents[node]
        if values[above] != values[node]:
            area[above] += area[node]
            highest[above] = _higher(values, highest[above], highest[node])
    for node in order:
        above = parents[node]
        names_level = above == node or values[above] != values[node]
        if names_level and (above == node or highest[above] != highest[node]):
            nodes[found] = highest[node]
            dynamics[found] = values[highest[node]] - values[above]
            areas[found] = area[node]
            found += 1
    return found


@njit(cache=True)
def _higher(values: np.ndarray, first: int, second: int) -> int:
    """Return the higher of two nodes, the lower node of equally high ones; `first` may be -1."""
    if first < 0 or values[second] > values[first] or (values[second] == values[first] and second < first):
        return second
    return first
