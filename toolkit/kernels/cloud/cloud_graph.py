"""Graph over the pixels of a point cloud, its components and the bridges between them, compiled (Baak 2013, 5.4.2).

Lengths are integer multiples of `UNIT`. Their sums are exact, so a shortest distance does not depend on the machine or
on the order of the paths, and ties are exact.
"""

from __future__ import annotations

import numpy as np
from numba import njit

UNIT = 2.0**-20
"""Metres per unit of length (about a micrometre)."""
CHUNK = 16
"""Number of consecutive members of a component with one common bounding box in `bridge_components`."""


@njit(cache=True)
def in_units(dx: float, dy: float, dz: float) -> int:
    """Return the Euclidean length of a difference in metres, rounded to units, at least one."""
    return max(1, int(np.sqrt(dx * dx + dy * dy + dz * dz) / UNIT + 0.5))


@njit(cache=True)
def grid_table(
    points: np.ndarray,
    pixels: np.ndarray,
    index: np.ndarray,
    threshold: int,
    neighbours: np.ndarray,
    lengths: np.ndarray,
) -> None:
    """Compute edges shorter than `threshold` units between neighbours in the 8-neighbourhood, each pair once.

    `points` (N, 3) metres; `pixels` (N,) rising flat indices into `index` (H, W), which names the node of a pixel or
    -1. Fills the rows of the nodes in the table `neighbours` and `lengths` (at least N, 8), a column per direction, a
    free place with the node itself and length 0.
    """
    height, width = index.shape
    total = points.shape[0]
    for node in range(total):
        for side in range(8):
            neighbours[node, side] = node
            lengths[node, side] = 0
    for node in range(total):
        v = pixels[node] // width
        u = pixels[node] - v * width
        x, y, z = points[node, 0], points[node, 1], points[node, 2]
        for side in range(4):  # right, lower left, below, lower right; the opposite edges are copied from the other end
            row = v if side == 0 else v + 1
            column = u + 1 if side == 0 else u + side - 2
            if row == height or column < 0 or column == width:
                continue
            other = index[row, column]
            if other < 0:
                continue
            length = in_units(points[other, 0] - x, points[other, 1] - y, points[other, 2] - z)
            if length < threshold:
                neighbours[node, side] = other
                lengths[node, side] = length
                neighbours[other, 7 - side] = node
                lengths[other, 7 - side] = length


@njit(cache=True)
def components(neighbours: np.ndarray, roots: np.ndarray) -> None:
    """Label components by union-find over the first N rows of a table `neighbours` (R, D): fills `roots` (N,) with the
    lowest node of each node's component.

    Rem's algorithm: both ends move towards their roots in turn, and the higher branch is attached below the lower.
    """
    for node in range(roots.shape[0]):
        roots[node] = node
    for node in range(roots.shape[0]):
        for side in range(neighbours.shape[1]):
            a, b = node, neighbours[node, side]
            if b <= a:
                continue
            while roots[a] != roots[b]:
                if roots[a] < roots[b]:
                    a, b = b, a
                parent = roots[a]
                roots[a] = roots[b]
                if parent == a:
                    break
                a = parent
    for node in range(roots.shape[0]):
        roots[node] = roots[roots[node]]


@njit(cache=True)
def bounding_boxes(points: np.ndarray, members: np.ndarray, boxes: np.ndarray) -> int:
    """Compute the bounding boxes (two corners, 6 numbers) of `CHUNK` consecutive members; return their number."""
    count = (members.shape[0] + CHUNK - 1) // CHUNK
    for c in range(count):
        for axis in range(3):
            low = high = np.float64(points[members[c * CHUNK], axis])
            for i in range(c * CHUNK + 1, min((c + 1) * CHUNK, members.shape[0])):
                value = np.float64(points[members[i], axis])
                low = min(low, value)
                high = max(high, value)
            boxes[c, axis] = low
            boxes[c, 3 + axis] = high
    return count


@njit(cache=True)
def _gap(a: np.ndarray, b: np.ndarray) -> float:
    """Return the squared distance of two boxes."""
    total = 0.0
    for axis in range(3):
        gap = max(0.0, a[axis] - b[3 + axis], b[axis] - a[3 + axis])
        total += gap * gap
    return total


@njit(cache=True)
def _squared(points: np.ndarray, a: int, b: int) -> float:
    dx = np.float64(points[a, 0]) - np.float64(points[b, 0])
    dy = np.float64(points[a, 1]) - np.float64(points[b, 1])
    dz = np.float64(points[a, 2]) - np.float64(points[b, 2])
    return dx * dx + dy * dy + dz * dz


