"""Origin of an exported file: on the floor, or at the camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.io.errors import UsageError
from toolkit.motion.contact import ground_of
from toolkit.tracks.runs import Person

FLOOR, CAMERA = "floor", "camera"


@dataclass(frozen=True, eq=False)
class Origin:
    """Position of (0, 0, 0) in a file.

    Attributes
    ----------
    name : "floor" or "camera"
    offset : float64 (3,), its place in the level frame, metres
    ground : source of the floor height, see `motion.contact.ground_of`; "" for the camera
    """

    name: str
    offset: np.ndarray
    ground: str

    def note(self) -> str:
        """Return one sentence about the axes."""
        if self.name == CAMERA:
            return "Origin at the camera."
        axes = f"y up, ground at y = 0 ({self.ground}), z towards the camera"
        return f"{axes}; origin below the first position of the person."


def origin_of(people: Sequence[Person], name: str) -> Origin:
    """Return the origin of a file of these people: `floor` (below the first position of the first one) or `camera`.

    Raises
    ------
    UsageError
        The name is neither.
    """
    if name == CAMERA:
        return Origin(CAMERA, np.zeros(3), "")
    if name != FLOOR:
        raise UsageError(f"--origin {name} is neither floor nor camera")
    first = min(people, key=lambda person: int(np.argmax(person.there)) if person.there.any() else len(person.there))
    place = first.track.pose[int(np.argmax(first.there)), skeleton.ROOT_POSITION]
    height, ground = ground_of(people)
    return Origin(FLOOR, np.array([place[0], height, place[2]]), ground)
