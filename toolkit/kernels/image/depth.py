"""Depth images as plain arrays, compiled: back-projection, foreground, contour deletion, median, z-buffer."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def index_pixels(depth: np.ndarray, index: np.ndarray, pixels: np.ndarray) -> int:
    """Number the pixels with depth > 0 by rows; fills `index` (H, W), else -1, and `pixels`; return their count."""
    height, width = depth.shape
    n = 0
    for v in range(height):
        row = v * width
        for u in range(width):
            if depth[v, u] > 0:
                index[v, u] = n
                pixels[n] = row + u
                n += 1
            else:
                index[v, u] = -1
    return n


@njit(cache=True)
def back_project(
    depth: np.ndarray, pixels: np.ndarray, intrinsics: np.ndarray, rotation: np.ndarray, points: np.ndarray
) -> None:
    """Back-project the flat `pixels` and rotate them by `rotation` (3, 3); fills `points` (N, 3)."""
    width = depth.shape[1]
    flat = depth.reshape(-1)
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    for n in range(pixels.shape[0]):
        p = pixels[n]
        z = float(flat[p])
        x = (p % width - cx) * z / fx
        y = (p // width - cy) * z / fy
        for a in range(3):
            points[n, a] = rotation[a, 0] * x + rotation[a, 1] * y + rotation[a, 2] * z


@njit(cache=True)
def take_foreground(
    depth: np.ndarray,
    background: np.ndarray,
    margin_mm: float,
    margin_per_m2: float,
    near_mm: int,
    far_mm: int,
    padded: np.ndarray,
    box: np.ndarray,
) -> int:
    """Copy depth between `near_mm` and `far_mm` before the background to `padded` (H + 2, W + 2, zero border).

    A pixel is kept if the background is 0 (unknown) or farther by more than `margin_mm + margin_per_m2 * z^2` (z in
    metres of the background). `box` becomes the window (v0, v1, u0, u1, ends excluded) of the kept pixels, in padded
    indices.

    Returns
    -------
    The number of pixels kept.
    """
    height, width = depth.shape
    v_low, v_high, u_low, u_high = height, -1, width, -1
    total = 0
    for v in range(height):
        first, last = -1, -1
        for u in range(width):
            z = np.int64(depth[v, u])
            keep = near_mm <= z <= far_mm
            if keep and background[v, u] > 0:
                b = float(background[v, u])
                keep = b - z > margin_mm + margin_per_m2 * b * b * 1e-6
            if keep:
                padded[v + 1, u + 1] = depth[v, u]
                if first < 0:
                    first = u
                last = u
                total += 1
            else:
                padded[v + 1, u + 1] = 0
        if first >= 0:
            v_low, v_high = min(v_low, v), v
            u_low, u_high = min(u_low, first), max(u_high, last)
    box[0], box[1], box[2], box[3] = v_low + 1, v_high + 2, u_low + 1, u_high + 2
    return total


@njit(cache=True)
def delete_silhouette(padded: np.ndarray, box: np.ndarray, out: np.ndarray) -> None:
    """Copy the window `box` of `padded` to `out` (same shape) without the contour of what is set (Baak 2013, 5.3.1).

    A pixel is on the contour if one of its 4 neighbours is 0; its depth does not count.
    """
    for v in range(box[0], box[1]):
        for u in range(box[2], box[3]):
            inside = padded[v - 1, u] > 0 and padded[v + 1, u] > 0 and padded[v, u - 1] > 0 and padded[v, u + 1] > 0
            out[v, u] = padded[v, u] if inside else 0


@njit(cache=True)
def delete_contour(
    padded: np.ndarray, box: np.ndarray, tolerance_mm: float, tolerance_per_m2: float, support: int, out: np.ndarray
) -> None:
    """Copy the window `box` of `padded` to `out` (same shape) without the pixels that too few neighbours support.

    A neighbour (of 8) supports a pixel if it is set and its depth differs by at most `tolerance_mm + tolerance_per_m2 *
    z^2`, or if the line through it and the pixel behind it meets the pixel's depth by that much: a limb that points
    at the camera is steep, not torn. With `support` 3 lonely and mixed pixels go and straight edges stay.
    """
    height, width = padded.shape
    for v in range(box[0], box[1]):
        for u in range(box[2], box[3]):
            z = np.int64(padded[v, u])
            if z == 0:
                out[v, u] = 0
                continue
            tolerance = tolerance_mm + tolerance_per_m2 * z * z * 1e-6
            supported = 0
            for dv in range(-1, 2):
                for du in range(-1, 2):
                    other = np.int64(padded[v + dv, u + du])
                    if other > 0 and abs(other - z) <= tolerance:
                        supported += 1
            if supported <= support:  # the pixel supports itself
                for dv in range(-1, 2):
                    for du in range(-1, 2):
                        other = np.int64(padded[v + dv, u + du])
                        vv, uu = v + 2 * dv, u + 2 * du
                        if other == 0 or abs(other - z) <= tolerance or vv < 0 or uu < 0 or vv >= height or uu >= width:
                            continue
                        behind = np.int64(padded[vv, uu])
                        if behind > 0 and abs(2 * other - behind - z) <= tolerance:
                            supported += 1
            out[v, u] = padded[v, u] if supported > support else 0


@njit(cache=True)
def median_to_metres(padded: np.ndarray, box: np.ndarray, step: int, median: bool, out: np.ndarray) -> None:
    """Write the depth in metres of every `step`-th pixel of `box`, after a 3x3 median of set pixels (0 stays 0).

    For an even number of set pixels the lower of the two middle ones is taken, which is a depth that was measured.
    `out` is float32 (ceil(H / step), ceil(W / step)), zero outside the window already.
    """
    values = np.empty(9, dtype=np.int32)
    u0, u1 = box[2], box[3]
    middles, least = np.empty(u1 - u0, dtype=np.int32), np.empty(u1 - u0, dtype=np.int32)
    first_v = box[0] + (1 - box[0]) % step
    first_u = u0 + (1 - u0) % step
    for v in range(first_v, box[1], step):
        above, here, below = padded[v - 1, u0 - 1 : u1 + 1], padded[v, u0 - 1 : u1 + 1], padded[v + 1, u0 - 1 : u1 + 1]
        if median:
            # Of all pixels, also those beside nothing, so that it is computed in vectors.
            for u in range(u1 - u0):
                least[u], middles[u] = _least_and_median(
                    above[u], above[u + 1], above[u + 2], here[u], here[u + 1], here[u + 2],
                    below[u], below[u + 1], below[u + 2],
                )  # fmt: skip
        for u in range(first_u, u1, step):
            z = np.int32(padded[v, u])
            if z == 0:
                continue
            if median and least[u - u0] > 0:
                z = middles[u - u0]
            elif median:
                n = 0
                for row in (above, here, below):
                    for du in range(3):
                        values[n] = row[u - u0 + du]
                        n += values[n] > 0
                z = _lower_median(values, n)
            out[(v - 1) // step, (u - 1) // step] = z * np.float32(1e-3)


@njit(cache=True)
def _lower_median(values: np.ndarray, n: int) -> int:
    for i in range(1, n):
        z = values[i]
        k = i
        while k > 0 and values[k - 1] > z:
            values[k] = values[k - 1]
            k -= 1
        values[k] = z
    return values[(n - 1) // 2]


@njit(cache=True)
def _least_and_median(
    a: int, b: int, c: int, d: int, e: int, f: int, g: int, h: int, i: int
) -> tuple[int, int]:  # fmt: skip
    """Return least and median without branches.

    Rows are sorted; then the median of the largest low, the middle middle and the least high is taken.
    """
    a0, a1, a2 = _sorted_3(a, b, c)
    b0, b1, b2 = _sorted_3(d, e, f)
    c0, c1, c2 = _sorted_3(g, h, i)
    low = max(max(a0, b0), c0)
    high = min(min(a2, b2), c2)
    middle = max(min(a1, b1), min(max(a1, b1), c1))
    return min(min(a0, b0), c0), max(min(low, middle), min(max(low, middle), high))


@njit(cache=True)
def _sorted_3(a: int, b: int, c: int) -> tuple[int, int, int]:
    low, high = min(a, b), max(a, b)
    return min(low, c), max(low, min(high, c)), max(high, c)


@njit(cache=True)
def count_around(mask: np.ndarray, pixels: np.ndarray, reach: int, counts: np.ndarray, areas: np.ndarray) -> None:
    """Count set pixels, `counts` (N,), and all pixels, `areas` (N,), in the windows around the flat `pixels` (N,).

    A window reaches `reach` pixels in each direction, up to the border of `mask` (H, W).
    """
    height, width = mask.shape
    for i in range(pixels.shape[0]):
        v, u = pixels[i] // width, pixels[i] % width
        v0, v1, u0, u1 = max(v - reach, 0), min(v + reach, height - 1), max(u - reach, 0), min(u + reach, width - 1)
        counts[i] = 0
        for row in range(v0, v1 + 1):
            for column in range(u0, u1 + 1):
                counts[i] += mask[row, column]
        areas[i] = (v1 - v0 + 1) * (u1 - u0 + 1)


@njit(cache=True)
def z_buffer(points: np.ndarray, intrinsics: np.ndarray, image: np.ndarray) -> None:
    """Write the depth of the nearest of `points` (N, 3) into every pixel of `image` (H, W), which is 0 before."""
    height, width = image.shape
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    for n in range(points.shape[0]):
        z = points[n, 2]
        if z <= 0:
            continue
        u = int(np.floor(points[n, 0] / z * fx + cx + 0.5))
        v = int(np.floor(points[n, 1] / z * fy + cy + 0.5))
        if 0 <= u < width and 0 <= v < height and (image[v, u] == 0 or z < image[v, u]):
            image[v, u] = z
