"""Overlays of a picture: coloured depth, skeleton, extrema, cloud, ground and foot contacts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from toolkit.body.skeleton import BONE_ROWS
from toolkit.body.sole import soles
from toolkit.motion.contact import ground_of
from toolkit.output.rendering.style import BONE_COLORS, CARRYING, EXTREMUM, FLOOR, JOINT_COLORS, PAPER
from toolkit.tracks.runs import Person

SUBPIXEL_BITS = 3  # fractional bits of pixel coordinates, for smooth motion of lines


Project = Callable[[np.ndarray], np.ndarray]
"""Map from points (..., 3) of the level frame, metres, to pixels (..., 2), NaN for points out of view."""


@lru_cache(maxsize=1)
def _depth_table() -> np.ndarray:
    """Return a palette from light to dark blue-grey, bright and dim, and the background colour: uint8 (513, 3)."""
    stops = np.array([[238, 240, 232], [176, 190, 196], [108, 128, 146], [58, 74, 98], [30, 36, 56]], dtype=float)
    at = np.linspace(0, len(stops) - 1, 256)
    bright = np.column_stack([np.interp(at, np.arange(len(stops)), stops[:, c]) for c in range(3)]).astype(np.uint8)
    dim = 0.45  # brightness of pixels outside the person
    return np.concatenate([bright, (bright * dim).astype(np.uint8), np.array([PAPER], dtype=np.uint8)])


def color_depth(depth_mm: np.ndarray, person: np.ndarray, near: float, far: float) -> np.ndarray:
    """Colour a depth image, uint16 (H, W) millimetres, between `near` and `far` metres: RGB uint8 (H, W, 3).

    Pixels outside the mask `person` (H, W) are dimmed; pixels without a measurement have the background colour.
    """
    import cv2

    scale = 255 / max(far - near, 1e-6)
    level = cv2.convertScaleAbs(np.maximum(depth_mm, np.uint16(1000 * max(near, 0))), None, scale / 1000, -scale * near)
    entry = level.astype(np.uint16) + np.where(person, np.uint16(0), np.uint16(256))
    entry[depth_mm == 0] = 512
    return np.take(_depth_table(), entry, axis=0)


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

    thickness = max(2, round(image.shape[0] / 160))
    for bone, side in zip(BONE_ROWS, BONE_COLORS, strict=True):
        draw_lines(image, joints[bone][None], PAPER, thickness + 2)
        draw_lines(image, joints[bone][None], color or side, thickness)
    radius = int((thickness + 1.5) * 2**SUBPIXEL_BITS)
    for k in np.flatnonzero(np.isfinite(joints).all(axis=1)):
        point, filled = _fixed(joints[k]).tolist(), -1 if observed is None or observed[k] else 1
        cv2.circle(image, point, radius + 2**SUBPIXEL_BITS, PAPER, -1, cv2.LINE_AA, SUBPIXEL_BITS)
        cv2.circle(image, point, radius, color or JOINT_COLORS[k], filled, cv2.LINE_AA, SUBPIXEL_BITS)


def draw_extrema(image: np.ndarray, pixels: np.ndarray) -> None:
    """Mark geodesic extrema at pixels (n, 2) with diamonds, the first five larger."""
    import cv2

    for k, point in enumerate(pixels):
        if not np.isfinite(point).all():
            continue
        size = image.shape[0] / (58 if k < 5 else 95)
        corners = point + size * np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])
        cv2.fillPoly(image, [_fixed(corners)], EXTREMUM, cv2.LINE_AA, SUBPIXEL_BITS)
        cv2.polylines(image, [_fixed(corners)], True, PAPER, 1, cv2.LINE_AA, SUBPIXEL_BITS)


def draw_lines(image: np.ndarray, lines: np.ndarray, color: tuple[int, int, int], thickness: int) -> None:
    """Draw lines between pixels (K, 2, 2) on an RGB image, but those with NaN."""
    import cv2

    whole = lines[np.isfinite(lines).all(axis=(1, 2))]
    cv2.polylines(image, list(_fixed(whole)), False, color, thickness, cv2.LINE_AA, SUBPIXEL_BITS)


def draw_points(image: np.ndarray, pixels: np.ndarray, color: tuple[int, int, int]) -> None:
    """Set one pixel of the RGB image for each point at pixels (n, 2) inside it."""
    at = np.rint(pixels[np.isfinite(pixels).all(axis=1)]).astype(np.int64)
    inside = (at >= 0).all(axis=1) & (at < image.shape[1::-1]).all(axis=1)
    image[at[inside, 1], at[inside, 0]] = color


def _fixed(points: np.ndarray) -> np.ndarray:
    """Return pixels (..., 2) as the fixed-point numbers of OpenCV's drawing functions."""
    return np.rint(np.clip(points, -10_000, 10_000) * 2**SUBPIXEL_BITS).astype(np.int32)


class Ground:
    """Ground under all people of a run, and their foot contacts.

    Parameters
    ----------
    people : all of the run

    Attributes
    ----------
    height : y of the ground, metres, level frame
    pieces : float64 (K, 2, 3), ends of the lines of a grid on it, metres, level frame
    """

    def __init__(self, people: Sequence[Person]) -> None:
        self.height, _ = ground_of(people)
        self._soles = [soles(person.body, person.track.pose) for person in people]
        self._contact = [person.track.contact for person in people]
        there = [placed[person.there].reshape(-1, 3) for placed, person in zip(self._soles, people, strict=True)]
        self.pieces = grid(np.concatenate(there)[:, [0, 2]], self.height)

    @property
    def carries(self) -> bool:
        """Return whether any frame has a foot contact."""
        return any(contact.any() for contact in self._contact)

    def draw_floor(self, image: np.ndarray, project: Project) -> None:
        """Draw the grid on an RGB image."""
        draw_lines(image, project(self.pieces), FLOOR, 1)

    def draw_soles(self, image: np.ndarray, project: Project, frame: int, numbers: Sequence[int]) -> None:
        """Draw the line from heel to ball for each foot contact in a frame."""
        for k in numbers:
            soles_down = self._soles[k][frame, self._contact[k][frame]]
            draw_lines(image, project(soles_down), CARRYING, max(3, image.shape[0] // 80))


def grid(places: np.ndarray, height: float) -> np.ndarray:
    """Return line segments of a grid at y = `height` around positions (N, 2), x and z: float64 (K, 2, 3), metres."""
    if not len(places):
        return np.zeros((0, 2, 3))
    middle = np.median(places, axis=0)
    low, high = np.percentile(places, (1.0, 99.0), axis=0)
    cell = 0.5  # spacing of the grid, metres
    farthest = 6.0  # maximum distance of the grid from the centre of the people, metres
    around = 0.75  # minimum margin of the grid around the people, metres
    low = cell * np.floor(np.maximum(low - around, middle - farthest) / cell)
    high = cell * np.ceil(np.minimum(high + around, middle + farthest) / cell)
    piece = 0.25  # length of the drawn line segments, metres; a segment partly behind the camera is left out
    xs, zs = (np.arange(a, b + 0.5 * piece, piece) for a, b in zip(low, high, strict=True))
    step = round(cell / piece)
    pieces = [((a, z), (b, z)) for z in zs[::step] for a, b in zip(xs[:-1], xs[1:], strict=True)]
    pieces += [((x, a), (x, b)) for x in xs[::step] for a, b in zip(zs[:-1], zs[1:], strict=True)]
    flat = np.array(pieces)
    return np.stack([flat[..., 0], np.full(flat.shape[:2], height), flat[..., 1]], axis=2)
