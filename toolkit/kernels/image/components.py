"""Connected surfaces and holes of depth images, compiled: label, measure, grow, keep."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def label_components(
    depth: np.ndarray, box: np.ndarray, jump_mm: float, jump_per_m2: float, labels: np.ndarray, parents: np.ndarray
) -> int:
    """Label the connected components of a padded depth image, in the window `box` (v0, v1, u0, u1, ends excluded).

    Two 4-neighbours belong together if their depths differ by at most `jump_mm + jump_per_m2 * z^2` (z in metres,
    the nearer one). Fills `labels` (as `depth`) with 1..n in the order of each component's first pixel, 0 where
    depth is 0, inside the window only. `parents` is a work array of at least the window's size / 2 + 2.

    Returns
    -------
    The number n of components.
    """
    v0, v1, u0, u1 = box[0], box[1], box[2], box[3]
    count = 0
    for v in range(v0, v1):
        for u in range(u0, u1):
            z = np.int64(depth[v, u])
            if z == 0:
                labels[v, u] = 0
                continue
            left = 0
            if u > u0 and labels[v, u - 1] > 0:
                other = np.int64(depth[v, u - 1])
                near = min(z, other) * 1e-3
                if abs(z - other) <= jump_mm + jump_per_m2 * near * near:
                    left = labels[v, u - 1]
            above = 0
            if v > v0 and labels[v - 1, u] > 0:
                other = np.int64(depth[v - 1, u])
                near = min(z, other) * 1e-3
                if abs(z - other) <= jump_mm + jump_per_m2 * near * near:
                    above = labels[v - 1, u]
            if left == 0 and above == 0:
                count += 1
                parents[count] = count
                labels[v, u] = count
            elif left == 0 or above == 0 or left == above:
                labels[v, u] = left if left > 0 else above
            else:
                a, b = root_of(parents, left), root_of(parents, above)
                low, high = min(a, b), max(a, b)
                parents[high] = low
                labels[v, u] = low
    # Roots are the lowest labels of their sets, so one pass in order renumbers them.
    n = 0
    for k in range(1, count + 1):
        if parents[k] == k:
            n += 1
            parents[k] = n
        else:
            parents[k] = parents[parents[k]]
    for v in range(v0, v1):
        for u in range(u0, u1):
            if labels[v, u] > 0:
                labels[v, u] = parents[labels[v, u]]
    return n


@njit(cache=True)
def root_of(parents: np.ndarray, k: int) -> int:
    """Return the root of `k` in a forest of `parents`, and shorten the path to it."""
    while parents[k] != k:
        parents[k] = parents[parents[k]]
        k = parents[k]
    return k


@njit(cache=True)
def component_extents(
    depth: np.ndarray,
    box: np.ndarray,
    labels: np.ndarray,
    count: int,
    intrinsics: np.ndarray,
    rotation: np.ndarray,
    sizes: np.ndarray,
    extents: np.ndarray,
) -> None:
    """Measure pixels, area and extent of every component in the window `box` of a padded image.

    Fills `sizes` (n, 2): pixels, and the area in m^2 that they cover at their depth, seen head on; and `extents` (n,
    3, 2): lowest and highest x, y, z after turning by `rotation` (3, 3), metres.
    """
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    sizes[:count] = 0.0
    for k in range(count):
        for a in range(3):
            extents[k, a, 0] = np.inf
            extents[k, a, 1] = -np.inf
    for v in range(box[0], box[1]):
        for u in range(box[2], box[3]):
            k = labels[v, u] - 1
            if k < 0:
                continue
            z = depth[v, u] * 1e-3
            x = (u - 1 - cx) * z / fx
            y = (v - 1 - cy) * z / fy
            sizes[k, 0] += 1.0
            sizes[k, 1] += z * z / (fx * fy)
            for a in range(3):
                p = rotation[a, 0] * x + rotation[a, 1] * y + rotation[a, 2] * z
                extents[k, a, 0] = min(extents[k, a, 0], p)
                extents[k, a, 1] = max(extents[k, a, 1], p)


def keep_labels(depth: np.ndarray, box: np.ndarray, labels: np.ndarray, kept: np.ndarray) -> None:
    """Set depth to 0 in the window `box` wherever the component's entry of `kept` (n + 1, bool, entry 0 unused) is
    False, and shrink the window to what is left (at least one pixel must be).
    """
    window = depth[box[0] : box[1], box[2] : box[3]]
    window[~kept[labels[box[0] : box[1], box[2] : box[3]]]] = 0
    rows, columns = np.flatnonzero(window.any(axis=1)), np.flatnonzero(window.any(axis=0))
    box[:] = box[0] + rows[0], box[0] + rows[-1] + 1, box[2] + columns[0], box[2] + columns[-1] + 1


def label_overlap(labels: np.ndarray, box: np.ndarray, count: int, depth: np.ndarray, overlap: np.ndarray) -> None:
    """Count in `overlap` (n,) the pixels of every component that are also set in `depth`, of the same padded shape."""
    window = slice(box[0], box[1]), slice(box[2], box[3])
    overlap[:count] = np.bincount(labels[window][depth[window] > 0], minlength=count + 1)[1:]


@njit(cache=True)
def hole_sizes(depth: np.ndarray, sizes: np.ndarray) -> None:
    """Fill `sizes`, int32 (H, W), with the pixels of the 4-connected hole that each pixel of depth 0 lies in; 0
    elsewhere.
    """
    height, width = depth.shape
    most = height * ((width + 1) // 2) + 1
    rows, firsts, ends = np.empty(most, dtype=np.int32), np.empty(most, dtype=np.int32), np.empty(most, dtype=np.int32)
    parents = np.empty(most, dtype=np.int64)
    count, above, here = 0, 0, 0  # runs of zeros in a row; the first ones of the row above and of this row
    for v in range(height):
        above, here = here, count
        u, k = 0, above
        while u < width:
            if depth[v, u] > 0:
                u += 1
                continue
            first = u
            while u < width and depth[v, u] == 0:
                u += 1
            rows[count], firsts[count], ends[count], parents[count] = v, first, u, count
            while k < here and ends[k] <= first:
                k += 1
            j = k
            while j < here and firsts[j] < u:
                a, b = root_of(parents, j), root_of(parents, count)
                parents[max(a, b)] = min(a, b)
                j += 1
            count += 1
    totals = np.zeros(count, dtype=np.int32)
    for k in range(count):
        totals[root_of(parents, k)] += ends[k] - firsts[k]
    sizes[:] = 0
    for k in range(count):
        sizes[rows[k], firsts[k] : ends[k]] = totals[root_of(parents, k)]
