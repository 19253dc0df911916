"""Input and output of the joint network: a crop of a depth image in whole numbers, and the joints of its anchors."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

OFFSET = 0.2
"""Metres: unit of the offsets that an anchor predicts."""
MIN_LOG_SCALE, MAX_LOG_SCALE, LOG_SCALE_BIAS = -4.6, 0.3, -2.0
"""Range of the log of a scale in metres, and its value at a network output of 0."""


@njit(cache=True)
def exponential(x: float) -> float:
    """Return e**x from sums and products alone, which every processor rounds alike."""
    power = math.floor(x * 1.4426950408889634 + 0.5)
    rest = (x - power * 0.6931471803691238) - power * 1.9082149292705877e-10
    value = 1.0
    terms = 14  # of the series: exact to the last bits of float64 for arguments up to 0.35
    for n in range(terms, 0, -1):
        value = 1.0 + value * rest / n
    return value * 2.0**power


@njit(cache=True)
def probabilities(table: np.ndarray, features: np.ndarray, out: np.ndarray) -> None:
    """Fill `out` (N,) by logistic regressions: rows of `table` (N, 1 + K), constant first, and of `features` (N, >= K).

    Log-odds count as at most 30 in either direction.
    """
    most = 30.0
    for n in range(out.shape[0]):
        odds = table[n, 0]
        for k in range(table.shape[1] - 1):
            odds += table[n, k + 1] * features[n, k]
        out[n] = 1.0 / (1.0 + exponential(-min(max(odds, -most), most)))


@njit(cache=True)
def crop(
    depth: np.ndarray,
    unobserved: np.ndarray,
    intrinsics: np.ndarray,
    middle: np.ndarray,
    down: np.ndarray,
    pixel: float,
    out: np.ndarray,
) -> None:
    """Fill the network's input (3, S, S): measured or not, relative depth, unobserved or not.

    Parameters
    ----------
    depth : float32 (H, W), metres, 0 = nothing
    unobserved : bool (H, W), or (0, 0) where it is not known
    intrinsics : float64 (4,), fx, fy, cx, cy, pixels
    middle : float64 (3,), x/z, y/z and the depth in metres of the crop's middle
    down : float64 (2,), unit vector of the image that points downwards in the crop
    pixel : metres of a pixel at the depth of the middle
    """
    height, width = depth.shape
    size = out.shape[1]
    step = pixel / middle[2]
    steps = 256  # whole numbers of the network's input per unit: 2 mm of depth
    largest = 512  # of the depth channel: 1 m before and behind the reference depth
    for i in range(size):
        y = (i - 0.5 * (size - 1)) * step
        for j in range(size):
            x = (j - 0.5 * (size - 1)) * step
            u = int(np.rint((middle[0] + x * down[1] + y * down[0]) * intrinsics[0] + intrinsics[2]))
            v = int(np.rint((middle[1] - x * down[0] + y * down[1]) * intrinsics[1] + intrinsics[3]))
            out[0, i, j] = out[1, i, j] = out[2, i, j] = 0.0
            if u < 0 or v < 0 or u >= width or v >= height:
                out[2, i, j] = steps
            elif depth[v, u] > 0.0:
                away = np.rint(2.0 * steps * (depth[v, u] - middle[2]))
                out[0, i, j] = steps
                out[1, i, j] = min(max(away, -largest), largest)
            elif unobserved.shape[0] > 0 and unobserved[v, u]:
                out[2, i, j] = steps


@njit(cache=True)
def joints_of_anchors(anchors: np.ndarray, spacing: float, joints: np.ndarray, scales: np.ndarray) -> None:
    """Fill joints (J, 3), metres from the crop's middle (x right, y down, z forward), and their scales (J,), metres.

    `anchors` float32 (5 J, S, S) hold, per joint: weight logit, offsets x, y, z in units of `OFFSET`, log scale; they
    are `spacing` metres apart.
    """
    size = anchors.shape[1]
    for joint in range(joints.shape[0]):
        best = -np.inf
        for i in range(size):
            for j in range(size):
                best = max(best, anchors[5 * joint, i, j])
        total = x = y = z = log_scale = 0.0
        for i in range(size):
            for j in range(size):
                weight = exponential(float(anchors[5 * joint, i, j]) - best)
                total += weight
                x += weight * ((j - 0.5 * (size - 1)) * spacing + OFFSET * anchors[5 * joint + 1, i, j])
                y += weight * ((i - 0.5 * (size - 1)) * spacing + OFFSET * anchors[5 * joint + 2, i, j])
                z += weight * OFFSET * anchors[5 * joint + 3, i, j]
                log_scale += weight * anchors[5 * joint + 4, i, j]
        joints[joint, 0], joints[joint, 1], joints[joint, 2] = x / total, y / total, z / total
        log_scale = log_scale / total + LOG_SCALE_BIAS
        scales[joint] = exponential(min(max(log_scale, MIN_LOG_SCALE), MAX_LOG_SCALE))
