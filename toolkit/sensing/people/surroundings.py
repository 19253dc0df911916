"""What is known of the room: nothing but people measured, an empty scene, or what frames with people tell of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.sensing.people.detection import find_heads, head_seeds, looks_like_person, share_out
from toolkit.sensing.people.settings import PeopleSettings
from toolkit.sensing.people.structure import Plane, find_planes, on_planes
from toolkit.sensing.people.view import Lens, View

EMPTY_SHARE = 0.1  # of a frame is 0 where it is already cut out (recording format)
LASTING = 0.15  # of the samples, and at least 2, in which the room behind somebody must be seen
STILL = 0.98  # of the samples in which a pixel shows the same depth where nothing moves
KNEES = 0.3  # m horizontally, within which what looks like a person below a head are the legs of that person
NOISE = 3.0  # standard deviations of a pixel that stands before the room
MOST_NOISE = 0.3  # m that a pixel's noise may widen the margin


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The room as the coarse image sees it.

    Attributes
    ----------
    cut_out : the source measures nothing but people: a pixel without depth is free
    known : what is before it can only be people and what they carry; else furniture may be among them
    background : float32 (h, w), metres, 0 = not known
    margin : float32 (h, w), metres by which somebody must stand before the background
    planes : walls and floor
    still : bool (h, w), pixels in which nothing moved while the room was learnt; False where it was not
    """

    cut_out: bool
    known: bool
    background: np.ndarray
    margin: np.ndarray
    still: np.ndarray
    planes: tuple[Plane, ...] = ()

    def export_state(self) -> dict[str, Any]:
        """All of it as arrays and numbers."""
        rows = [(*p.normal, p.offset, p.area) for p in self.planes]
        return {
            "cut_out": self.cut_out,
            "known": self.known,
            "background": self.background,
            "margin": self.margin,
            "still": self.still,
            "planes": np.array(rows, dtype=np.float64).reshape(-1, 5),
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> Surroundings:
        """From what `export_state` gave."""
        planes = tuple(Plane(row[:3], float(row[3]), float(row[4])) for row in state["planes"])
        arrays = (state["background"], state["margin"], state["still"])
        return cls(bool(state["cut_out"]), bool(state["known"]), *arrays, planes)

    def foreground(self, depth: np.ndarray, rays: np.ndarray, tolerance: np.ndarray) -> np.ndarray:
        """Pixels of a coarse frame float32 (h, w) that are measured and not known to be the room: bool (h, w)."""
        known = self.background > 0
        before = (depth > 0) & (~known | (self.background - depth > self.margin))
        if self.planes:
            before &= ~on_planes(depth, rays, tolerance, list(self.planes))
        return before


def tolerances(depth: np.ndarray, lens: Lens, settings: PeopleSettings) -> np.ndarray:
    """Metres within which a pixel lies on a plane, as `depth`."""
    return np.asarray(settings.plane_distance + lens.quantisation * depth**2, dtype=np.float32)


def nothing_but_people(lens: Lens) -> Surroundings:
    """Surroundings of frames that are already cut out."""
    empty = np.zeros(lens.camera.shape, dtype=np.float32)
    return Surroundings(True, True, empty, empty, np.zeros(empty.shape, dtype=np.bool_))


def empty_scene(background: np.ndarray, lens: Lens, margin: float) -> Surroundings:
    """Surroundings whose empty scene was recorded: float32 (h, w), metres; `margin` in metres before it."""
    margins = margin + lens.quantisation * background**2
    return Surroundings(False, True, background, margins.astype(np.float32), np.zeros(background.shape, dtype=np.bool_))


def is_cut_out(depth: np.ndarray, lens: Lens, settings: PeopleSettings) -> bool:
    """Whether a coarse frame holds nothing but people: much of it is 0 and no wall or floor is in it."""
    if np.count_nonzero(depth == 0) < EMPTY_SHARE * depth.size:
        return False
    return not find_planes(
        depth, lens.rays, tolerances(depth, lens, settings), settings.plane_area, settings.plane_side
    )


def first_look(depth: np.ndarray, lens: Lens, settings: PeopleSettings) -> Surroundings:
    """Surroundings as far as a single coarse frame float32 (h, w), metres, tells."""
    return nothing_but_people(lens) if is_cut_out(depth, lens, settings) else learnt([depth], lens, settings)


def learnt(frames: Sequence[np.ndarray], lens: Lens, settings: PeopleSettings) -> Surroundings:
    """Surroundings from coarse frames (h, w) of the same place with people in it, spread over time.

    A pixel's background is the farthest depth that lasts. Who was there in all frames is part of it at first: what
    looks like a person in the background is taken out again, so that those pixels are not known. With a single frame
    nothing is known but the planes.
    """
    stack = np.stack(frames)
    farthest = _farthest_lasting(stack, lens, settings)
    tolerance = tolerances(farthest, lens, settings)
    planes = find_planes(farthest, lens.rays, tolerance, settings.plane_area, settings.plane_side)
    if len(frames) < 2:
        empty = np.zeros(lens.camera.shape, dtype=np.float32)
        return Surroundings(False, False, empty, empty, np.zeros(empty.shape, dtype=np.bool_), tuple(planes))
    measured = stack > 0
    near = measured & (np.abs(stack - farthest) <= 2 * tolerance)
    count = np.maximum(near.sum(axis=0), 1)
    spread = np.sqrt((np.where(near, stack - farthest, 0.0) ** 2).sum(axis=0) / count)
    margin = (tolerance + np.minimum(NOISE * spread, MOST_NOISE)).astype(np.float32)
    still = (near.sum(axis=0) >= STILL * np.maximum(measured.sum(axis=0), 1)) & (farthest > 0)
    known = np.where(_people_in(farthest, planes, lens, settings), np.float32(0), farthest)
    return Surroundings(False, True, known, margin, still, tuple(planes))


def _farthest_lasting(stack: np.ndarray, lens: Lens, settings: PeopleSettings) -> np.ndarray:
    """The farthest depth of each pixel that at least `LASTING` of its samples agree on, float32 (h, w), 0 = none."""
    ordered = np.sort(stack, axis=0)  # zeros first
    count = len(stack)
    needed = min(max(2, int(np.ceil(LASTING * count))), count)
    found = np.zeros(stack.shape[1:], dtype=np.float32)
    for last in range(count - 1, needed - 2, -1):
        far, near = ordered[last], ordered[last - needed + 1]
        agree = (found == 0) & (near > 0) & (far - near <= 2 * tolerances(far, lens, settings))
        found = np.where(agree, ordered[last - needed // 2], found)
    return found


def _people_in(background: np.ndarray, planes: list[Plane], lens: Lens, settings: PeopleSettings) -> np.ndarray:
    """Pixels of a background that look like people who never went away: bool (h, w)."""
    on = on_planes(background, lens.rays, tolerances(background, lens, settings), planes)
    view = lens.view(background, (background > 0) & ~on, np.ones(on.shape, dtype=np.bool_))
    people, _, labels = people_and_furniture(view, lens, settings)
    return np.asarray((labels > 0) & (labels <= len(people)))


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


def large_enough(view: View, lens: Lens, mask: np.ndarray, settings: PeopleSettings) -> bool:
    """Whether a surface has a person's area and height."""
    if lens.area(view.depth[mask]) < settings.least_area:
        return False
    heights = view.points[mask][:, 1]
    return bool(np.ptp(heights) >= settings.least_height)
