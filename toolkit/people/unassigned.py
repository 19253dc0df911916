"""Unassigned components of the foreground: a hand before the body, a person without a visible head, or noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from toolkit.kernels.cloud.nearest import smallest_gap
from toolkit.kernels.image import components
from toolkit.people.detection import LEAST_CUT_OUT, LEAST_HEIGHT, REACH_STILL, SURFACE_GAP
from toolkit.people.view import CoarseCamera, View

LEAST_ISLAND = 0.003  # m^2 of a piece that is given to a person: half a hand
LARGEST_ISLAND = 0.15  # m^2: an arm with its hand, or a leg


def attach_islands(
    view: View,
    coarse: CoarseCamera,
    labels: np.ndarray,
    places: Sequence[np.ndarray],
    *,
    cut_out: bool,
) -> np.ndarray:
    """Return `labels` with the remaining components assigned to nearby people, a new array.

    A component of a person's size goes only to a person whose head is, or is expected, right above it.

    Parameters
    ----------
    labels : int32 (h, w), 1.. the people, 0 = none
    places : places of their heads, (3,) each, level frame, metres
    cut_out : the recording holds segmented people, so that a small component may be a child
    """
    pieces, count, areas = surfaces(view, coarse, labels)
    least_body = LEAST_CUT_OUT if cut_out else 0.12  # m^2 of a person without a detected head
    own_points = _people(view, labels)
    attached = labels.copy()
    for piece in range(1, count + 1):
        if areas[piece] < LEAST_ISLAND:
            continue
        mask = pieces == piece
        points = view.points[mask]
        height, width = (float(np.ptp(points[:, axis])) for axis in (1, 0))
        if areas[piece] >= least_body and height >= max(LEAST_HEIGHT, width / 2):
            asides = [_aside(points, place) for place in places]
            if asides and min(asides) < REACH_STILL:
                attached[mask] = 1 + int(np.argmin(asides))
        elif areas[piece] <= LARGEST_ISLAND:
            attached[mask] = _owner(own_points, points)
    return attached


def _people(view: View, labels: np.ndarray) -> dict[int, np.ndarray]:
    """Return sampled points (N, 3) of each person."""
    return {int(k): _sampled(view.points[labels == k]) for k in np.unique(labels[labels > 0])}


def _sampled(points: np.ndarray) -> np.ndarray:
    samples = 200  # points of either surface from which their gap is measured
    return points[:: max(1, len(points) // samples)].astype(np.float64)


def _owner(people: Mapping[int, np.ndarray], points: np.ndarray) -> int:
    """Return the person nearest to a component (N, 3), 0 if none is near."""
    samples = _sampled(points)
    gaps = {k: float(smallest_gap(own, samples)) for k, own in people.items()}
    nearest = min(gaps, key=lambda k: gaps[k], default=0)
    largest_gap = 0.5  # m from a component to its person (Baak 2013, 5.4.2)
    return nearest if nearest and gaps[nearest] <= largest_gap else 0


def _aside(points: np.ndarray, place: np.ndarray) -> float:
    """Return the horizontal distance from a component's centre to a head, metres; infinite above the head."""
    middle = np.median(points, axis=0)
    return float(np.hypot(middle[0] - place[0], middle[2] - place[2])) if middle[1] < place[1] else np.inf


def surfaces(view: View, coarse: CoarseCamera, labels: np.ndarray) -> tuple[np.ndarray, int, np.ndarray]:
    """Return unassigned connected surfaces of the foreground: labels int32 (h, w), count, areas in m^2 (n + 1,)."""
    height, width = labels.shape
    padded = np.zeros((height + 2, width + 2), dtype=np.uint16)
    padded[1:-1, 1:-1] = np.where(view.foreground & (labels == 0), np.rint(1000 * view.depth), 0)
    numbers = np.zeros(padded.shape, dtype=np.int32)
    parents = np.zeros(height * width + 2, dtype=np.int32)
    box = np.array([1, height + 1, 1, width + 1])
    gap, growth = 1000 * SURFACE_GAP, 1000 * coarse.quantisation
    count = int(components.label_components(padded, box, gap, growth, numbers, parents))
    pieces = numbers[1:-1, 1:-1]
    pixel_areas = view.depth.astype(np.float64) ** 2 / (coarse.camera.fx * coarse.camera.fy)
    return pieces, count, np.bincount(pieces.ravel(), pixel_areas.ravel(), minlength=count + 1)
