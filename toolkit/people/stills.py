"""People and similar furniture in a single image of an unknown room."""

from __future__ import annotations

import numpy as np

from toolkit.people.detection import BRIDGE_ROOM, find_heads, head_seeds, looks_like_person, near_head, share_out
from toolkit.people.hypothesis import PersonClassifier, alone_log_odds, head_log_odds, lowness, possible_height
from toolkit.people.view import CoarseCamera, View

LEAST_CUT_OUT = 0.03  # m^2 of a person where only people are measured: one of half a metre
LEAST_HEIGHT = 0.35  # m, minimum height of a person: head and chest of a child


def people_and_furniture(
    view: View,
    coarse: CoarseCamera,
    *,
    classifier: PersonClassifier | None,
    cut_out: bool = False,
    floor: float | None = None,
) -> tuple[list[np.ndarray], list[np.ndarray], np.ndarray]:
    """Return people and furniture with a head in a single image of a room.

    Shape and classifier are evidence: a person with an arm in front of the face has no such shape. With None as
    classifier the shape alone decides. `floor` is its y, metres, level frame, where it is known.

    Returns
    -------
    people, furniture : places of heads, (3,) each, level frame, metres
    labels : int32 (h, w), 1.. the people, then the furniture, 0 = neither
    """
    heads = [h.place for h in find_heads(view, coarse, cut_out=cut_out)]
    alone = [hanging_on(view, coarse, [head])[0] for head in heads]
    large = [large_enough(view, coarse, mask) for mask in alone]
    heads = [head for head, big in zip(heads, large, strict=True) if big]
    # Heads that compete for one surface share it, and no half has a person's shape: each is also classified as if the
    # whole surface were its own.
    alone = [mask for mask, big in zip(alone, large, strict=True) if big]
    shared = hanging_on(view, coarse, heads)
    shaped = _shaped(view, coarse, heads, alone, shared)
    judged = [None if classifier is None else head_log_odds(view, coarse, head, classifier) for head in heads]
    good = [
        possible_height(head, floor) and alone_log_odds(shape, said, lowness(head, floor)) > 0
        for head, shape, said in zip(heads, shaped, judged, strict=True)
    ]
    largest_arm = 0.1  # m^2 of a raised arm with the nearest part of the shoulder
    arms = [
        said is not None and said > 0 and not shape and coarse.area(view.depth[mask]) < largest_arm
        for said, shape, mask in zip(judged, shaped, shared, strict=True)
    ]
    people: list[np.ndarray] = []
    surfaces: list[np.ndarray] = []  # only a hand lies on an accepted person
    for k in sorted(range(len(heads)), key=lambda k: not shaped[k]):  # heads with a shape first, the highest first
        covered = any(_below(person, heads[k]) for person in people)
        if good[k] and not covered and not _part_of(view, heads[k], arms[k], people, surfaces):
            people.append(heads[k])
            surfaces = hanging_on(view, coarse, people) if any(arms) else []
    furniture = [  # stays in the background
        head
        for head, right, arm in zip(heads, good, arms, strict=True)
        if not right and not _part_of(view, head, arm, people, surfaces)
    ]
    labels = np.zeros(view.depth.shape, dtype=np.int32)
    for k, mask in enumerate(hanging_on(view, coarse, [*people, *furniture]), start=1):
        labels[mask] = k
    return people, furniture, labels


def hanging_on(view: View, coarse: CoarseCamera, heads: list[np.ndarray]) -> list[np.ndarray]:
    """Return the surfaces connected to the heads, which share the foreground: masks bool (h, w)."""
    seeds = np.zeros(view.depth.shape, dtype=np.int32)
    head_seeds(view, heads, seeds)
    labels = share_out(view, coarse, seeds, heads, bridge=BRIDGE_ROOM)
    return [labels == k + 1 for k in range(len(heads))]


def _part_of(view: View, place: np.ndarray, arm: bool, people: list[np.ndarray], surfaces: list[np.ndarray]) -> bool:
    """Return True if a head candidate is part of one of the people: lower on the body, or the hand of an `arm`.

    A hand lies on the surface (h, w) of one of the people.
    """
    if any(_below(place, person) for person in people):
        return True
    near = near_head(view, place) & view.foreground
    return arm and any(bool((mask & near).any()) for mask in surfaces)


def _below(place: np.ndarray, head: np.ndarray) -> bool:
    aside = float(np.hypot(place[0] - head[0], place[2] - head[2]))
    knees = 0.3  # m horizontally, within which a person-like surface below a head is that person's legs
    return aside < knees and place[1] < head[1]


def _shaped(
    view: View, coarse: CoarseCamera, heads: list[np.ndarray], alone: list[np.ndarray], shared: list[np.ndarray]
) -> list[bool]:
    """Return True for each head with a person's shape, by its part (`shared`) or the whole (`alone`) of a surface.

    A whole with another shaped head does not count: a door that a person touches would get the shape of the person.
    """
    own = [a_person(view, coarse, mask, head) for head, mask in zip(heads, shared, strict=True)]
    found = list(own)
    for k, (head, mask) in enumerate(zip(heads, alone, strict=True)):
        if not own[k] and looks_like_person(view, coarse, mask, head):
            others = [other for other, has in zip(heads, own, strict=True) if has and not _below(other, head)]
            found[k] = not any((mask & near_head(view, other)).any() for other in others)
    return found


def a_person(view: View, coarse: CoarseCamera, mask: np.ndarray, head: np.ndarray) -> bool:
    """Return True if a surface has a person's area and height, and below the head (3,) a person's shape."""
    return large_enough(view, coarse, mask) and looks_like_person(view, coarse, mask, head)


def large_enough(view: View, coarse: CoarseCamera, mask: np.ndarray, *, cut_out: bool = False) -> bool:
    """Return True if a surface has a person's area and height; `cut_out`: the recording holds segmented people."""
    least_area = 0.06  # m^2 of a person: head and chest of a child behind a table
    if coarse.area(view.depth[mask]) < (LEAST_CUT_OUT if cut_out else least_area):
        return False
    heights = view.points[mask][:, 1]
    return bool(np.ptp(heights) >= LEAST_HEIGHT)
