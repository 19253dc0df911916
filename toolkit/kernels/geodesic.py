"""Graph of a point cloud and its geodesic extrema, compiled (Baak 2013, 5.4.2 and Algorithm 1).

Lengths are whole multiples of `UNIT`. Sums of them are exact, so a shortest distance is the same number on every machine and
in whatever order the paths are tried, and ties are true ties.
"""

from __future__ import annotations

import numpy as np
from numba import njit

UNIT = 2.0**-20
"""Metres per unit of length (about a micrometre)."""
UNREACHED = np.iinfo(np.int32).max
"""Distance of a node to which no path leads."""
CHUNK = 16
"""Consecutive members of a component that share one bounding box in `bridge_components`."""


@njit(cache=True)
def in_units(dx: float, dy: float, dz: float) -> int:
    """Euclidean length of a difference in metres, rounded to units, at least one."""
    return max(1, int(np.sqrt(dx * dx + dy * dy + dz * dz) / UNIT + 0.5))


@njit(cache=True)
def grid_edges(
    points: np.ndarray, pixels: np.ndarray, index: np.ndarray, threshold: int, ends: np.ndarray, lengths: np.ndarray
) -> int:
    """Edges between neighbours in the 8-neighbourhood that are shorter than `threshold` units, each pair measured once.

    `points` (N, 3) metres, `pixels` (N,) rising flat indices into `index` (H, W), which names the node of a pixel or -1.
    Fills `ends` (E, 2), the lower node first, and `lengths` (E,), E up to 4 N; returns how many.
    """
    height, width = index.shape
    count = 0
    for node in range(points.shape[0]):
        v = pixels[node] // width
        u = pixels[node] - v * width
        x, y, z = points[node, 0], points[node, 1], points[node, 2]
        for side in range(4):  # right, lower left, below, lower right: the others are seen from the other end
            row = v if side == 0 else v + 1
            column = u + 1 if side == 0 else u + side - 2
            if row == height or column < 0 or column == width:
                continue
            other = index[row, column]
            if other < 0:
                continue
            length = in_units(points[other, 0] - x, points[other, 1] - y, points[other, 2] - z)
            if length < threshold:
                ends[count, 0] = node
                ends[count, 1] = other
                lengths[count] = length
                count += 1
    return count


@njit(cache=True)
def components(ends: np.ndarray, roots: np.ndarray) -> None:
    """Union-find over edges `ends` (E, 2): fills `roots` (N,) with the lowest node of each node's component."""
    for node in range(roots.shape[0]):
        roots[node] = node
    for e in range(ends.shape[0]):
        a = ends[e, 0]
        b = ends[e, 1]
        while roots[a] != roots[b]:  # climb from the higher parent until both meet, hanging the higher below the lower
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
def _boxes(points: np.ndarray, members: np.ndarray, boxes: np.ndarray) -> int:
    """Bounding boxes (lowest and highest corner, 6 numbers) of every `CHUNK` consecutive members; returns how many."""
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
    """Squared distance of two boxes."""
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
    """Closest pair between two sets of nodes and its squared distance; ties to the lowest first, then second node.

    Chunks whose boxes are farther apart than the closest pair so far are skipped, so nodes that lie near each other
    should be near each other in the lists; the answer is exact in any order.
    """
    best = np.inf
    for i in range(0, members_a.shape[0], CHUNK):  # one pair of nodes per pair of chunks bounds the search from above
        for j in range(0, members_b.shape[0], CHUNK):
            best = min(best, _squared(points, members_a[i], members_b[j]))
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
    count: int,
) -> int:
    """Join every component of at least `smallest` nodes to the largest by their closest pair, if under `limit` metres.

    Of equally large components the one with the lowest node counts as the largest. Appends to the `count` edges in `ends` and
    `lengths` and returns the new number of edges. `members`, `sizes`, `starts` (N,) and `boxes` (2 N / CHUNK + 2, 6) are
    working memory.
    """
    total = roots.shape[0]
    sizes[:total] = 0
    for node in range(total):
        sizes[roots[node]] += 1
    largest = 0
    for node in range(total):
        if sizes[node] > sizes[largest]:
            largest = node
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
    trunk_count = _boxes(points, trunk, boxes)
    trunk_boxes = boxes[:trunk_count]
    for root in range(total):
        if root == largest or sizes[root] < max(smallest, 1):
            continue
        part = members[starts[root] - sizes[root] : starts[root]]
        part_boxes = boxes[trunk_count:]
        part_boxes = part_boxes[: _boxes(points, part, part_boxes)]
        a, b, squared = closest_pair(points, part, part_boxes, trunk, trunk_boxes)
        if squared < limit * limit:
            ends[count, 0] = a
            ends[count, 1] = b
            lengths[count] = max(1, int(np.sqrt(squared) / UNIT + 0.5))
            count += 1
    return count


