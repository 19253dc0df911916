"""People and what looks like them in a single image of a room of which nothing is known."""

from __future__ import annotations

import numpy as np

from toolkit.people.detection import BRIDGE_ROOM, find_heads, head_seeds, looks_like_person, near_head, share_out
from toolkit.people.hypothesis import PersonJudge, alone_log_odds, judged_head, lowness, possible_height
from toolkit.people.view import Lens, View

LEAST_AREA = 0.06  # m^2 of a person seen head on: head and chest of a child that a table cuts off
LEAST_CUT_OUT = 0.03  # m^2 where nothing but people is measured: one of half a metre
LEAST_HEIGHT = 0.35  # m of a person: head and chest of a child
KNEES = 0.3  # m horizontally, within which what looks like a person below a head are the legs of that person


def people_and_furniture(
    view: View, lens: Lens, *, cut_out: bool = False, judge: PersonJudge | None = None, floor: float | None = None
) -> tuple[list[np.ndarray], list[np.ndarray], np.ndarray]:
    """What looks like people in a single image of a room, and what only has something like a head.

    A person's shape is evidence as the judge's word is: who holds an arm before the face has none. `floor` is its y,
    metres, level frame, where it is known.

    Returns
    -------
    people, furniture : places of heads, (3,) each, level frame, metres
    labels : int32 (h, w), 1.. the people, then the furniture, 0 = neither
    """
    heads = [h.place for h in find_heads(view, lens, cut_out=cut_out)]
    alone = [hanging_on(view, lens, [head])[0] for head in heads]
    large = [large_enough(view, lens, mask) for mask in alone]
    heads = [head for head, big in zip(heads, large, strict=True) if big]
    # Heads that compete for one surface share it out, and no half has a person's shape: each is judged as if the
    # surface were its own, too.
    alone = [mask for mask, big in zip(alone, large, strict=True) if big]
    shared = hanging_on(view, lens, heads)
    own = [large_enough(view, lens, m) and looks_like_person(view, lens, m, head) for head, m in zip(heads, shared)]

    def beside(head: np.ndarray) -> list[np.ndarray]:
        return [other for other, has in zip(heads, own, strict=True) if has and not _below(other, head)]

    # A door beside a person has no shape of its own by the surface that hangs on both.
    shaped = [
        own[k] or (looks_like_person(view, lens, alone[k], head) and not _any_on(view, alone[k], beside(head)))
        for k, head in enumerate(heads)
    ]
    judged = [judged_head(view, lens, head, judge) for head in heads]
    good = [
        possible_height(head, floor) and alone_log_odds(shape, said, lowness(head, floor)) > 0
        for head, shape, said in zip(heads, shaped, judged, strict=True)
    ]
    # A raised hand has neither a person's shape nor a surface of its own, but the pixels of a person.
    hand = [
        said is not None and said > 0 and not shape and not large_enough(view, lens, share)
        for said, shape, share in zip(judged, shaped, shared, strict=True)
    ]
    people: list[np.ndarray] = []
    for k in sorted(range(len(heads)), key=lambda k: not shaped[k]):  # those with a shape first, the highest first
        taken = any(_below(heads[k], person) or _below(person, heads[k]) for person in people)
        if good[k] and not taken and not (hand[k] and _reached(view, lens, people, heads[k])):
            people.append(heads[k])
    furniture = [
        head
        for k, head in enumerate(heads)
        # A lower head within a person's body is a part of it; a cupboard keeps its own pixels.
        if not good[k]
        and not any(_below(head, person) for person in people)
        and not (hand[k] and _reached(view, lens, people, head))
    ]
    labels = np.zeros(view.depth.shape, dtype=np.int32)
    for k, mask in enumerate(hanging_on(view, lens, [*people, *furniture]), start=1):
        labels[mask] = k
    return people, furniture, labels


def hanging_on(view: View, lens: Lens, heads: list[np.ndarray]) -> list[np.ndarray]:
    """What hangs on each of the heads when they share out the foreground: masks bool (h, w)."""
    seeds = np.zeros(view.depth.shape, dtype=np.int32)
    head_seeds(view, heads, seeds)
    labels = share_out(view, lens, seeds, heads, bridge=BRIDGE_ROOM)
    return [labels == k + 1 for k in range(len(heads))]


def _below(place: np.ndarray, head: np.ndarray) -> bool:
    aside = float(np.hypot(place[0] - head[0], place[2] - head[2]))
    return aside < KNEES and place[1] < head[1]


def _any_on(view: View, mask: np.ndarray, heads: list[np.ndarray]) -> bool:
    """Whether one of the heads lies on a surface."""
    return any(bool((mask & near_head(view, head)).any()) for head in heads)


def _reached(view: View, lens: Lens, people: list[np.ndarray], place: np.ndarray) -> bool:
    """Whether one of the people's surfaces holds what is at a place."""
    near = near_head(view, place) & view.foreground
    return bool(people) and any(bool((mask & near).any()) for mask in hanging_on(view, lens, people))


def large_enough(view: View, lens: Lens, mask: np.ndarray, *, cut_out: bool = False) -> bool:
    """Whether a surface has a person's area and height; `cut_out`: nothing but people is measured."""
    if lens.area(view.depth[mask]) < (LEAST_CUT_OUT if cut_out else LEAST_AREA):
        return False
    heights = view.points[mask][:, 1]
    return bool(np.ptp(heights) >= LEAST_HEIGHT)