@njit(cache=True)
def closest_pair(
    points: np.ndarray,
    members_a: np.ndarray,
    boxes_a: np.ndarray,
    members_b: np.ndarray,
    boxes_b: np.ndarray,
) -> tuple[int, int, float]:
    """Return the closest pair of two sets of nodes and its squared distance; ties go to the lowest nodes.

    Chunks whose boxes are farther apart than the closest pair so far are skipped. The result is exact for any order; it
    is fast if nearby nodes are close in the lists.
    """
    best = np.inf
    for i in range(0, members_a.shape[0], CHUNK):  # one pair of nodes per pair of chunks gives an upper bound
        for j in range(0, members_b.shape[0], CHUNK):
            best = min(best, _squared(points, np.int64(members_a[i]), np.int64(members_b[j])))
    node_a = node_b = np.int64(points.shape[0])
    for i in range(boxes_a.shape[0]):
        for j in range(boxes_b.shape[0]):
            if _gap(boxes_a[i], boxes_b[j]) > best:
                continue
            for s in range(i * CHUNK, min((i + 1) * CHUNK, members_a.shape[0])):
                a = np.int64(members_a[s])
                for t in range(j * CHUNK, min((j + 1) * CHUNK, members_b.shape[0])):
                    b = np.int64(members_b[t])
                    squared = _squared(points, a, b)
                    if squared < best or (squared == best and (a < node_a or (a == node_a and b < node_b))):
                        best = squared
                        node_a = a
                        node_b = b
    return node_a, node_b, best


@njit(cache=True)
def bridge_components(
    points: np.ndarray,
    roots: np.ndarray,
    smallest: int,
    limit: float,
    members: np.ndarray,
    sizes: np.ndarray,
    starts: np.ndarray,
    boxes: np.ndarray,
    ends: np.ndarray,
    lengths: np.ndarray,
) -> int:
    """Join each component of at least `smallest` nodes to the largest by their closest pair, if under `limit` metres.

    Of equally large components the one with the lowest node counts as the largest. Fills `ends` (N, 2), the node in the
    largest component second, and `lengths` (N,); returns the number of bridges. `members`, `sizes`, `starts` (N,) and
    `boxes` (2 N / CHUNK + 2, 6) are working memory.
    """
    total = roots.shape[0]
    sizes[:total] = 0
    for node in range(total):
        sizes[roots[node]] += 1
    largest = 0
    for node in range(total):
        if sizes[node] > sizes[largest]:
            largest = node
    count = 0
    if sizes[largest] == total:
        return count
    position = 0
    for node in range(total):  # a root precedes the other members of its component
        if sizes[node] > 0:
            starts[node] = position
            position += sizes[node]
        root = roots[node]
        members[starts[root]] = node
        starts[root] += 1
    trunk = members[starts[largest] - sizes[largest] : starts[largest]]
    trunk_count = bounding_boxes(points, trunk, boxes)
    trunk_boxes = boxes[:trunk_count]
    for root in range(total):
        if root == largest or sizes[root] < max(smallest, 1):
            continue
        part = members[starts[root] - sizes[root] : starts[root]]
        part_boxes = boxes[trunk_count:]
        part_boxes = part_boxes[: bounding_boxes(points, part, part_boxes)]
        a, b, squared = closest_pair(points, part, part_boxes, trunk, trunk_boxes)
        if squared < limit * limit:
            ends[count, 0] = a
            ends[count, 1] = b
            lengths[count] = max(1, int(np.sqrt(squared) / UNIT + 0.5))
            count += 1
    return count


@njit(cache=True)
def add_bridges(
    ends: np.ndarray,
    bridge_lengths: np.ndarray,
    neighbours: np.ndarray,
    lengths: np.ndarray,
    more: np.ndarray,
    nodes: int,
) -> int:
    """Enter bridges (B, 2) with their lengths (B,) into the table of edges; returns the number of rows in use.

    Rows 0 to `nodes` - 1 belong to the nodes. A bridge takes a free place in its node's row, or in a further row, named
    by `more`. The table must have 2 B spare rows.
    """
    width = neighbours.shape[1]
    rows = nodes
    more[:nodes] = -1
    for e in range(ends.shape[0]):
        for end in range(2):
            row = np.int64(ends[e, end])
            place = 0
            while place == width or lengths[row, place] != 0:
                if place < width:
                    place += 1
                elif more[row] >= 0:
                    row = np.int64(more[row])
                    place = 0
                else:
                    more[row] = rows
                    row = rows
                    place = 0
                    more[row] = -1
                    neighbours[row] = ends[e, end]
                    lengths[row] = 0
                    rows += 1
            neighbours[row, place] = ends[e, 1 - end]
            lengths[row, place] = bridge_lengths[e]
    return rows
