"""Assignment of pixels to people by their predicted bodies in one common z-buffer, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit


def draw_body(inverse_depth: np.ndarray, number: int, nearest: np.ndarray, owner: np.ndarray) -> None:
    """Add one body to a z-buffer of several.

    `inverse_depth` (H, W) of the body, 0 where it is not; `nearest` (H, W) is the largest inverse depth so far and
    `owner` int32 (H, W) the number of the body that it belongs to, 0 where no person is.
    """
    owner[inverse_depth > nearest] = number
    np.maximum(nearest, inverse_depth, out=nearest)


@njit(cache=True)
def nearest_owner(
    depth: np.ndarray,
    foreground: np.ndarray,
    nearest: np.ndarray,
    owner: np.ndarray,
    intrinsics: np.ndarray,
    gate: float,
    seeds: np.ndarray,
) -> None:
    """Give every measured point to the body whose drawn surface is nearest, if it is nearer than `gate` metres.

    Parameters
    ----------
    depth : float32 (H, W), metres along z; foreground : bool (H, W), the requested pixels
    nearest, owner : z-buffer of all bodies, as `draw_body` makes it, of the same camera `intrinsics` (4,)
    seeds : int32 (H, W); entries that are 0 become the owner's number, where there is one. The pixel met first, row by
        row, wins a tie
    """
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    for v in range(height):
        for u in range(width):
            if not foreground[v, u] or seeds[v, u] != 0:
                continue
            z = float(depth[v, u])
            x, y = (u - cx) * z / fx, (v - cy) * z / fy
            radius = int(np.ceil(gate * max(fx, fy) / z))
            best, who = gate * gate, 0
            for vv in range(max(v - radius, 0), min(v + radius + 1, height)):
                for uu in range(max(u - radius, 0), min(u + radius + 1, width)):
                    if owner[vv, uu] == 0:
                        continue
                    d = 1.0 / nearest[vv, uu]
                    dx, dy, dz = (uu - cx) * d / fx - x, (vv - cy) * d / fy - y, d - z
                    away = dx * dx + dy * dy + dz * dz
                    if away < best:
                        best, who = away, owner[vv, uu]
            seeds[v, u] = who