@njit(cache=True)
def adjacency(
    ends: np.ndarray, edge_lengths: np.ndarray, offsets: np.ndarray, neighbours: np.ndarray, lengths: np.ndarray
) -> None:
    """Adjacency lists (Eq. 5.3): node n's edges are `neighbours` and `lengths` from `offsets[n]` to `offsets[n + 1]`.

    `ends` (E, 2) and `edge_lengths` (E,) name each edge once; `offsets` (N + 1,), the other two (2 E,) are filled.
    """
    nodes = offsets.shape[0] - 1
    offsets[:] = 0
    for e in range(ends.shape[0]):
        offsets[ends[e, 0]] += 1
        offsets[ends[e, 1]] += 1
    total = 0
    for node in range(nodes):
        total += offsets[node]
        offsets[node] = total
    offsets[nodes] = total
    for e in range(ends.shape[0] - 1, -1, -1):  # filled from the back, which leaves each offset at its list's first edge
        a, b, length = ends[e, 0], ends[e, 1], edge_lengths[e]
        offsets[a] -= 1
        neighbours[offsets[a]] = b
        lengths[offsets[a]] = length
        offsets[b] -= 1
        neighbours[offsets[b]] = a
        lengths[offsets[b]] = length


@njit(cache=True)
def _relax_from(
    start: int,
    offsets: np.ndarray,
    neighbours: np.ndarray,
    lengths: np.ndarray,
    shift: int,
    distances: np.ndarray,
    after: np.ndarray,
    before: np.ndarray,
    heads: np.ndarray,
    stamps: np.ndarray,
    stamp: int,
) -> int:
    """One pass (lines 6 to 13 of Algorithm 1) from `start`, whose distance is 0; returns the number of nodes visited.

    The queue is a ring of buckets, each 2**shift units wide and a doubly linked list. Where an edge is shorter than a bucket a
    node may be taken out again after a correction; it counts as one visit.
    """
    mask = heads.shape[0] - 1
    heads[0] = start
    after[start] = -1
    before[start] = -1
    waiting = 1
    visits = 0
    bucket = 0
    while waiting > 0:
        node = heads[bucket]
        if node < 0:
            bucket = (bucket + 1) & mask
            continue
        following = after[node]
        heads[bucket] = following
        if following >= 0:
            before[following] = -1
        before[node] = -2
        waiting -= 1
        if stamps[node] != stamp:
            stamps[node] = stamp
            visits += 1
        base = distances[node]
        for e in range(offsets[node], offsets[node + 1]):
            other = neighbours[e]
            length = base + lengths[e]
            old = distances[other]
            if length >= old:
                continue
            distances[other] = length
            slot = (length >> shift) & mask
            if before[other] != -2:
                if (old >> shift) & mask == slot:
                    continue
                following = after[other]
                preceding = before[other]
                if preceding >= 0:
                    after[preceding] = following
                else:
                    heads[(old >> shift) & mask] = following
                if following >= 0:
                    before[following] = preceding
                waiting -= 1
            head = heads[slot]
            after[other] = head
            before[other] = -1
            if head >= 0:
                before[head] = other
            heads[slot] = other
            waiting += 1
    return visits


@njit(cache=True)
def farthest(distances: np.ndarray) -> int:
    """Lowest node with the largest finite distance (line 14 of Algorithm 1); -1 if that distance is 0."""
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
    offsets: np.ndarray,
    neighbours: np.ndarray,
    lengths: np.ndarray,
    source: int,
    shift: int,
    distances: np.ndarray,
    from_source: np.ndarray,
    after: np.ndarray,
    before: np.ndarray,
    stamps: np.ndarray,
    heads: np.ndarray,
    nodes: np.ndarray,
    reach: np.ndarray,
    visited: np.ndarray,
) -> int:
    """Algorithm 1: fills `nodes`, `reach` (units) and `visited` (n,) and returns the number of extrema found.

    `from_source` (N,) receives the distances after the first pass. `distances`, `after`, `before`, `stamps` (N,) and `heads`
    (a power of two of buckets, more than the longest edge spans) are working memory. Fewer than n are found where no node is
    left at a positive distance.
    """
    distances[:] = UNREACHED
    before[:] = -2
    stamps[:] = -1
    heads[:] = -1
    start = source
    for i in range(nodes.shape[0]):
        distances[start] = 0
        visited[i] = _relax_from(
            start, offsets, neighbours, lengths, shift, distances, after, before, heads, stamps, i
        )
        if i == 0:
            from_source[:] = distances
        start = farthest(distances)
        if start < 0:
            return i
        nodes[i] = start
        reach[i] = distances[start]
    return nodes.shape[0]


@njit(cache=True)
def nearest_in_component(points: np.ndarray, roots: np.ndarray, root: int, centre: np.ndarray) -> int:
    """Lowest of the nodes of the component `root` that are nearest to `centre` (3,); -1 if it has none."""
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
