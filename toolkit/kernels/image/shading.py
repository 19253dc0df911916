"""A mesh as a shaded picture, compiled: triangles on a pixel grid with a depth buffer."""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels.image.raster import NEAREST


@njit(cache=True)
def shade_triangles(
    vertices: np.ndarray,
    normals: np.ndarray,
    colors: np.ndarray,
    faces: np.ndarray,
    intrinsics: np.ndarray,
    lights: np.ndarray,
    key: np.ndarray,
    depth: np.ndarray,
    image: np.ndarray,
) -> None:
    """Draw the triangles that face the camera, nearest first kept, with interpolated normals and colours.

    `vertices`, `normals` (V, 3) in the camera frame, `colors` (V, 3), `faces` (F, 3) counter-clockwise from outside,
    `lights` the shares of ambient, key and head light, `key` (3,) the direction towards the key light. `depth` (H, W)
    comes filled with infinity where nothing is drawn yet; `image` (H, W, 3) uint8.
    """
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    weight = np.empty(3)
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        za, zb, zc = vertices[a, 2], vertices[b, 2], vertices[c, 2]
        if min(za, zb, zc) < NEAREST:
            continue
        ua, va = vertices[a, 0] / za * fx + cx, vertices[a, 1] / za * fy + cy
        ub, vb = vertices[b, 0] / zb * fx + cx, vertices[b, 1] / zb * fy + cy
        uc, vc = vertices[c, 0] / zc * fx + cx, vertices[c, 1] / zc * fy + cy
        area = (ub - ua) * (vc - va) - (uc - ua) * (vb - va)
        if area >= 0.0:  # v points down, so a face seen from outside turns the other way
            continue
        for v in range(max(int(np.ceil(min(va, vb, vc))), 0), min(int(np.floor(max(va, vb, vc))), height - 1) + 1):
            for u in range(max(int(np.ceil(min(ua, ub, uc))), 0), min(int(np.floor(max(ua, ub, uc))), width - 1) + 1):
                wa = ((ub - u) * (vc - v) - (uc - u) * (vb - v)) / area
                wb = ((uc - u) * (va - v) - (ua - u) * (vc - v)) / area
                wc = 1.0 - wa - wb
                if wa < 0.0 or wb < 0.0 or wc < 0.0:
                    continue
                z = 1.0 / (wa / za + wb / zb + wc / zc)
                if z >= depth[v, u]:
                    continue
                depth[v, u] = z
                weight[0], weight[1], weight[2] = wa / za * z, wb / zb * z, wc / zc * z
                _shade(f, weight, normals, colors, faces, (u - cx) / fx, (v - cy) / fy, lights, key, image[v, u])


@njit(cache=True)
def _shade(
    f: int,
    weight: np.ndarray,
    normals: np.ndarray,
    colors: np.ndarray,
    faces: np.ndarray,
    x: float,
    y: float,
    lights: np.ndarray,
    key: np.ndarray,
    out: np.ndarray,
) -> None:
    """Compute the colour of one pixel whose ray is (x, y, 1): fills `out` (3,)."""
    n = np.zeros(3)
    color = np.zeros(3)
    for k in range(3):
        for axis in range(3):
            n[axis] += weight[k] * normals[faces[f, k], axis]
            color[axis] += weight[k] * colors[faces[f, k], axis]
    length = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) + 1e-12
    from_key = max((n[0] * key[0] + n[1] * key[1] + n[2] * key[2]) / length, 0.0)
    from_head = max(-(n[0] * x + n[1] * y + n[2]) / (length * np.sqrt(x * x + y * y + 1.0)), 0.0)
    light = lights[0] + lights[1] * from_key + lights[2] * from_head
    for axis in range(3):
        out[axis] = np.uint8(min(color[axis] * light, 255.0))
