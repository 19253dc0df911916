"""A room learnt from frames with people in it, without a frame in which it is empty.

A pixel's background is the farthest depth that lasts. That alone would make background of the torso of somebody who
stays in place; so what is a person in the single frames is left out. A person is what has a person's shape and moves;
what has that shape and never moves is furniture.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.people.detection import near_head
from toolkit.people.settings import PeopleSettings
from toolkit.people.stills import people_and_furniture
from toolkit.people.structure import Plane, find_planes, on_planes
from toolkit.people.surroundings import Surroundings, first_look, tolerances
from toolkit.people.view import Lens

FEWEST = 8  # frames from which anything is learnt; fewer show what stands there, not what stays
LASTING = 0.15  # of the samples, and at least 2, in which the room behind somebody must be seen
SOMEBODY = 0.1  # of the samples at the background's depth: so many are a person, and the room there is not known
ALIVE = 0.02  # of a person's pixels that move at some time: a hand
CLOSE_BY = 0.4  # m in depth, between one surface of a person and another that moves into its place
HEAD_MOVED = 0.5  # of the pixels of what may be a head: it moved there, whatever the shape below it
STILL = 0.98  # of the samples in which a pixel shows the same depth where nothing moves
NOISE = 3.0  # standard deviations of a pixel that stands before the room
MOST_NOISE = 0.3  # m that a pixel's noise may widen the margin


def learnt(frames: Sequence[np.ndarray], lens: Lens, settings: PeopleSettings) -> Surroundings:
    """Surroundings from coarse frames float32 (h, w), metres, of one room, spread over time; at least one."""
    if len(frames) < FEWEST:
        return first_look(frames[0], lens, settings)
    stack = np.stack(frames)
    rough = farthest_lasting(stack, LASTING, lens, settings)
    margin, _ = _margins(stack, rough, lens, settings)
    moved = np.stack([_opened((depth > 0) & (rough - depth > margin)) for depth in stack])
    tolerance = tolerances(rough, lens, settings)
    planes = find_planes(rough, lens.rays, tolerance, settings.plane_area, settings.plane_side)
    found = [_people_of(k, stack, moved, margin, planes, lens, settings) for k in range(len(stack))]
    people = np.stack([mask for mask, _ in found])
    background = farthest_lasting(np.where(people, np.float32(0), stack), 0.0, lens, settings)
    margin, near = _margins(stack, background, lens, settings)
    count = near.sum(axis=0)
    still = (count >= STILL * np.maximum((stack > 0).sum(axis=0), 1)) & (background > 0)
    background[(near & people).sum(axis=0) > SOMEBODY * count] = 0.0
    figures = int(np.median([number for _, number in found]))
    return Surroundings(False, True, background, margin, still, tuple(planes), figures)


def farthest_lasting(stack: np.ndarray, share: float, lens: Lens, settings: PeopleSettings) -> np.ndarray:
    """The farthest depth of each pixel that at least `share` of its samples, and 2, agree on: float32 (h, w), 0 = none.

    `stack` float32 (K, h, w), metres, 0 = no sample.
    """
    ordered = np.sort(stack, axis=0)  # zeros first
    count = len(stack)
    needed = min(max(2, int(np.ceil(share * count))), count)
    found = np.zeros(stack.shape[1:], dtype=np.float32)
    for last in range(count - 1, needed - 2, -1):
        far, near = ordered[last], ordered[last - needed + 1]
        agree = (found == 0) & (near > 0) & (far - near <= 2 * tolerances(far, lens, settings))
        found = np.where(agree, ordered[last - needed // 2], found)
    return found


def _margins(
    stack: np.ndarray, background: np.ndarray, lens: Lens, settings: PeopleSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Metres before the background in which it may still be noise, float32 (h, w), and the samples that show it, bool
    (K, h, w).
    """
    tolerance = tolerances(background, lens, settings)
    near = (stack > 0) & (np.abs(stack - background) <= 2 * tolerance)
    count = np.maximum(near.sum(axis=0), 1)
    spread = np.sqrt((np.where(near, stack - background, np.float32(0)) ** 2).sum(axis=0) / count)
    return (tolerance + np.minimum(NOISE * spread, MOST_NOISE)).astype(np.float32), near


def _opened(mask: np.ndarray) -> np.ndarray:
    """Without what is thinner than 3 pixels: edges at which near and far take turns do not move."""
    import cv2

    return np.asarray(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0)


def _people_of(
    frame: int,
    stack: np.ndarray,
    moved: np.ndarray,
    margin: np.ndarray,
    planes: list[Plane],
    lens: Lens,
    settings: PeopleSettings,
) -> tuple[np.ndarray, int]:
    """Pixels of people in one of the frames, bool (h, w), and how many things look like people and never move.

    `moved` bool (K, h, w): what stands before the rough background.
    """
    depth = stack[frame]
    on = on_planes(depth, lens.rays, tolerances(depth, lens, settings), planes)
    view = lens.view(depth, (depth > 0) & ~on, np.asarray(~moved.any(axis=0)))
    people, others, labels = people_and_furniture(view, lens, settings)
    mask, figures = np.zeros(depth.shape, dtype=np.bool_), 0
    for k, place in enumerate([*people, *others], start=1):
        own, head = labels == k, near_head(view, place) & view.foreground
        if k > len(people):
            if np.count_nonzero(head & moved[frame]) > HEAD_MOVED * np.count_nonzero(head):
                mask |= own
        elif _alive(own, depth, stack, margin):
            mask |= own
        else:
            figures += 1
    return mask, figures


def _alive(own: np.ndarray, depth: np.ndarray, stack: np.ndarray, margin: np.ndarray) -> bool:
    """Whether a thing moves: its pixels `own` (h, w) show another depth close by in some other frame.

    Somebody who walks by before it is not close by.
    """
    changed = np.zeros(own.shape, dtype=np.bool_)
    for other in stack:
        away = np.abs(other - depth)
        changed |= _opened(own & (other > 0) & (away > margin) & (away < CLOSE_BY))
    return bool(np.count_nonzero(changed) >= ALIVE * np.count_nonzero(own))
