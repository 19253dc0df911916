"""How high the ground lies under people who were tracked, and how that is known."""

from __future__ import annotations

from collections.abc import Sequence

from toolkit import skeleton
from toolkit.biomechanics.contact import ground_height
from toolkit.body.sole import soles
from toolkit.runs import Person
from toolkit.track import TRACKED

SOLES = [skeleton.REPORTED.index(f"{side}_ankle") for side in ("left", "right")]


def ground_of(people: Sequence[Person]) -> tuple[float, str]:
    """Y of the ground in the level frame, metres, and how it is known: "seen by the camera", "where the feet rest", or
    "guessed" (no foot was ever seen).
    """
    seen = next((person.camera_height for person in people if person.camera_height is not None), None)
    if seen is not None:
        return -seen, "seen by the camera"
    for watched in (True, False):
        found = []
        for person in people:
            track = person.track
            known = track.state == TRACKED if watched else person.there
            if watched:
                known = known & track.observed[:, SOLES].any(axis=1)
            height = ground_height(soles(person.body, track.pose), track.timestamps, known)
            found += [] if height is None else [height]
        if found:
            return min(found), "where the feet rest" if watched else "guessed"
    return 0.0, "guessed"
