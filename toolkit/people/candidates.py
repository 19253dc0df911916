"""Candidates for a new person: their distance from the people present, mirror images, and shape."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.kernels import linear
from toolkit.people.detection import (
    BRIDGE_CUT,
    REACH_STILL,
    SHOULDER_DISTANCE,
    head_seeds,
    looks_like_person,
    share_out,
)
from toolkit.people.structure import Plane
from toolkit.people.unassigned import head_of
from toolkit.people.view import CoarseCamera, View

# Places are (3,), level frame, metres.


def shaped_alone(view: View, lens: CoarseCamera, place: np.ndarray) -> bool:
    """Return True if the surface below a head has a person's shape; other people are ignored."""
    seeds = np.zeros(view.depth.shape, dtype=np.int32)
    head_seeds(view, [place], seeds)
    mask = share_out(view, lens, seeds, [place], bridge=BRIDGE_CUT) == 1
    return looks_like_person(view, lens, mask, place)


def beside(place: np.ndarray, others: Sequence[np.ndarray]) -> bool:
    """Return True if a place is within a seated person's reach of one of the other heads."""
    asides = [float(np.hypot(place[0] - other[0], place[2] - other[2])) for other in others]
    return min(asides, default=np.inf) < REACH_STILL


def apart(head: np.ndarray, other: np.ndarray) -> bool:
    """Return True if two heads on one surface may be of two people."""
    aside = float(np.hypot(head[0] - other[0], head[2] - other[2]))
    level = (
        abs(head[1] - other[1]) <= aside
    )  # pixels that exceed those beside the head belong to the back of a leaning person
    # Horizontal distance, metres, within which a place below a head on its surface is a knee of a seated person (0.55 m
    # below) or the back of a leaning one.
    knee_reach = 0.75
    return aside >= (SHOULDER_DISTANCE if level else knee_reach)


def headless(view: View, bodies: Sequence[np.ndarray], heads: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the bodies (masks) that are connected to none of the heads."""
    return [body for body in bodies if not beside(head_of(view, body), heads)]


def in_a_mirror(place: np.ndarray, places: Sequence[np.ndarray], planes: Sequence[Plane], lens: CoarseCamera) -> bool:
    """Return True if a head is behind a wall, at the mirror image of one of the `places` before it."""
    # Metres behind a wall, and metres from the mirror image of a head before it, for a head to be that mirror image;
    # walls are known to a few degrees.
    mirror_depth, mirror_gate = 0.3, 0.4
    for plane in planes:
        normal = lens.to_level(plane.normal[None])[0]
        behind = linear.dot(normal, place) + plane.offset
        if behind < -mirror_depth:
            image = place - 2 * behind * normal
            if any(((image - other) ** 2).sum() < mirror_gate**2 for other in places):
                return True
    return False
