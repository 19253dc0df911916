"""Head and shoulders in a depth image, by comparisons of depth at places given in metres, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def head_scores(
    depth: np.ndarray,
    candidates: np.ndarray,
    intrinsics: np.ndarray,
    up: np.ndarray,
    inside: np.ndarray,
    around: np.ndarray,
    shoulders: np.ndarray,
    tolerances: np.ndarray,
    unmeasured: float,
    scores: np.ndarray,
) -> None:
    """How much the surroundings of every candidate pixel look like those of a head's centre.

    A place is given by metres to the right and upwards in the plane through the pixel's point that faces the camera,
    upwards being the vertical as far as it lies in that plane.

    Parameters
    ----------
    depth : float32 (H, W), metres along z, 0 = no measurement
    candidates : bool (H, W)
    intrinsics : (4,); up : (3,), the vertical in the camera frame, of length 1
    inside : (A, 2), places on the head; around : (B, 2), places beside and above it; shoulders : (C, 2), places on the
        chest and shoulders
    tolerances : (4,), metres: depth of a head, depth by which its surroundings lie behind it at the least, depth
        between head and shoulders, radius of the sphere that a head is flatter than
    unmeasured : what a place beside the head counts, 0 to 1, where nothing was measured
    scores : float32 (H, W); becomes 0 for what is no head, else the mean of three shares in 0 to 1: of the places
        around that lie behind the head or were not measured, of the shoulders' places at the head's depth, and of the
        roundness that a sphere would have
    """
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    deep, behind, reach, radius = tolerances[0], tolerances[1], tolerances[2], tolerances[3]
    for v in range(height):
        for u in range(width):
            scores[v, u] = 0.0
            if not candidates[v, u]:
                continue
            z = depth[v, u]
            a, b = (u - cx) / fx, (v - cy) / fy
            along = (a * up[0] + b * up[1] + up[2]) / (a * a + b * b + 1.0)
            yx, yy = up[0] - along * a, up[1] - along * b
            length = np.sqrt(yx * yx + yy * yy)
            if length < 0.2:  # seen from straight above there is no below
                continue
            # In pixels; the small slant of that plane against the image is left out.
            yx, yy = yx / length * fx / z, yy / length * fy / z
            xx, xy = -yy / fy * fx, yx / fx * fy
            on = 0
            round_sum, round_count = 0.0, 0
            for k in range(inside.shape[0]):
                uu = int(np.rint(u + inside[k, 0] * xx + inside[k, 1] * yx))
                vv = int(np.rint(v + inside[k, 0] * xy + inside[k, 1] * yy))
                if uu < 0 or vv < 0 or uu >= width or vv >= height or depth[vv, uu] == 0.0:
                    continue
                d = depth[vv, uu] - z
                if abs(d) <= deep:
                    on += 1
                    off = inside[k, 0] * inside[k, 0] + inside[k, 1] * inside[k, 1]
                    if off > 0.0:
                        round_sum += d / (radius - np.sqrt(max(radius * radius - off, 0.0)))
                        round_count += 1
            if 3 * on < 2 * inside.shape[0] or round_count == 0:
                continue
            free, contradicted, left, right = 0.0, 0, 0.0, 0.0
            for k in range(around.shape[0]):
                uu = int(np.rint(u + around[k, 0] * xx + around[k, 1] * yx))
                vv = int(np.rint(v + around[k, 0] * xy + around[k, 1] * yy))
                gain = 0.0
                if uu < 0 or vv < 0 or uu >= width or vv >= height or depth[vv, uu] == 0.0:
                    gain = unmeasured
                elif depth[vv, uu] - z >= behind:
                    gain = 1.0
                else:
                    contradicted += 1
                free += gain
                if around[k, 0] > 0.1:
                    right = max(right, gain)
                elif around[k, 0] < -0.1:
                    left = max(left, gain)
            if 3 * contradicted > around.shape[0] or min(left, right) < 0.5:
                continue
            seen, below = 0, 0
            for k in range(shoulders.shape[0]):
                uu = int(np.rint(u + shoulders[k, 0] * xx + shoulders[k, 1] * yx))
                vv = int(np.rint(v + shoulders[k, 0] * xy + shoulders[k, 1] * yy))
                if uu < 0 or vv < 0 or uu >= width or vv >= height or depth[vv, uu] == 0.0:
                    continue
                seen += 1
                if abs(depth[vv, uu] - z) <= reach:
                    below += 1
            if 2 * seen < shoulders.shape[0] or 3 * below < 2 * seen:
                continue
            roundness = min(max(round_sum / round_count, 0.0), 1.0)
            scores[v, u] = (free / around.shape[0] + below / seen + roundness) / 3.0
