"""Background model learnt from frames with people in them, without an empty frame.

A pixel's background is the farthest depth that lasts. A motionless person's torso would become background, so heads
that score as people are left out first (`toolkit.people.evidence`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from toolkit.io.parts import Parts, whole
from toolkit.people.detection import connected_surfaces, find_heads, near_head
from toolkit.people.evidence import Evidence, possible_height
from toolkit.people.structure import Plane, find_planes, on_planes
from toolkit.people.surroundings import Surroundings, room_of, tolerances
from toolkit.people.view import CoarseCamera, View

FEWEST = 8  # frames from which anything is learnt; fewer show what stands there, not what stays
LASTING = 0.15  # of the samples, and at least 2, in which the room behind a person must be seen
MOSTLY = 0.5  # fraction of samples at the background's depth that show a person, above which the room there is unknown


@dataclass(frozen=True, eq=False)
class HeadTrack:
    """Head candidate in one of the samples.

    Attributes
    ----------
    frame : number of the sample
    place : float64 (3,), the middle of the head, level frame, metres
    own : bool (h, w), pixels of the person if it is one, see `person_pixels`
    score, moved : of the head, see `Evidence`
    """

    frame: int
    place: np.ndarray
    own: np.ndarray
    score: float
    moved: float


def learnt(
    frames: Sequence[np.ndarray],
    coarse: CoarseCamera,
    floor: float | None = None,
) -> Surroundings:
    """Learn the background from coarse frames float32 (h, w), metres, of one room, spread over time; at least one.

    `floor` is the y of the floor, metres, level frame, None if unknown.
    """
    return whole(learnt_parts(frames, coarse, floor))


def learnt_parts(
    frames: Sequence[np.ndarray],
    coarse: CoarseCamera,
    floor: float | None = None,
) -> Parts[Surroundings]:
    """Compute the same as `learnt` in parts: two for each frame, and some for all."""
    if len(frames) < FEWEST:
        return room_of(frames[0], coarse)
    stack = np.stack(frames)
    rough = farthest_lasting(stack, LASTING, coarse)
    rough_margin, same = _margins(stack, rough, coarse)
    still_share = 0.98  # of samples with the same depth in a pixel without motion
    still = (same.sum(axis=0) >= still_share * np.maximum((stack > 0).sum(axis=0), 1)) & (rough > 0)
    moved = (stack > 0) & (rough - stack > rough_margin)
    tolerance = tolerances(rough, coarse)
    yield
    planes = find_planes(rough, coarse.rays, tolerance)
    seen: list[HeadTrack] = []
    for k in range(len(stack)):
        yield
        seen += yield from _seen(k, stack, moved, planes, coarse, floor)
    yield
    occupied = np.zeros(stack.shape, dtype=np.bool_)
    in_place: list[list[HeadTrack]] = []
    for figure in _figures(seen):
        evidence = Evidence()
        for s in figure:
            evidence = evidence.after(s.score, s.moved)
        moves = 2 * evidence.moved > evidence.looks  # most of the head
        if evidence.log_odds > 0 or moves:
            for s in figure:
                occupied[s.frame] |= s.own
            if moves and FEWEST <= len(figure) <= MOSTLY * len(stack):
                in_place.append(figure)
    background = farthest_lasting(np.where(occupied, np.float32(0), stack), 0.0, coarse)
    yield
    margin, near = _margins(stack, background, coarse)
    background[(near & occupied).sum(axis=0) > MOSTLY * near.sum(axis=0)] = 0.0
    for figure in in_place:  # people who move, with a head in at most half of the samples
        background[sum(near[s.frame] & s.own for s in figure) > MOSTLY * len(figure)] = 0.0
    owned = still & occupied.any(axis=0) & (background == 0)
    return Surroundings(False, True, background, margin, still, tuple(planes), owned=owned)


def person_pixels(view: View, connected: np.ndarray, place: np.ndarray, odds: np.ndarray) -> np.ndarray:
    """Return the pixels of the person with a head at `place` (3,), if it is one: bool (h, w).

    They are connected to the head, or lie around and below it (legs behind a carried box or a desk), and are nearly as
    probable as the head. `odds` (h, w) are the log-odds of a person.
    """
    aside = np.hypot(view.points[..., 0] - place[0], view.points[..., 2] - place[2])
    head_top = 0.3  # m from a head's centre to above its hair
    radius = 0.4  # m, horizontally, around a head: likely pixels below it are the person's
    below = (view.depth > 0) & (aside < radius) & (view.points[..., 1] < place[1] + head_top)
    relative = 0.25  # least log-odds of a person's pixel relative to the head's: a chair has about 0.2
    head = near_head(view, place) & (view.depth > 0)
    least = relative * max(float(odds[head].mean(dtype=np.float64)), 0.0) if head.any() else 0.0
    return np.asarray((connected | below) & (odds > least))


def camera_moved(frames: Sequence[np.ndarray], coarse: CoarseCamera) -> bool:
    """Return True if the two halves of coarse frames float32 (h, w), metres, show different rooms."""
    if len(frames) < 2 * FEWEST:
        return False
    stack = np.stack(frames)
    halves = (stack[: len(stack) // 2], stack[len(stack) // 2 :])
    before, after = (farthest_lasting(half, LASTING, coarse) for half in halves)
    return _another_room(before, after, coarse)


def rooms_differ(frames: Sequence[np.ndarray], coarse: CoarseCamera) -> bool:
    """Return True if most pairs of consecutive coarse frames float32 (h, w), metres, show different rooms."""
    changed = [_another_room(before, after, coarse) for before, after in pairwise(frames)]
    return 2 * sum(changed) > len(changed)


def _another_room(before: np.ndarray, after: np.ndarray, coarse: CoarseCamera) -> bool:
    both = (before > 0) & (after > 0)
    margin = 2 * np.maximum(tolerances(before, coarse), tolerances(after, coarse))
    changed_share = 0.5  # of the pixels of two images with different depth, above which they show different rooms
    return share_of(np.abs(before - after) > margin, both) > changed_share


def farthest_lasting(stack: np.ndarray, share: float, coarse: CoarseCamera) -> np.ndarray:
    """Return the farthest depth that at least `share` of a pixel's samples, and 2, agree on: float32 (h, w), 0 = none.

    `stack` float32 (K, h, w), metres, 0 = no sample.
    """
    ordered = np.sort(stack, axis=0)  # zeros first
    count = len(stack)
    needed = min(max(2, int(np.ceil(share * count))), count)
    found = np.zeros(stack.shape[1:], dtype=np.float32)
    for last in range(count - 1, needed - 2, -1):
        far, near = ordered[last], ordered[last - needed + 1]
        agree = (found == 0) & (near > 0) & (far - near <= 2 * tolerances(far, coarse))
        found = np.where(agree, ordered[last - needed // 2], found)
    return found


def _margins(stack: np.ndarray, background: np.ndarray, coarse: CoarseCamera) -> tuple[np.ndarray, np.ndarray]:
    """Return the noise margin of the background (h, w), metres, and the samples that show it, bool (K, h, w)."""
    tolerance = tolerances(background, coarse)
    near = (stack > 0) & (np.abs(stack - background) <= 2 * tolerance)
    count = np.maximum(near.sum(axis=0), 1)
    spread = np.sqrt((np.where(near, stack - background, np.float32(0)) ** 2).sum(axis=0) / count)
    deviations = 3.0  # standard deviations of a pixel in front of the background
    most_noise = 0.3  # m that a pixel's noise may widen the margin
    return (tolerance + np.minimum(deviations * spread, most_noise)).astype(np.float32), near


def _seen(
    frame: int,
    stack: np.ndarray,
    moved: np.ndarray,
    planes: list[Plane],
    coarse: CoarseCamera,
    floor: float | None,
) -> Parts[list[HeadTrack]]:
    """Return the head candidates of one sample. `moved` bool (K, h, w): surfaces before the rough background."""
    depth = stack[frame]
    on = on_planes(depth, coarse.rays, tolerances(depth, coarse), planes)
    view = coarse.view(depth, (depth > 0) & ~on, np.asarray(~moved.any(axis=0)))
    least = -2.0  # log-odds of a head: improbable candidates keep the surfaces of furniture apart from people
    heads = [head for head in find_heads(view, coarse, least) if possible_height(head.place, floor)]
    labels = connected_surfaces(view, coarse, [head.place for head in heads])
    yield
    odds = coarse.person_odds(depth)
    found = []
    for k, head in enumerate(heads, start=1):
        share = share_of(moved[frame], near_head(view, head.place) & view.foreground)
        own = person_pixels(view, labels == k, head.place, odds)
        found.append(HeadTrack(frame, head.place, own, head.score, share))
    return found


def _figures(seen: Sequence[HeadTrack]) -> list[list[HeadTrack]]:
    """Group head candidates by place."""
    figures: list[list[HeadTrack]] = []
    middles: list[np.ndarray] = []
    same_place = 0.2  # m between the heads of one figure
    for s in seen:
        away = [float(np.sqrt(((s.place - middle) ** 2).sum())) for middle in middles]
        if away and min(away) < same_place:
            k = int(np.argmin(away))
            figures[k].append(s)
            middles[k] = np.mean([other.place for other in figures[k]], axis=0)
        else:
            figures.append([s])
            middles.append(s.place)
    return figures


def share_of(mask: np.ndarray, among: np.ndarray) -> float:
    """Return the fraction of the pixels `among` (h, w) that are in `mask`."""
    return float(np.count_nonzero(mask & among)) / max(int(np.count_nonzero(among)), 1)
