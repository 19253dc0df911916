"""Heads in a depth image by the person network, each with its connected surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.kernels.image.growth import FAR, grow, mark_near, mark_seeds
from toolkit.people.evidence import person_score
from toolkit.people.view import CoarseCamera, View

HEAD_DISTANCE = 0.25  # m between two heads, shoulder to shoulder and cheek to cheek
SHOULDER_DISTANCE = 0.3  # m aside from a head, of a shoulder
SURFACE_GAP = 0.05  # m of depth between neighbours on one surface, besides the quantisation: a torso's side, at 3 m
BRIDGE = 0.5  # m, largest depth step within a person: an arm in front of the chest
REACH_STILL = 0.6
"""Metres horizontally from the head of a person who has not moved yet: the knees of a seated one, without the chair."""
SEED_RADIUS = 0.12  # m around a head's centre that certainly belong to the head
LEAST_CUT_OUT = 0.03  # m^2 of a person where only people are measured: one of half a metre
LEAST_HEIGHT = 0.35  # m, minimum height of a person: head and chest of a child


@dataclass(frozen=True, eq=False)
class Head:
    """Head candidate: centre float64 (3,), level frame, metres; log-odds of a person, see `person_score`."""

    place: np.ndarray
    score: float


LEAST_PEAK = -1.2
"""Log-odds of a head below which a peak is no candidate: annotated real rooms have 2.5 false ones in a frame."""


def find_heads(view: View, coarse: CoarseCamera, least: float = LEAST_PEAK) -> list[Head]:
    """Return the head candidates in the foreground of a frame, the most probable first, `HEAD_DISTANCE` apart.

    `least` is the smallest log-odds of a head at a candidate.
    """
    import cv2

    around = 2  # pixels of the network that a peak exceeds: both cells beside it
    peaks = coarse.head_odds(view.depth)
    largest = cv2.dilate(peaks, np.ones((2 * around + 1, 2 * around + 1), np.uint8))
    rows, columns = np.nonzero((peaks == largest) & (peaks >= least))
    heads: list[Head] = []
    for k in np.argsort(-peaks[rows, columns], kind="stable"):
        place = _centre(view, coarse, int(rows[k]), int(columns[k]))
        if place is None or any(((place - other.place) ** 2).sum() < HEAD_DISTANCE**2 for other in heads):
            continue
        score = head_score(view, coarse, place)
        if score is not None:
            heads.append(Head(place, score))
    return sorted(heads, key=lambda head: -head.score)


def _centre(view: View, coarse: CoarseCamera, row: int, column: int) -> np.ndarray | None:
    """Return the place (3,) of a head whose centre is at a pixel, level frame; None without foreground around it."""
    side = 4  # pixels around the centre: a head at 6 m
    rows, columns = view.depth.shape
    window = np.s_[
        max(row - side, 0) : min(row + side + 1, rows), max(column - side, 0) : min(column + side + 1, columns)
    ]
    measured, depth = view.foreground[window], view.depth[window]
    if not measured.any():
        return None
    v, u = np.mgrid[window]
    aside = np.hypot(v - row, u - column) * np.median(depth[measured]) / coarse.camera.fx
    near = measured & (aside < SEED_RADIUS)
    likely = near & (coarse.person_odds(view.depth)[window] > 0)
    chosen = next(mask for mask in (likely, near, measured) if mask.any())
    z = float(np.median(depth[chosen]))
    camera = coarse.camera
    return coarse.to_level(np.array([[(column - camera.cx) / camera.fx * z, (row - camera.cy) / camera.fy * z, z]]))[0]


def head_score(view: View, coarse: CoarseCamera, place: np.ndarray) -> float | None:
    """Return the log-odds of a person with a head at a place (3,), level frame; None without foreground there."""
    found = peak_and_odds(view, coarse, place)
    return None if found is None else person_score(*found)


def peak_and_odds(view: View, coarse: CoarseCamera, place: np.ndarray) -> tuple[float, float] | None:
    """Return the largest log-odds of a head and the mean log-odds of a person around a place, see `head_score`."""
    near = near_head(view, place) & view.foreground
    if not near.any():
        return None
    peak = float(coarse.head_odds(view.depth)[near].max())
    return peak, float(coarse.person_odds(view.depth)[near].mean(dtype=np.float64))


def near_head(view: View, place: np.ndarray) -> np.ndarray:
    """Return the pixels of the head at `place` (3,), level frame, metres: bool (h, w)."""
    near = np.empty(view.depth.shape, dtype=np.bool_)
    mark_near(view.points, place.astype(np.float32), SEED_RADIUS, near)
    return near


def head_seeds(view: View, heads: Sequence[np.ndarray], seeds: np.ndarray) -> None:
    """Mark the pixels around heads in `seeds` int32 (h, w) with 1, 2, ..., where it is 0."""
    rows = np.array(heads, dtype=np.float64).reshape(-1, 3)
    mark_seeds(view.points, view.foreground, np.zeros(seeds.shape, dtype=np.int32), rows, SEED_RADIUS, 0.0, seeds)


def share_out(view: View, coarse: CoarseCamera, seeds: np.ndarray, heads: Sequence[np.ndarray]) -> np.ndarray:
    """Assign the foreground to the people whose seeds are nearest over the surface: int32 (h, w), 0 = background.

    Parameters
    ----------
    seeds : int32 (h, w), 1.. the people
    heads : (3,) each, level frame, metres; pixels beyond a person's reach are left out
    """
    labels = np.zeros(seeds.shape, dtype=np.int32)
    if len(heads) == 0:
        return labels
    distances = np.empty(seeds.shape, dtype=np.int32)
    head_reach = 1.1  # m horizontally from the head to the fingertip of a leaning tall adult
    reach = np.where(view.still, REACH_STILL, head_reach).astype(np.float32)
    reach_up = 0.85  # m from the head's centre to the fingertip of a raised arm
    reach_down = 2.0  # m from the head's centre to the sole of a person of 2.1 m
    limits = np.array([reach_up, reach_down])
    bridge_cost = 3.0  # cost of a step across a gap relative to one on the surface
    upright_cost = 0.5  # cost of a vertical step relative to a horizontal one when people share pixels
    steps = np.array([SURFACE_GAP, coarse.quantisation, BRIDGE, bridge_cost, upright_cost])
    measured = np.where(view.foreground, view.depth, np.float32(0))
    longest_way = 2.5  # m over the surface from head to toe or fingertip
    grow(view.points, measured, seeds, np.array(heads), reach, limits, steps, longest_way, labels, distances)
    labels[distances == FAR] = 0
    return labels


def connected_surfaces(view: View, coarse: CoarseCamera, heads: Sequence[np.ndarray]) -> np.ndarray:
    """Return the surfaces connected to heads, which share the foreground: labels int32 (h, w), 0 = none."""
    seeds = np.zeros(view.depth.shape, dtype=np.int32)
    head_seeds(view, heads, seeds)
    return share_out(view, coarse, seeds, heads)


def large_enough(view: View, coarse: CoarseCamera, mask: np.ndarray, *, cut_out: bool = False) -> bool:
    """Return True if a surface has a person's area and height; `cut_out`: the recording holds segmented people."""
    least_area = 0.06  # m^2 of a person: head and chest of a child behind a table
    if coarse.area(view.depth[mask]) < (LEAST_CUT_OUT if cut_out else least_area):
        return False
    heights = view.points[mask][:, 1]
    return bool(np.ptp(heights) >= LEAST_HEIGHT)
