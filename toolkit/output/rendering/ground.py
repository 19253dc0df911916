"""Ground grid and foot contacts, drawn in any view."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from toolkit.body.sole import soles
from toolkit.motion.contact import ground_of
from toolkit.output.rendering.overlay import draw_line
from toolkit.output.rendering.style import CARRYING, FLOOR
from toolkit.tracks.runs import Person

Project = Callable[[np.ndarray], np.ndarray]
"""Map from points (..., 3) of the level frame, metres, to pixels (..., 2), NaN for points out of view."""


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
        for start, end in project(self.pieces):
            draw_line(image, start, end, FLOOR, 1)

    def draw_soles(self, image: np.ndarray, project: Project, frame: int, numbers: Sequence[int]) -> None:
        """Draw the line from heel to ball for each foot contact in a frame."""
        for number in numbers:
            for side in np.flatnonzero(self._contact[number][frame]):
                heel, ball = project(self._soles[number][frame, side])
                draw_line(image, heel, ball, CARRYING, max(3, image.shape[0] // 80))


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
