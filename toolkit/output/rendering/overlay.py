"""Overlays of a picture: coloured depth, skeleton, extrema, cloud."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from toolkit.body.skeleton import BONE_ROWS
from toolkit.output.rendering.style import BONE_COLORS, EXTREMUM, JOINT_COLORS, PAPER

SUBPIXEL_BITS = 3  # fractional bits of pixel coordinates, for smooth motion of lines


@lru_cache(maxsize=1)
def _depth_palette() -> np.ndarray:
    """Return a depth palette, uint8 (256, 3), from light to dark blue-grey, in contrast to orange, blue and pink."""
    stops = np.array([[238, 240, 232], [176, 190, 196], [108, 128, 146], [58, 74, 98], [30, 36, 56]], dtype=float)
    at = np.linspace(0, len(stops) - 1, 256)
    return np.column_stack([np.interp(at, np.arange(len(stops)), stops[:, c]) for c in range(3)]).astype(np.uint8)


def color_depth(depth_mm: np.ndarray, person: np.ndarray, near: float, far: float) -> np.ndarray:
    """Colour a depth image, uint16 (H, W) millimetres, between `near` and `far` metres: RGB uint8 (H, W, 3).

    Pixels outside the mask `person` (H, W) are dimmed; pixels without a measurement have the background colour.
    """
    import cv2

    scale = 255 / max(far - near, 1e-6)
    level = cv2.convertScaleAbs(np.maximum(depth_mm, np.uint16(1000 * max(near, 0))), None, scale / 1000, -scale * near)
    # One table with the palette bright and dim and the background colour, for a single lookup per pixel.
    entry = level.astype(np.uint16) + np.where(person, np.uint16(0), np.uint16(256))
    entry[depth_mm == 0] = 512
    return np.take(_depth_table(), entry, axis=0)


@lru_cache(maxsize=1)
def _depth_table() -> np.ndarray:
    bright = _depth_palette()
    dim = 0.45  # brightness of pixels outside the person
    return np.concatenate([bright, (bright * dim).astype(np.uint8), np.array([PAPER], dtype=np.uint8)])


def draw_skeleton(
    image: np.ndarray,
    joints: np.ndarray,
    observed: np.ndarray | None = None,
    color: tuple[int, int, int] | None = None,
) -> None:
    """Draw 20 joints at pixels (20, 2) with their bones on an RGB image; unobserved joints are rings.

    Left, right and middle have their own colours, unless one colour is given.
    """
    import cv2

    points = [None if not np.isfinite(p).all() else _fixed(p) for p in joints]
    thickness = max(2, round(image.shape[0] / 160))
    for (a, b), side in zip(BONE_ROWS, BONE_COLORS, strict=True):
        start, end = points[a], points[b]
        if start is not None and end is not None:
            cv2.line(image, start, end, PAPER, thickness + 2, cv2.LINE_AA, SUBPIXEL_BITS)
            cv2.line(image, start, end, color or side, thickness, cv2.LINE_AA, SUBPIXEL_BITS)
    for k, point in enumerate(points):
        if point is None:
            continue
        radius = int((thickness + 1.5) * 2**SUBPIXEL_BITS)
        seen = observed is None or observed[k]
        cv2.circle(image, point, radius + 2**SUBPIXEL_BITS, PAPER, -1, cv2.LINE_AA, SUBPIXEL_BITS)
        cv2.circle(image, point, radius, color or JOINT_COLORS[k], -1 if seen else 1, cv2.LINE_AA, SUBPIXEL_BITS)


def draw_extrema(image: np.ndarray, pixels: np.ndarray) -> None:
    """Mark geodesic extrema at pixels (n, 2) with diamonds, the first five larger."""
    import cv2

    for k, point in enumerate(pixels):
        if not np.isfinite(point).all():
            continue
        size = image.shape[0] / (58 if k < 5 else 95)
        corners = point + size * np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])
        outline = np.rint(corners * 2**SUBPIXEL_BITS).astype(np.int32)
        cv2.fillPoly(image, [outline], EXTREMUM, cv2.LINE_AA, SUBPIXEL_BITS)
        cv2.polylines(image, [outline], True, PAPER, 1, cv2.LINE_AA, SUBPIXEL_BITS)


def draw_line(
    image: np.ndarray, start: np.ndarray, end: np.ndarray, color: tuple[int, int, int], thickness: int
) -> None:
    """Draw a line between two pixels (2,) on an RGB image; NaN draws nothing."""
    import cv2

    if np.isfinite(start).all() and np.isfinite(end).all():
        cv2.line(image, _fixed(start), _fixed(end), color, thickness, cv2.LINE_AA, SUBPIXEL_BITS)


def draw_points(image: np.ndarray, pixels: np.ndarray, color: tuple[int, int, int]) -> None:
    """Set one pixel of the RGB image for each point at pixels (n, 2) inside it."""
    at = np.rint(pixels[np.isfinite(pixels).all(axis=1)]).astype(np.int64)
    inside = (at >= 0).all(axis=1) & (at < image.shape[1::-1]).all(axis=1)
    image[at[inside, 1], at[inside, 0]] = color


def _fixed(point: np.ndarray) -> tuple[int, int]:
    u, v = np.rint(np.clip(point, -10_000, 10_000) * 2**SUBPIXEL_BITS).astype(int)
    return int(u), int(v)
