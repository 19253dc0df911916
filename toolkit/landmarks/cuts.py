"""Where the image's border, or something nearer, cuts a person off: what ends there is no limb."""

from __future__ import annotations

import numpy as np

from toolkit.sensing.cloud import Cloud

CUT_PIXELS = 3
"""An extremum nearer to the image's border than this, where the person reaches the border, lies on a cut."""
HAND_WIDTH = 0.2
"""Metres: what leaves by the upper border or a side and is narrower is an arm with little missing."""
CUT_SHARE = 0.4
"""Of the pixels around an extremum: an occluder's edge leaves about half of them unobserved, the shadow that a depth
camera throws beside a limb less."""


def on_cuts(cloud: Cloud, nodes: np.ndarray, unobserved: np.ndarray | None) -> np.ndarray:
    """Which of the `nodes` (n,) of a cloud lie where the person is cut off: bool (n,).

    A narrow piece that leaves by another border than the lower one is a hand, of which little is missing. `unobserved`
    (H, W) are pixels that say nothing about the person, or None.
    """
    cut = np.zeros(len(nodes), dtype=np.bool_)
    for i, pixel in enumerate(cloud.pixels[nodes]):
        v, u = divmod(int(pixel), cloud.camera.width)
        cut[i] = _leaves_image(cloud, v, u)
        if unobserved is not None:
            rows = slice(max(v - CUT_PIXELS, 0), v + CUT_PIXELS + 1)
            around = unobserved[rows, max(u - CUT_PIXELS, 0) : u + CUT_PIXELS + 1]
            cut[i] |= np.count_nonzero(around) > CUT_SHARE * around.size
    return cut


def _leaves_image(cloud: Cloud, v: int, u: int) -> bool:
    """Whether the person leaves the image near pixel (v, u), and not just with a hand."""
    depth, (height, width) = cloud.depth, cloud.camera.shape
    for distance, border, place, narrow in (
        (height - 1 - v, depth[-1], u, 0.0),
        (v, depth[0], u, HAND_WIDTH),
        (u, depth[:, 0], v, HAND_WIDTH),
        (width - 1 - u, depth[:, -1], v, HAND_WIDTH),
    ):
        if distance >= CUT_PIXELS:
            continue
        window = border[max(place - CUT_PIXELS, 0) : place + CUT_PIXELS + 1]
        if window.any() and _run(border, place) * float(window.max()) / cloud.camera.fx > narrow:
            return True
    return False


def _run(border: np.ndarray, place: int) -> int:
    """Pixels of the person on a border (N,) that hang together with those around `place`."""
    gaps = np.flatnonzero(border == 0)
    inside = np.flatnonzero(border[max(place - CUT_PIXELS, 0) : place + CUT_PIXELS + 1]) + max(place - CUT_PIXELS, 0)
    if len(inside) == 0:
        return 0
    start = int(inside[0])
    after = np.searchsorted(gaps, start)
    low = int(gaps[after - 1]) if after > 0 else -1
    high = int(gaps[after]) if after < len(gaps) else len(border)
    return high - low - 1
