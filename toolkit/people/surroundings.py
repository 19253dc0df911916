"""Background model of a room, and the foreground of a frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from toolkit.io.archives import Column
from toolkit.people.detection import find_heads, near_head
from toolkit.people.structure import Plane, find_planes, on_planes
from toolkit.people.unassigned import surfaces
from toolkit.people.view import CoarseCamera

Metres = Annotated[np.ndarray, Column("f", ("height", "width"), 0, 1e3)]
Flags = Annotated[np.ndarray, Column("b", ("height", "width"))]
"""Images of a checkpoint."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Background model of a room at coarse resolution.

    Attributes
    ----------
    cut_out : the recording holds segmented people: a pixel without depth is free
    known : surfaces before it are people and what they carry; else furniture may be among them
    background : float32 (h, w), metres, 0 = unknown
    margin : float32 (h, w), metres by which a person must stand before the background
    planes : walls and floor
    floor : its y, level frame, metres; None where no floor is known
    still : bool (h, w), pixels without motion while the background was learnt; False where it was not learnt
    owned : bool (h, w), those of `still` that certainly belong to a person; None = none
    """

    cut_out: bool
    known: bool
    background: Metres
    margin: Metres
    still: Flags
    planes: tuple[Plane, ...] = ()
    floor: float | None = None
    owned: Flags | None = None

    @property
    def resting(self) -> np.ndarray:
        """Still pixels that are not background: of furniture, or of a motionless person: bool (h, w)."""
        return self.still & (self.background == 0)

    @property
    def unclaimed(self) -> np.ndarray:
        """Those of `still` that may be of furniture or of a person who touches it: bool (h, w)."""
        return self.resting if self.owned is None else self.resting & ~self.owned

    def foreground(self, depth: np.ndarray, rays: np.ndarray, tolerance: np.ndarray) -> np.ndarray:
        """Return the pixels of a coarse frame float32 (h, w) that are measured and not background: bool (h, w)."""
        known = self.background > 0
        before = (depth > 0) & (~known | (self.background - depth > self.margin))
        if self.planes:
            before &= ~on_planes(depth, rays, tolerance, list(self.planes))
        return before


def tolerances(depth: np.ndarray, coarse: CoarseCamera) -> np.ndarray:
    """Return the distance within which a pixel lies on a plane, metres, in the shape of `depth`."""
    plane_distance = 0.03  # m from a pixel to a wall or floor, besides the quantisation
    return np.asarray(plane_distance + coarse.quantisation * depth**2, dtype=np.float32)


def nothing_but_people(coarse: CoarseCamera) -> Surroundings:
    """Return the model of frames that hold segmented people."""
    empty = np.zeros(coarse.camera.shape, dtype=np.float32)
    return Surroundings(True, True, empty, empty, np.zeros(empty.shape, dtype=np.bool_))


def empty_scene(background: np.ndarray, coarse: CoarseCamera, margin: float) -> Surroundings:
    """Return the model of a recorded empty scene float32 (h, w), metres, with a margin in metres."""
    margins = margin + coarse.quantisation * background**2
    return Surroundings(False, True, background, margins.astype(np.float32), np.zeros(background.shape, dtype=np.bool_))


def is_cut_out(depth: np.ndarray, coarse: CoarseCamera) -> bool:
    """Return True if a coarse frame holds only people: mostly 0, no wall or floor, few surfaces without a head."""
    empty_share = 0.1  # fraction of zeros of a frame that is already segmented (recording format)
    if np.count_nonzero(depth == 0) < empty_share * depth.size:
        return False
    view = coarse.view(depth, depth > 0, np.zeros(depth.shape, dtype=np.bool_))
    labels, count, areas = surfaces(view, coarse, np.zeros(depth.shape, dtype=np.int32))
    headless = np.ones(count + 1, dtype=np.bool_)
    headless[0] = False
    for head in find_heads(view, coarse):
        headless[labels[near_head(view, head.place)]] = False
    largest_headless = 1.5  # m^2 of surfaces without a head where only people are measured: a lying, wide adult
    if areas[headless].sum() > largest_headless:
        return False
    return not _planes_of(depth, coarse)


def room_of(depth: np.ndarray, coarse: CoarseCamera) -> Surroundings:
    """Return a model without a background: walls and floor of one coarse frame float32 (h, w), metres."""
    empty = np.zeros(coarse.camera.shape, dtype=np.float32)
    planes = tuple(_planes_of(depth, coarse))
    return Surroundings(False, False, empty, empty, np.zeros(empty.shape, dtype=np.bool_), planes)


def first_look(depth: np.ndarray, coarse: CoarseCamera) -> Surroundings:
    """Return the model from a single coarse frame float32 (h, w), metres."""
    if is_cut_out(depth, coarse):
        return nothing_but_people(coarse)
    return room_of(depth, coarse)


def _planes_of(depth: np.ndarray, coarse: CoarseCamera) -> list[Plane]:
    tolerance = tolerances(depth, coarse)
    return find_planes(depth, coarse.rays, tolerance)
