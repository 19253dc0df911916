"""Segmentation of a depth image into several people by geodesic distance, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

UNIT = 2.0**-16
"""Metres per unit of length; integer sums do not depend on their order."""
FAR = np.iinfo(np.int32).max


@njit(cache=True)
def _push(heap: np.ndarray, size: int, key: int) -> int:
    k = size
    while k > 0:
        parent = (k - 1) >> 1
        if heap[parent] <= key:
            break
        heap[k] = heap[parent]
        k = parent
    heap[k] = key
    return size + 1


@njit(cache=True)
def _pop(heap: np.ndarray, size: int) -> int:
    """Remove the smallest key; return the new size."""
    size -= 1
    key = heap[size]
    k = 0
    while True:
        child = 2 * k + 1
        if child >= size:
            break
        if child + 1 < size and heap[child + 1] < heap[child]:
            child += 1
        if heap[child] >= key:
            break
        heap[k] = heap[child]
        k = child
    heap[k] = key
    return size


@njit(cache=True)
def grow(
    points: np.ndarray,
    measured: np.ndarray,
    seeds: np.ndarray,
    axes: np.ndarray,
    reach: np.ndarray,
    limits: np.ndarray,
    steps: np.ndarray,
    longest: float,
    labels: np.ndarray,
    distances: np.ndarray,
) -> None:
    """Assign each pixel to the person with the shortest path over the surface from its seeds (Dijkstra).

    A step to one of 8 neighbours is as long as the points are apart, where the depth along z jumps by less than
    `steps[0] + steps[1] z^2`; up to a jump of `steps[2]` it counts `steps[3]` times as long; beyond it there is no
    step. A vertical difference counts `steps[4]` times as long: people are tall, and share a boundary that is upright.

    Parameters
    ----------
    points : float32 (H, W, 3), level frame, metres (y up)
    measured : float32 (H, W), depth along z, metres; 0 belongs to no person
    seeds : int32 (H, W), 1.. the people, 0 none
    axes : float64 (N, 3), the level frame's x, y, z of each person's head
    reach : float32 (H, W), metres horizontally from such an axis within which the pixel may belong to it
    limits : float64 (2,), metres upwards from the head and downwards from it
    steps : float64 (5,), see above
    longest : maximum path length from the head within a person, metres
    labels : int32 (H, W); becomes 1.., 0 = no person
    distances : int32 (H, W); becomes the path length in units, `FAR` for unreached pixels
    """
    height, width = measured.shape
    # A pixel is entered at most once by each of its 8 neighbours and once as a seed.
    heap = np.empty(9 * height * width + 1, dtype=np.int64)
    size = 0
    end = int(longest / UNIT)
    for v in range(height):
        for u in range(width):
            labels[v, u] = 0
            distances[v, u] = FAR
            if seeds[v, u] > 0 and measured[v, u] > 0:
                labels[v, u] = seeds[v, u]
                distances[v, u] = 0
                size = _push(heap, size, v * width + u)
    while size > 0:
        key = heap[0]
        size = _pop(heap, size)
        far, node = key >> 32, key & 0xFFFFFFFF
        v, u = node // width, node % width
        if far > distances[v, u]:
            continue
        who = labels[v, u] - 1
        z = measured[v, u]
        for dv in range(-1, 2):
            for du in range(-1, 2):
                vv, uu = v + dv, u + du
                if (dv == 0 and du == 0) or vv < 0 or uu < 0 or vv >= height or uu >= width or measured[vv, uu] == 0.0:
                    continue
                jump = abs(measured[vv, uu] - z)
                near = min(measured[vv, uu], z)
                factor = 1.0
                if jump > steps[0] + steps[1] * near * near:
                    if jump > steps[2]:
                        continue
                    factor = steps[3]
                dx = points[vv, uu, 0] - points[v, u, 0]
                dy = steps[4] * (points[vv, uu, 1] - points[v, u, 1])
                dz = points[vv, uu, 2] - points[v, u, 2]
                way = far + max(1, int(factor * np.sqrt(dx * dx + dy * dy + dz * dz) / UNIT))
                if way >= distances[vv, uu] or way > end:
                    continue
                ax, az = points[vv, uu, 0] - axes[who, 0], points[vv, uu, 2] - axes[who, 2]
                above = points[vv, uu, 1] - axes[who, 1]
                if ax * ax + az * az > reach[vv, uu] ** 2 or above > limits[0] or above < -limits[1]:
                    continue
                distances[vv, uu] = way
                labels[vv, uu] = who + 1
                size = _push(heap, size, (way << 32) | (vv * width + uu))


@njit(cache=True)
def mark_seeds(
    points: np.ndarray,
    foreground: np.ndarray,
    stayed: np.ndarray,
    places: np.ndarray,
    head: float,
    torso: float,
    seeds: np.ndarray,
) -> None:
    """Mark seed pixels of the people with heads at `places` (N, 3), level frame, metres, with 1, 2, ...

    A foreground pixel within `head` metres of a place is part of that head, and one of `stayed` int32 (H, W), whose it
    was before, part of that torso if it is within `torso` metres of the vertical through the place. Entries of `seeds`
    int32 (H, W) that are not 0 stay; of two people the first counts. `points` float32 (H, W, 3).
    """
    height, width = foreground.shape
    for v in range(height):
        for u in range(width):
            if not foreground[v, u] or seeds[v, u] != 0:
                continue
            for k in range(places.shape[0]):
                dx, dz = points[v, u, 0] - places[k, 0], points[v, u, 2] - places[k, 2]
                aside = dx * dx + dz * dz
                dy = points[v, u, 1] - places[k, 1]
                if aside + dy * dy < head * head or (stayed[v, u] == k + 1 and aside < torso * torso):
                    seeds[v, u] = k + 1
                    break


@njit(cache=True)
def refine_labels(
    depth: np.ndarray, coarse: np.ndarray, labels: np.ndarray, step: int, tolerance_mm: float, out: np.ndarray
) -> None:
    """Transfer labels of `depth[::step, ::step]` to full resolution.

    A pixel of `depth` (H, W), millimetres, takes the label of the coarse pixel around it whose depth `coarse` (h, w),
    millimetres, is nearest to its own, if that is within `tolerance_mm`; coarse pixels of no person (label 0) take
    part, so that the edge between a person and the room follows the depth. `out` uint8 (H, W).
    """
    height, width = depth.shape
    rows, columns = labels.shape
    for first in range(rows):
        last = min(first + 1, rows - 1)
        v0, v1 = first * step, min((first + 1) * step, height)
        for left in range(columns):
            right = min(left + 1, columns - 1)
            u0, u1 = left * step, min((left + 1) * step, width)
            out[v0:v1, u0:u1] = 0
            # most pixels have no person around them
            if labels[first, left] == labels[first, right] == labels[last, left] == labels[last, right] == 0:
                continue
            for v in range(v0, v1):
                for u in range(u0, u1):
                    z = np.int64(depth[v, u])
                    best = np.int64(tolerance_mm) + 1 if z > 0 else 0
                    for r in range(first, last + 1):
                        for c in range(left, right + 1):
                            m = np.int64(coarse[r, c])
                            off = abs(m - z)
                            if m > 0 and off < best:
                                best = off
                                out[v, u] = labels[r, c]


def take_label(depth: np.ndarray, labels: np.ndarray, label: int, padded: np.ndarray, box: np.ndarray) -> int:
    """Copy the pixels of `depth` (H, W) with this label into `padded` (H + 2, W + 2), 0 elsewhere.

    `box` becomes their window (v0, v1, u0, u1, ends excluded, padded indices). Returns how many there are.
    """
    own = labels == label
    padded[:] = 0
    padded[1:-1, 1:-1][own] = depth[own]
    rows, columns = np.flatnonzero(own.any(axis=1)), np.flatnonzero(own.any(axis=0))
    if len(rows):
        box[:] = rows[0] + 1, rows[-1] + 2, columns[0] + 1, columns[-1] + 2
    return int(np.count_nonzero(own))


def mark_near(points: np.ndarray, place: np.ndarray, radius: float, near: np.ndarray) -> None:
    """Mark in `near` (H, W) the pixels whose `points` (H, W, 3) are nearer than `radius` to `place` (3,), metres."""
    near[:] = ((points - place) ** 2).sum(axis=2) < radius * radius
