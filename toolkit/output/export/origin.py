"""Where the origin of an exported file lies: on the floor, or in the camera."""

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
    """What (0, 0, 0) of a file is.

    Attributes
    ----------
    name : "floor" or "camera"
    offset : float64 (3,), its place in the level frame, metres
    ground : how the floor is known, see `biomechanics.ground`; "" for a file whose origin is the camera
    """

    name: str
    offset: np.ndarray
    ground: str

    def note(self) -> str:
        """One sentence about the axes."""
        if self.name == CAMERA:
            return "Origin at the camera."
        return (
            f"y up, ground at y = 0 ({self.ground}), z towards the camera; origin below the first place of the person."
        )


def origin_of(people: Sequence[Person], name: str) -> Origin:
    """The origin of a file about these people: `floor` (below the first one's first place) or `camera`.

    Raises
    ------
    UsageError
        The name is another.
    """
    if name == CAMERA:
        return Origin(CAMERA, np.zeros(3), "")
    if name != FLOOR:
        raise UsageError(f"--origin {name} is neither floor nor camera")
    first = min(people, key=lambda person: int(np.argmax(person.there)) if person.there.any() else len(person.there))
    place = first.track.pose[int(np.argmax(first.there)), skeleton.ROOT_POSITION]
    height, ground = ground_of(people)
    return Origin(FLOOR, np.array([place[0], height, place[2]]), ground)
