"""Background model learnt from frames with people in them, without an empty frame.

A pixel's background is the farthest depth that lasts. A motionless person's torso would become background, so heads
that score as people are left out first (`toolkit.people.hypothesis`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from toolkit.io.parts import Parts, whole
from toolkit.people.detection import near_head
from toolkit.people.hypothesis import (
    EvidenceSample,
    PersonClassifier,
    judged_head,
    log_odds,
    lowness,
    possible_height,
)
from toolkit.people.stills import hanging_on, people_and_furniture
from toolkit.people.structure import Plane, find_planes, on_planes
from toolkit.people.surroundings import NO_FIGURES, Surroundings, room_of, tolerances
from toolkit.people.view import CoarseCamera

FEWEST = 8  # frames from which anything is learnt; fewer show what stands there, not what stays
LASTING = 0.15  # of the samples, and at least 2, in which the room behind a person must be seen
MOSTLY = 0.5  # fraction of samples at the background's depth that show a person, above which the room there is unknown
OFTEN = 0.12  # of the samples in which a moving pixel differs; a person who walks by covers it in fewer
CLOSE_BY = 0.4  # m in depth, between one surface of a person and another that moves into its place
SAME_PLACE = 0.2  # m between the heads of one figure
HEAD_MOVED = 0.5  # of the pixels of what may be a head: it moved there
FIGURE = 0.5  # of the samples in which a thing that never moves has a person's shape, to be called a figure
STILL = 0.98  # fraction of samples with the same depth in a pixel without motion
ANOTHER_ROOM = 0.5  # of the pixels whose depth differs: two images show different rooms
NOISE = 3.0  # standard deviations of a pixel that stands before the room
MOST_NOISE = 0.3  # m that a pixel's noise may widen the margin
STANDS_WITHIN = 0.5  # m, horizontally, of the head of a person who stands: what is below it may be their legs
BELOW = 0.4  # m, horizontally, of a head that stays: what is likely a person's there, and nearer the floor, is theirs
ALONE = 0.1  # fraction of the samples with a person's legs in which the head is not found
JUDGED_SAMPLES = 8  # samples in which the classifier evaluates every pixel
PATCH = 5  # pixels across, over which its answers are averaged: a forearm's width at 2 m
LEAST_ODDS = -1.2  # of a still pixel that hangs on a person's head and is theirs: three in four of such pixels are


@dataclass(frozen=True, eq=False)
class HeadTrack:
    """Head candidate in one of the samples.

    Attributes
    ----------
    frame : number of the sample
    place : float64 (3,), the middle of the head, level frame, metres
    own : bool (h, w), surface connected to the head
    glimpse : evidence sample
    """

    frame: int
    place: np.ndarray
    own: np.ndarray
    glimpse: EvidenceSample


def learnt(
    frames: Sequence[np.ndarray],
    lens: CoarseCamera,
    judge: PersonClassifier | None,
    floor: float | None = None,
) -> Surroundings:
    """Learn the background from coarse frames float32 (h, w), metres, of one room, spread over time; at least one.

    `floor` is the y of the floor, metres, level frame, None if unknown.
    """
    return whole(learnt_parts(frames, lens, judge, floor))


def learnt_parts(
    frames: Sequence[np.ndarray],
    lens: CoarseCamera,
    judge: PersonClassifier | None,
    floor: float | None = None,
) -> Parts[Surroundings]:
    """Compute the same as `learnt` in parts: two for each frame, and some for all."""
    if len(frames) < FEWEST:
        return room_of(frames[0], lens)
    stack = np.stack(frames)
    rough = farthest_lasting(stack, LASTING, lens)
    rough_margin, same = _margins(stack, rough, lens)
    still = (same.sum(axis=0) >= STILL * np.maximum((stack > 0).sum(axis=0), 1)) & (rough > 0)
    moved = np.stack([_opened((depth > 0) & (rough - depth > rough_margin)) for depth in stack])
    tolerance = tolerances(rough, lens)
    yield
    planes = find_planes(rough, lens.rays, tolerance)
    seen: list[HeadTrack] = []
    for k in range(len(stack)):
        yield
        heads = yield from _seen(k, stack, moved, rough_margin, planes, lens, judge, floor)
        seen += [s for s in heads if possible_height(s.place, floor)]
    yield
    occupied, figures = np.zeros(stack.shape, dtype=np.bool_), [NO_FIGURES]
    people: list[HeadTrack] = []
    stays: list[list[HeadTrack]] = []
    for figure in _figures(seen):
        glimpses = [s.glimpse for s in figure]
        if log_odds(glimpses) > 0 or np.mean([g.moved for g in glimpses]) > HEAD_MOVED:
            people += figure
            for s in figure:
                occupied[s.frame] |= s.own
            if len(figure) >= FEWEST:
                stays.append(figure)
        elif sum(g.shaped for g in glimpses) > FIGURE * len(stack):
            figures.append(np.mean([[s.place for s in figure]], axis=1))
    background = farthest_lasting(np.where(occupied, np.float32(0), stack), 0.0, lens)
    yield
    margin, near = _margins(stack, background, lens)
    owned = background == 0  # a person's in all samples
    count = near.sum(axis=0)
    background[(near & occupied).sum(axis=0) > MOSTLY * count] = 0.0
    for figure in stays:  # whose head is not seen in all frames, but they are there
        background[sum(near[s.frame] & s.own for s in figure) > MOSTLY * len(figure)] = 0.0
    background[left_with(people, stack, near, background, lens)] = 0.0
    yield
    below = below_heads(people, near, background, lens)
    if judge is not None and (stays or below.any()):
        odds = yield from _judged(stack, lens, judge)
        likely, below = odds > LEAST_ODDS, below & (odds > 0)
        background[below], owned[below] = 0.0, True
        for figure in stays:
            furniture = still & ~likely & (sum(s.own for s in figure) > MOSTLY * len(figure))
            background[furniture], margin[furniture] = rough[furniture], rough_margin[furniture]
        for figure in stays:
            yield
            theirs = still & hanging(figure, people, stack, still, likely, planes, lens)
            background[theirs], owned[theirs] = 0.0, True
    return Surroundings(
        False, True, background, margin, still, tuple(planes), np.concatenate(figures), owned=still & owned
    )


def camera_moved(frames: Sequence[np.ndarray], lens: CoarseCamera) -> bool:
    """Return True if the two halves of coarse frames float32 (h, w), metres, show different rooms."""
    if len(frames) < 2 * FEWEST:
        return False
    stack = np.stack(frames)
    halves = (stack[: len(stack) // 2], stack[len(stack) // 2 :])
    before, after = (farthest_lasting(half, LASTING, lens) for half in halves)
    return _another_room(before, after, lens)


def rooms_differ(frames: Sequence[np.ndarray], lens: CoarseCamera) -> bool:
    """Return True if most pairs of consecutive coarse frames float32 (h, w), metres, show different rooms."""
    changed = [_another_room(before, after, lens) for before, after in pairwise(frames)]
    return 2 * sum(changed) > len(changed)


def _another_room(before: np.ndarray, after: np.ndarray, lens: CoarseCamera) -> bool:
    both = (before > 0) & (after > 0)
    margin = 2 * np.maximum(tolerances(before, lens), tolerances(after, lens))
    return share_of(np.abs(before - after) > margin, both) > ANOTHER_ROOM


def farthest_lasting(stack: np.ndarray, share: float, lens: CoarseCamera) -> np.ndarray:
    """Return the farthest depth that at least `share` of a pixel's samples, and 2, agree on: float32 (h, w), 0 = none.

    `stack` float32 (K, h, w), metres, 0 = no sample.
    """
    ordered = np.sort(stack, axis=0)  # zeros first
    count = len(stack)
    needed = min(max(2, int(np.ceil(share * count))), count)
    found = np.zeros(stack.shape[1:], dtype=np.float32)
    for last in range(count - 1, needed - 2, -1):
        far, near = ordered[last], ordered[last - needed + 1]
        agree = (found == 0) & (near > 0) & (far - near <= 2 * tolerances(far, lens))
        found = np.where(agree, ordered[last - needed // 2], found)
    return found


def _judged(stack: np.ndarray, lens: CoarseCamera, judge: PersonClassifier) -> Parts[np.ndarray]:
    """Return the mean log odds of a person, over samples and neighbours, of each pixel: float32 (h, w), 0 if
    unmeasured.
    """
    import cv2

    total, count = (np.zeros(stack.shape[1:], dtype=np.float32) for _ in range(2))
    for depth in stack[:: -(-len(stack) // JUDGED_SAMPLES)]:
        yield
        total += judge.log_odds(depth, lens.camera)
        count += depth > 0
    nearby, measured = (cv2.blur(image, (PATCH, PATCH)) for image in (total, count))
    return np.asarray(nearby / np.maximum(measured, 1.0 / PATCH**2))


def hanging(
    figure: Sequence[HeadTrack],
    people: Sequence[HeadTrack],
    stack: np.ndarray,
    still: np.ndarray,
    likely: np.ndarray,
    planes: list[Plane],
    lens: CoarseCamera,
) -> np.ndarray:
    """Return the surface connected to the head of a motionless person: bool (h, w), in the middle sample."""
    middle = figure[len(figure) // 2]
    depth = stack[middle.frame]
    on = on_planes(depth, lens.rays, tolerances(depth, lens), planes)
    view = lens.view(depth, (depth > 0) & ~on & likely, still)
    others = [s.place for s in people if s.frame == middle.frame and s is not middle]
    return hanging_on(view, lens, [middle.place, *others])[0]


def below_heads(
    people: Sequence[HeadTrack], near: np.ndarray, background: np.ndarray, lens: CoarseCamera
) -> np.ndarray:
    """Return the background pixels (h, w) that are below a head in most samples that show them: bool (h, w).

    `near` bool (K, h, w) are the samples that do.
    """
    there = np.zeros(background.shape, dtype=np.int32)
    for frame, below in _below(people, background, lens, BELOW):
        there += near[frame] & below
    return (background > 0) & (there >= FEWEST) & (there > MOSTLY * near.sum(axis=0))


def _below(
    people: Sequence[HeadTrack], background: np.ndarray, lens: CoarseCamera, aside: float
) -> Iterator[tuple[int, np.ndarray]]:
    """Yield for each sample with people the background pixels below and near a head: number, bool (h, w)."""
    points = lens.view(background, background > 0, background > 0).points
    for frame in sorted({s.frame for s in people}):
        below = np.zeros(background.shape, dtype=np.bool_)
        for place in (s.place for s in people if s.frame == frame):
            away = np.hypot(points[..., 0] - place[0], points[..., 2] - place[2])
            below |= (away < aside) & (points[..., 1] < place[1])
        yield frame, below


def left_with(
    people: Sequence[HeadTrack], stack: np.ndarray, near: np.ndarray, background: np.ndarray, lens: CoarseCamera
) -> np.ndarray:
    """Return the background pixels that are legs of `people`, separated from the head by a carried object: bool (h, w).

    These pixels are hardly ever visible except below a head, and a nearer surface covers them otherwise.

    Parameters
    ----------
    stack : float32 (K, h, w), metres, the samples
    near : bool (K, h, w), where they show the background
    background : float32 (h, w), metres, 0 = unknown
    """
    there, covered = (np.zeros(background.shape, dtype=np.int32) for _ in range(2))
    for frame, below in _below(people, background, lens, STANDS_WITHIN):
        there += near[frame] & below
        covered += ~below & ~near[frame] & (stack[frame] > 0) & (stack[frame] < background)
    unseen = near.sum(axis=0) - there
    return (background > 0) & (there > 0) & (unseen <= ALONE * there) & (covered >= OFTEN * len(stack))


def _margins(stack: np.ndarray, background: np.ndarray, lens: CoarseCamera) -> tuple[np.ndarray, np.ndarray]:
    """Return the noise margin of the background, float32 (h, w), metres, and the samples that show it, bool (K, h,
    w).
    """
    tolerance = tolerances(background, lens)
    near = (stack > 0) & (np.abs(stack - background) <= 2 * tolerance)
    count = np.maximum(near.sum(axis=0), 1)
    spread = np.sqrt((np.where(near, stack - background, np.float32(0)) ** 2).sum(axis=0) / count)
    return (tolerance + np.minimum(NOISE * spread, MOST_NOISE)).astype(np.float32), near


def _opened(mask: np.ndarray) -> np.ndarray:
    """Remove structures thinner than 3 pixels: edges where near and far alternate do not move."""
    import cv2

    return np.asarray(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0)


def _seen(
    frame: int,
    stack: np.ndarray,
    moved: np.ndarray,
    margin: np.ndarray,
    planes: list[Plane],
    lens: CoarseCamera,
    judge: PersonClassifier | None,
    floor: float | None,
) -> Parts[list[HeadTrack]]:
    """Return the head candidates of one sample. `moved` bool (K, h, w): surfaces before the rough background."""
    depth = stack[frame]
    on = on_planes(depth, lens.rays, tolerances(depth, lens), planes)
    view = lens.view(depth, (depth > 0) & ~on, np.asarray(~moved.any(axis=0)))
    people, others, labels = people_and_furniture(view, lens)
    found = []
    yield
    for k, place in enumerate([*people, *others], start=1):
        own, head = labels == k, near_head(view, place) & view.foreground
        changed = _changed(own | head, depth, stack, margin)
        glimpse = EvidenceSample(
            k <= len(people), share_of(moved[frame], head), share_of(changed, own), share_of(changed, head),
            judged_head(view, lens, place, judge), lowness(place, floor),
        )  # fmt: skip
        found.append(HeadTrack(frame, place, own, glimpse))
    return found


def _figures(seen: Sequence[HeadTrack]) -> list[list[HeadTrack]]:
    """Group head candidates by place."""
    figures: list[list[HeadTrack]] = []
    middles: list[np.ndarray] = []
    for s in seen:
        away = [float(np.sqrt(((s.place - middle) ** 2).sum())) for middle in middles]
        if away and min(away) < SAME_PLACE:
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


def _changed(own: np.ndarray, depth: np.ndarray, stack: np.ndarray, margin: np.ndarray) -> np.ndarray:
    """Return the pixels of `own` (h, w) that often show another depth close by in the other frames: bool (h, w).

    A person who walks past in front is neither close nor there for long.
    """
    changed = np.zeros(own.shape, dtype=np.int32)
    box = _box(own)
    for sample in stack:
        other = sample[box]
        away = np.abs(other - depth[box])
        changed[box] += _opened(own[box] & (other > 0) & (away > margin[box]) & (away < CLOSE_BY))
    return np.asarray(changed >= OFTEN * len(stack))


def _box(mask: np.ndarray) -> tuple[slice, slice]:
    """Return the bounding box of a mask (h, w), one pixel larger, as rows and columns; everything for an empty mask."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if len(rows) == 0:
        return slice(None), slice(None)
    return slice(max(rows[0] - 1, 0), rows[-1] + 2), slice(max(columns[0] - 1, 0), columns[-1] + 2)
