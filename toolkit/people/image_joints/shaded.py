"""Shaded pictures of a person's depth, for detectors trained on photographs."""

from __future__ import annotations

import numpy as np

from toolkit.sensing.camera import Camera

ENLARGED = 3
"""Enlargement of the picture against the depth image: its contours are smooth as in a photograph."""
GREY = 120.0
"""Grey value of the background."""
KEY = np.array([-0.48, -0.64, -0.6])
"""Direction towards the light, camera frame."""


def shaded(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Shade a person's depth, float32 (H, W), metres, 0 elsewhere: uint8 (3H, 3W, 3), RGB, on grey.

    Pixels keep their areas: pixel u of the depth image is around 3u + 1 in the picture.
    """
    height, width = depth.shape
    picture = np.full((ENLARGED * height, ENLARGED * width, 3), int(GREY), dtype=np.uint8)
    rows, columns = np.flatnonzero(depth.any(axis=1)), np.flatnonzero(depth.any(axis=0))
    if not len(rows):
        return picture
    box, large = [], []
    border = 4  # pixels around a person that are shaded too: the enlarged contour needs two
    for there, size in ((rows, height), (columns, width)):
        first, last = max(int(there[0]) - border, 0), min(int(there[-1]) + border + 1, size)
        box.append(slice(first, last))
        large.append(slice(ENLARGED * first, ENLARGED * last))
    slopes = np.concatenate([camera.rays(), np.ones((*camera.shape, 1))], axis=-1)
    picture[tuple(large)] = lit(depth[tuple(box)], slopes[tuple(box)])
    return picture


def lit(depth: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Shade any part of an image as `shaded`; `slopes` (H, W, 3) are the rays of its pixels with z = 1."""
    import cv2

    mask = (depth > 0).astype(np.float32)
    smoothed = 5  # side of the window, pixels, over which depth is averaged before normals are computed
    window = (smoothed, smoothed)
    share = cv2.blur(mask, window, borderType=cv2.BORDER_CONSTANT)
    smooth = np.where(mask > 0, cv2.blur(depth, window, borderType=cv2.BORDER_CONSTANT) / np.maximum(share, 1e-6), 0.0)
    normals = _normals(smooth, mask > 0, slopes)
    from_head = -(normals * slopes).sum(axis=-1) / np.sqrt((slopes * slopes).sum(axis=-1))
    from_key = (normals * KEY).sum(axis=-1)
    # Fractions of ambient light, light from the camera, and light from above left.
    ambient, head_light, key_light = 0.35, 0.4, 0.35
    light = ambient + head_light * np.maximum(from_head, 0.0) + key_light * np.maximum(from_key, 0.0)
    skin = (224.0, 172.0, 138.0)
    picture = np.where(mask[..., None] > 0, np.array(skin) * light[..., None], GREY)
    size = (ENLARGED * depth.shape[1], ENLARGED * depth.shape[0])
    large = cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_CUBIC)
    return np.clip(np.rint(large), 0, 255).astype(np.uint8)


def _normals(depth: np.ndarray, mask: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return unit normals towards the camera (H, W, 3) of the surface."""
    points = slopes * depth[..., None]
    across, down = _difference(points, mask, 1), _difference(points, mask, 0)
    normals = np.cross(down, across)
    length = np.sqrt((normals * normals).sum(axis=-1, keepdims=True))
    away = slopes / np.sqrt((slopes * slopes).sum(axis=-1, keepdims=True))
    return np.where(length > 0, normals / np.maximum(length, 1e-12), -away)


def _difference(points: np.ndarray, mask: np.ndarray, axis: int) -> np.ndarray:
    """Return differences of neighbours along one axis, central where both exist, else one-sided; else 0."""
    after, before = np.roll(points, -1, axis), np.roll(points, 1, axis)
    has_after, has_before = np.roll(mask, -1, axis), np.roll(mask, 1, axis)
    edge: list[slice | int] = [slice(None), slice(None)]
    edge[axis] = -1
    has_after[tuple(edge)] = False
    edge[axis] = 0
    has_before[tuple(edge)] = False
    ahead = np.where(has_after[..., None], after, points)
    behind = np.where(has_before[..., None], before, points)
    return np.where(mask[..., None], ahead - behind, 0.0)
