"""Candidates for a new person: their distance from the people present, and mirror images."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.kernels import linear
from toolkit.people.detection import SHOULDER_DISTANCE
from toolkit.people.structure import Plane
from toolkit.people.view import CoarseCamera

# Places are (3,), level frame, metres.


def apart(head: np.ndarray, other: np.ndarray) -> bool:
    """Return True if two heads on one surface may be of two people."""
    aside = float(np.hypot(head[0] - other[0], head[2] - other[2]))
    # Pixels that exceed those beside the head belong to the back of a leaning person.
    level = abs(head[1] - other[1]) <= aside
    # Horizontal distance, metres, within which a place below a head on its surface is a knee of a seated person (0.55 m
    # below) or the back of a leaning one.
    knee_reach = 0.75
    return aside >= (SHOULDER_DISTANCE if level else knee_reach)


def in_a_mirror(place: np.ndarray, places: Sequence[np.ndarray], planes: Sequence[Plane], coarse: CoarseCamera) -> bool:
    """Return True if a head is behind a wall, at the mirror image of one of the `places` before it."""
    # Metres behind a wall, and metres from the mirror image of a head before it, for a head to be that mirror image;
    # walls are known to a few degrees.
    mirror_depth, mirror_gate = 0.3, 0.4
    for plane in planes:
        normal = coarse.to_level(plane.normal[None])[0]
        behind = linear.dot(normal, place) + plane.offset
        if behind < -mirror_depth:
            image = place - 2 * behind * normal
            if any(((image - other) ** 2).sum() < mirror_gate**2 for other in places):
                return True
    return False
