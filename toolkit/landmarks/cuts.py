"""Extrema at cuts: points where the image border or an occluder truncates the person."""

from __future__ import annotations

import numpy as np

from toolkit.kernels.image import depth as kernels
from toolkit.sensing.cloud import Cloud

CUT_PIXELS = 3
"""Maximum distance of an extremum from the image border that counts as a cut, pixels."""


def on_cuts(cloud: Cloud, nodes: np.ndarray, unobserved: np.ndarray | None) -> np.ndarray:
    """Return which of the `nodes` (n,) of a cloud lie on a cut of the person: bool (n,).

    A narrow piece at another border than the lower one is a hand with little missing. `unobserved` (H, W) marks pixels
    without information about the person; None = no such pixels.
    """
    pixels = cloud.pixels[nodes]
    cut = np.zeros(len(pixels), dtype=np.bool_)
    # Minimum fraction of unobserved pixels around an extremum at an occluder: its edge leaves about half of them
    # unobserved, the shadow beside a limb fewer.
    cut_share = 0.4
    if unobserved is not None:
        counts, areas = np.empty((2, len(pixels)), dtype=np.int64)
        kernels.count_around(unobserved, pixels, CUT_PIXELS, counts, areas)
        cut = counts > cut_share * areas
    (height, width), (rows, columns) = cloud.camera.shape, np.divmod(pixels, cloud.camera.width)
    to_border = np.minimum(np.minimum(rows, height - 1 - rows), np.minimum(columns, width - 1 - columns))
    for i in np.flatnonzero(to_border < CUT_PIXELS):
        cut[i] |= _leaves_image(cloud, int(rows[i]), int(columns[i]))
    return cut


def _leaves_image(cloud: Cloud, v: int, u: int) -> bool:
    """Return whether the person leaves the image near pixel (v, u) with more than a hand."""
    depth, (height, width) = cloud.depth, cloud.camera.shape
    # Minimum width of a cut at the upper border or at a side, metres; narrower ones are arms with little missing.
    hand_width = 0.2
    for distance, border, place, narrow in (
        (height - 1 - v, depth[-1], u, 0.0),
        (v, depth[0], u, hand_width),
        (u, depth[:, 0], v, hand_width),
        (width - 1 - u, depth[:, -1], v, hand_width),
    ):
        if distance >= CUT_PIXELS:
            continue
        window = border[max(place - CUT_PIXELS, 0) : place + CUT_PIXELS + 1]
        if window.any() and _run(border, place) * float(window.max()) / cloud.camera.fx > narrow:
            return True
    return False


def _run(border: np.ndarray, place: int) -> int:
    """Return the pixels (N,) of the person on a border that are connected with those around `place`."""
    gaps = np.flatnonzero(border == 0)
    inside = np.flatnonzero(border[max(place - CUT_PIXELS, 0) : place + CUT_PIXELS + 1]) + max(place - CUT_PIXELS, 0)
    if len(inside) == 0:
        return 0
    start = int(inside[0])
    after = np.searchsorted(gaps, start)
    low = int(gaps[after - 1]) if after > 0 else -1
    high = int(gaps[after]) if after < len(gaps) else len(border)
    return high - low - 1
