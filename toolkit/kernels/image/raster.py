"""Z-buffer rasterisation of small meshes: visible triangle and depth of each pixel, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

NEAREST = 0.05
"""Minimum distance from the camera of drawn surfaces and searched points, metres: nearer than any depth camera."""


@njit(cache=True)
def project(points: np.ndarray, intrinsics: np.ndarray, out: np.ndarray) -> None:
    """Compute pixel coordinates and inverse depth (u, v, 1/z) of camera-frame points (N, 3).

    All three are 0 for points nearer than `NEAREST`, or behind the camera.
    """
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    for n in range(points.shape[0]):
        z = points[n, 2]
        if z <= NEAREST:
            out[n, 0] = out[n, 1] = out[n, 2] = 0.0
        else:
            out[n, 0] = fx * points[n, 0] / z + cx
            out[n, 1] = fy * points[n, 1] / z + cy
            out[n, 2] = 1.0 / z


@njit(cache=True)
def front_faces(projected: np.ndarray, faces: np.ndarray, height: int, width: int, front: np.ndarray) -> int:
    """Return the number of faces that a pixel centre of an image of `height` times `width` sees; `front`: their rows.

    They face the camera, are completely in front of it, and their bounding box contains a pixel centre. The loop avoids
    branches, because their outcome is unpredictable and a misprediction costs more than the arithmetic.
    """
    count = 0
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay = projected[a, 0], projected[a, 1]
        bx, by = projected[b, 0], projected[b, 1]
        cx, cy = projected[c, 0], projected[c, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        nearest = min(projected[a, 2], projected[b, 2], projected[c, 2])
        wide = min(np.floor(max(ax, bx, cx)), width - 1.0) - max(np.ceil(min(ax, bx, cx)), 0.0)
        high = min(np.floor(max(ay, by, cy)), height - 1.0) - max(np.ceil(min(ay, by, cy)), 0.0)
        front[count] = f
        count += int((nearest > 0.0) & (area < -1e-12) & (wide >= 0.0) & (high >= 0.0))
    return count


@njit(cache=True)
def rasterise(projected: np.ndarray, faces: np.ndarray, inverse_depth: np.ndarray, triangle: np.ndarray) -> None:
    """Draw front-facing triangles: fills `inverse_depth` (H, W), 0 in the background, and `triangle` (H, W), -1 there.

    `projected` (V, 3) comes from `project`. Counter-clockwise faces seen from outside are clockwise in image
    coordinates (v grows downwards) when they face the camera. Inverse depth is linear in the image, so its
    interpolation is exact.
    """
    height, width = inverse_depth.shape
    inverse_depth[:] = 0.0
    triangle[:] = -1
    front = np.empty(faces.shape[0], dtype=np.int64)
    for n in range(front_faces(projected, faces, height, width, front)):
        f = front[n]
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        wa, wb, wc = projected[a, 2], projected[b, 2], projected[c, 2]
        ax, ay = projected[a, 0], projected[a, 1]
        bx, by = projected[b, 0], projected[b, 1]
        cx, cy = projected[c, 0], projected[c, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        u0 = max(0, int(np.ceil(min(ax, bx, cx))))
        u1 = min(width - 1, int(np.floor(max(ax, bx, cx))))
        v0 = max(0, int(np.ceil(min(ay, by, cy))))
        v1 = min(height - 1, int(np.floor(max(ay, by, cy))))
        scale = 1.0 / area
        # Barycentric coordinates are affine in (u, v), so they are incremented.
        beta_u, beta_v = (cy - ay) * scale, -(cx - ax) * scale
        gamma_u, gamma_v = -(by - ay) * scale, (bx - ax) * scale
        for v in range(v0, v1 + 1):
            beta = (u0 - ax) * beta_u + (v - ay) * beta_v
            gamma = (u0 - ax) * gamma_u + (v - ay) * gamma_v
            for u in range(u0, u1 + 1):
                if beta >= -1e-9 and gamma >= -1e-9 and beta + gamma <= 1.0 + 1e-9:
                    w = wa + beta * (wb - wa) + gamma * (wc - wa)
                    if w > inverse_depth[v, u]:
                        inverse_depth[v, u] = w
                        triangle[v, u] = f
                beta += beta_u
                gamma += gamma_u
