"""People and what looks like them in a single image of a room of which nothing is known."""

from __future__ import annotations

import numpy as np

from toolkit.people.detection import find_heads, head_seeds, looks_like_person, share_out
from toolkit.people.settings import PeopleSettings
from toolkit.people.view import Lens, View

KNEES = 0.3  # m horizontally, within which what looks like a person below a head are the legs of that person


def people_and_furniture(
    view: View, lens: Lens, settings: PeopleSettings, *, cut_out: bool = False
) -> tuple[list[np.ndarray], list[np.ndarray], np.ndarray]:
    """What looks like people in a single image of a room, and what only has something like a head.

    Returns
    -------
    people, furniture : places of heads, (3,) each, level frame, metres
    labels : int32 (h, w), 1.. the people, then the furniture, 0 = neither
    """
    heads = [h.place for h in find_heads(view, lens, settings, cut_out=cut_out)]
    for _ in range(3):
        seeds = np.zeros(view.depth.shape, dtype=np.int32)
        head_seeds(view, heads, seeds)
        labels = share_out(view, lens, seeds, heads, settings, bridge=settings.bridge_room)
        masks = [labels == k + 1 for k in range(len(heads))]
        large = [large_enough(view, lens, mask, settings) for mask in masks]
        shaped = [
            big and looks_like_person(view, lens, mask, head, settings)
            for big, mask, head in zip(large, masks, heads, strict=True)
        ]
        people = [head for head, good in zip(heads, shaped, strict=True) if good]
        # What is too small, or lower on somebody's body, is a part of it; a cupboard keeps its pixels to itself.
        kept = [
            big and not any(_below(head, person) for person in people) for head, big in zip(heads, large, strict=True)
        ]
        if all(kept):
            break
        heads = [head for head, keep in zip(heads, kept, strict=True) if keep]
    furniture = [head for head, good in zip(heads, shaped, strict=True) if not good]
    order = [k for k, good in enumerate(shaped) if good] + [k for k, good in enumerate(shaped) if not good]
    numbers = np.zeros(len(heads) + 1, dtype=np.int32)
    numbers[1 + np.array(order, dtype=np.int64)] = np.arange(1, len(order) + 1)
    return people, furniture, numbers[labels]


def _below(place: np.ndarray, head: np.ndarray) -> bool:
    aside = float(np.hypot(place[0] - head[0], place[2] - head[2]))
    return aside < KNEES and place[1] < head[1]


def large_enough(view: View, lens: Lens, mask: np.ndarray, settings: PeopleSettings, *, cut_out: bool = False) -> bool:
    """Whether a surface has a person's area and height; `cut_out`: nothing but people is measured."""
    if lens.area(view.depth[mask]) < (settings.least_cut_out if cut_out else settings.least_area):
        return False
    heights = view.points[mask][:, 1]
    return bool(np.ptp(heights) >= settings.least_height)
