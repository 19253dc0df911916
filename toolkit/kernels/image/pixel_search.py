"""Exact nearest-neighbour search on a pixel grid by rings around the projection with a lower bound, compiled.

A pixel on ring r around the pixel of q is at least r - 1/2 pixels away from the projection of q, in the image or
outside of it. A point p seen there lies on the ray d = (x, y, 1), and its distance to q is at least that of q to this
ray, `|q x d| / |d| >= z (r - 1/2) / (f |d|)`, with z the depth of q, f the larger focal length and |d| at most the
length of the longest ray of the image, or of those as near to q as the best distance found. Once that bound passes the
best distance, no farther ring can hold a nearer point: the answer equals that of a tree over all points, and no tree
has to be built.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from toolkit.kernels.image.raster import NEAREST


@njit(cache=True)
def longest_ray(height: int, width: int, intrinsics: np.ndarray) -> float:
    """Return the length of the longest viewing ray of unit z over the image."""
    a = max(abs(intrinsics[2]), abs(width - 1 - intrinsics[2])) / intrinsics[0]
    b = max(abs(intrinsics[3]), abs(height - 1 - intrinsics[3])) / intrinsics[1]
    return np.sqrt(1.0 + a * a + b * b)


@njit(cache=True)
def nearest_pixels(
    x: float,
    y: float,
    z: float,
    depth: np.ndarray,
    intrinsics: np.ndarray,
    ray: float,
    reach: float,
    squared: np.ndarray,
    pixels: np.ndarray,
) -> int:
    """Find the measured points nearest to (x, y, z), all in the camera frame, nearer than `reach` metres.

    Fills `squared` and `pixels` (flat index), both as long as points are wanted, nearest first, and returns how many
    were found. Ties go to the pixel met first (inner ring first, then row by row). `depth` (H, W) holds z, 0 where
    nothing was measured; `ray` comes from `longest_ray`. A point less than 5 cm in front of the camera, or behind it,
    has no projection and finds nothing.
    """
    (height, width), wanted = depth.shape, squared.shape[0]
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    if z <= NEAREST:
        return 0
    centre_u = int(np.rint(fx * x / z + cx))
    centre_v = int(np.rint(fy * y / z + cy))
    limit = looked_up = reach * reach
    focal = max(fx, fy)
    step = near_step = z / (focal * ray)
    last = int(np.ceil(reach / step)) + 1
    # Rings that lie wholly outside the image hold nothing: start with the first one that touches it.
    first = max(0, -centre_u, centre_u - (width - 1), -centre_v, centre_v - (height - 1))
    found = 0
    for ring in range(first, last + 1):
        if limit < looked_up:
            # What is within the limit lies on rays near that of q, which are shorter than the longest of the image.
            looked_up = limit
            around = np.sqrt(limit) / step + 1.0
            a, b = abs(x / z) + around / fx, abs(y / z) + around / fy
            near_step = max(step, z / (focal * np.sqrt(1.0 + a * a + b * b)))
        bound = (ring - 0.5) * near_step
        if bound > 0.0 and bound * bound >= limit:
            break
        for v in range(max(0, centre_v - ring), min(height - 1, centre_v + ring) + 1):
            whole_row = v == centre_v - ring or v == centre_v + ring
            stride = 1 if whole_row else max(1, 2 * ring)
            u = centre_u - ring
            if whole_row and u < 0:
                u = 0
            while u <= centre_u + ring:
                if u >= width:
                    break
                if u >= 0 and depth[v, u] > 0.0:
                    pz = depth[v, u]
                    dx = (u - cx) * pz / fx - x
                    dy = (v - cy) * pz / fy - y
                    dz = pz - z
                    d2 = dx * dx + dy * dy + dz * dz
                    if d2 < limit:
                        place = min(found, wanted - 1)
                        while place > 0 and squared[place - 1] > d2:
                            squared[place] = squared[place - 1]
                            pixels[place] = pixels[place - 1]
                            place -= 1
                        squared[place] = d2
                        pixels[place] = v * width + u
                        found = min(found + 1, wanted)
                        if found == wanted:
                            limit = min(limit, squared[wanted - 1])
                u += stride
    return found
