"""Candidates for a new person: their distance from the people present, mirror images, and shape."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.kernels import linear
from toolkit.people.detection import (
    BRIDGE_CUT,
    SHOULDER_DISTANCE,
    Head,
    head_seeds,
    looks_like_person,
    near_head,
    share_out,
)
from toolkit.people.structure import Plane
from toolkit.people.view import CoarseCamera, View

# Places are (3,), level frame, metres.


def shaped_alone(view: View, coarse: CoarseCamera, place: np.ndarray) -> bool:
    """Return True if the surface below a head has a person's shape; other people are ignored."""
    return looks_like_person(view, coarse, _surface_of(view, coarse, place), place)


def above_trunks(view: View, coarse: CoarseCamera, heads: Sequence[Head]) -> list[Head]:
    """Return the heads of people in a frame that shows nothing but people, each with a trunk below.

    Of several candidates on one connected surface, those without a trunk below are fists, feet or elbows. Where none
    has one, the surface is one person, whose head is the first.
    """
    masks = [_surface_of(view, coarse, head.place) for head in heads]
    trunks = [_trunk_below(view, mask, head.place) for mask, head in zip(masks, heads, strict=True)]
    near = [near_head(view, head.place) for head in heads]
    kept = []
    for k, head in enumerate(heads):
        others = [i for i in range(len(heads)) if i != k and (masks[k] & near[i]).any()]
        if trunks[k] or not any(trunks[i] or i < k for i in others):
            kept.append(head)
    return kept


def _surface_of(view: View, coarse: CoarseCamera, place: np.ndarray) -> np.ndarray:
    """Return the surface in reach of a head, other people ignored: bool (h, w)."""
    seeds = np.zeros(view.depth.shape, dtype=np.int32)
    head_seeds(view, [place], seeds)
    return share_out(view, coarse, seeds, [place], bridge=BRIDGE_CUT) == 1


def _trunk_below(view: View, mask: np.ndarray, place: np.ndarray) -> bool:
    """Return True if a surface goes on straight below a head for the length of a child's trunk."""
    # Metres: from the head's centre to the crotch of a child of one metre; half the width of a trunk from the side; the
    # largest gap in it. Below a fist with a bent arm the surface ends at the elbow.
    trunk, half_width, gap = 0.45, 0.1, 0.12
    points = view.points[mask]
    straight = points[np.abs(points[:, 0] - place[0]) < half_width]
    heights = np.concatenate([[place[1]], np.sort(straight[straight[:, 1] < place[1], 1])[::-1]])
    ends = np.flatnonzero(heights[:-1] - heights[1:] > gap)
    lowest = heights[ends[0] if len(ends) else -1]
    return bool(place[1] - lowest > trunk)


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
