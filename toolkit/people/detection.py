"""People in a single depth image: heads above shoulders, each with its connected surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.kernels.cloud.planes import best_plane
from toolkit.kernels.image.growth import FAR, grow, mark_seeds
from toolkit.kernels.image.heads import head_scores, mark_near, run_widths
from toolkit.people.view import CoarseCamera, View

# Places in metres (right, up) around the centre of a head that is 0.16 m wide and 0.23 m high (adults have 0.14 to
# 0.17, a child of three years 0.13).
INSIDE = np.array([(0, 0), (0.05, 0), (-0.05, 0), (0, 0.06), (0, -0.06), (0.045, 0.045), (-0.045, 0.045)])
_ANGLES = np.deg2rad([0, 30, 60, 90, 120, 150, 180])
AROUND = np.column_stack([0.17 * np.cos(_ANGLES), 0.20 * np.sin(_ANGLES)])
SHOULDERS = np.array([(x, y) for y in (-0.29, -0.36) for x in (-0.1, -0.05, 0.0, 0.05, 0.1)])
TOLERANCES = np.array([0.10, 0.12, 0.3, 0.1])  # m: head's depth, gap behind it, head to shoulders, head's radius
TEMPLATES = ((1.0, 1.0, 0.0), (0.85, 0.65, 0.95))
"""Scale of head and body against these, and the minimum score: an adult, and a child of a metre, whose shape a fist on
a forearm resembles."""
HEAD_DISTANCE = 0.25  # m between two heads, shoulder to shoulder and cheek to cheek
SHOULDER_DISTANCE = 0.3  # m aside from a head, of a shoulder
SURFACE_GAP = 0.05  # m of depth between neighbours on one surface, besides the quantisation: a torso's side, at 3 m
BRIDGE_CUT = 0.5  # m, largest depth step within a segmented person: an arm in front of the chest
BRIDGE_ROOM = 0.12  # m, the same in a room: below the distance between a person and a shelf behind
REACH_STILL = 0.6
"""Metres horizontally from the head of a person who has not moved yet: the knees of a seated one, without the chair."""
SEED_RADIUS = 0.12  # m around a head's centre that certainly belong to the head
CHEST_BAND = (-0.42, -0.28)  # m above the head's centre
CHEST_WIDTH = (0.2, 0.95)  # m: from a slim person seen from the side to an adult with spread elbows


@dataclass(frozen=True, eq=False)
class Head:
    """Head candidate: centre float64 (3,), level frame, metres; score, 0 to 1; True if only a child's head fits."""

    place: np.ndarray
    score: float
    small: bool


def find_heads(view: View, coarse: CoarseCamera, *, cut_out: bool) -> list[Head]:
    """Return the heads in a frame, the highest first; of several on one body only the highest.

    `cut_out`: unmeasured pixels are background, so they count as space beside a head.
    """
    scores, small = np.zeros(view.depth.shape, dtype=np.float32), np.zeros(view.depth.shape, dtype=np.bool_)
    head_score = 0.8  # minimum score of a head, of 1
    for size, body, least in TEMPLATES:
        scaled = np.empty(view.depth.shape, dtype=np.float32)
        places = (size * INSIDE, size * AROUND, body * SHOULDERS)
        unmeasured = 1.0 if cut_out else 0.5
        head_scores(
            view.depth, view.foreground, coarse.camera.intrinsics, coarse.up, *places, TOLERANCES, unmeasured, scaled
        )
        small |= (scaled >= least) & (scores < head_score) & (size < 1)
        np.maximum(scores, np.where(scaled >= least, scaled, 0), out=scores)
    plateau_share = 0.05  # fraction of the best score above which pixels define the head's centre
    rows = np.flatnonzero(scores.ravel() >= head_score - plateau_share)
    values, points = scores.ravel()[rows].astype(np.float64), view.points.reshape(-1, 3)[rows].astype(np.float64)
    child = small.ravel()[rows]
    heads: list[Head] = []
    while len(rows) and (best := values.max()) >= head_score:
        distance = np.sqrt(((points - points[int(values.argmax())]) ** 2).sum(axis=1))
        near = distance < HEAD_DISTANCE
        plateau = near & (values >= best - plateau_share)
        heads.append(Head(points[plateau].mean(axis=0), float(best), bool(child[plateau].all())))
        values, points, rows, child = values[~near], points[~near], rows[~near], child[~near]
    heads.sort(key=lambda h: -h.place[1])
    kept: list[Head] = []
    rivalry = 0.1  # score difference by which a head may be worse than the shoulder below it
    for head in heads:
        above = [o for o in kept if o.score >= head.score - rivalry]  # a raised fist does not remove a head
        if not any(_on_body_below(head.place, other.place) for other in above):
            kept.append(head)
    return kept


def _on_body_below(place: np.ndarray, head: np.ndarray) -> bool:
    """Return True if `place` is so close to the axis below `head` that it is a shoulder, an elbow or a knee."""
    aside, drop = float(np.hypot(place[0] - head[0], place[2] - head[2])), head[1] - place[1]
    least_drop = 0.1  # m from a head down to a shoulder with a head's score
    if drop < least_drop:
        return False
    # m from a head's axis to an elbow or a knee, and m below the head from which it applies
    body_distance, head_drop = 0.45, 0.5
    return aside < (SHOULDER_DISTANCE if drop < head_drop else body_distance)


def near_head(view: View, place: np.ndarray) -> np.ndarray:
    """Return the pixels of the head at `place` (3,), level frame, metres: bool (h, w)."""
    near = np.empty(view.depth.shape, dtype=np.bool_)
    mark_near(view.points, place.astype(np.float32), SEED_RADIUS, near)
    return near


def head_seeds(view: View, heads: Sequence[np.ndarray], seeds: np.ndarray) -> None:
    """Mark the pixels around heads in `seeds` int32 (h, w) with 1, 2, ..., where it is 0."""
    rows = np.array(heads, dtype=np.float64).reshape(-1, 3)
    mark_seeds(view.points, view.foreground, np.zeros(seeds.shape, dtype=np.int32), rows, SEED_RADIUS, 0.0, seeds)


def share_out(
    view: View, coarse: CoarseCamera, seeds: np.ndarray, heads: Sequence[np.ndarray], *, bridge: float
) -> np.ndarray:
    """Assign the foreground to the people whose seeds are nearest over the surface: int32 (h, w), 0 = background.

    Parameters
    ----------
    seeds : int32 (h, w), 1.. the people
    heads : (3,) each, level frame, metres; pixels beyond a person's reach are left out
    bridge : largest depth step within one person, metres
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
    steps = np.array([SURFACE_GAP, coarse.quantisation, bridge, bridge_cost, upright_cost])
    measured = np.where(view.foreground, view.depth, np.float32(0))
    longest_way = 2.5  # m over the surface from head to toe or fingertip
    grow(view.points, measured, seeds, np.array(heads), reach, limits, steps, longest_way, labels, distances)
    labels[distances == FAR] = 0
    return labels


def looks_like_person(view: View, coarse: CoarseCamera, mask: np.ndarray, head: np.ndarray) -> bool:
    """Return True if a surface has a head that is narrower than the chest below it, and is not flat."""
    shaped = any(_head_on_chest(view, mask, head, scale) for _, scale, _ in TEMPLATES)
    planar = 0.8  # fraction of a surface in one plane; people have 0.3 to 0.7, doors and cupboards 0.85 to 1
    open_share = 0.7  # fraction of the outline of head and chest, left and right, with farther depth behind it
    return shaped and _open_outline(view, mask, head) >= open_share and planar_share(view, coarse, mask) < planar


def _head_on_chest(view: View, mask: np.ndarray, head: np.ndarray, scale: float) -> bool:
    """Return True if a surface is narrow around a head's centre (3,) and wide below it, for a body of a `scale`."""
    head_band = (-0.06, 0.06)  # m above the head's centre
    across_head = float(np.median(_run_widths(view, mask, head, head_band, scale)))
    across_chest = float(np.max(_run_widths(view, mask, head, CHEST_BAND, scale)))
    head_width = (0.09, 0.36)  # m: from a child seen from the side to a hooded adult
    fits = head_width[0] <= across_head <= head_width[1] and CHEST_WIDTH[0] <= across_chest <= CHEST_WIDTH[1]
    narrowing = 1.1  # maximum ratio of head to chest width: 1.1 for a slim person with long hair seen from the side
    return fits and across_head <= narrowing * across_chest


def _run_widths(view: View, mask: np.ndarray, head: np.ndarray, band: tuple[float, float], scale: float) -> np.ndarray:
    """Return the width of a surface, metres / `scale`, in each image row between two heights above a head's centre.

    In each row the run nearest below the head counts. It ends at free space or at a depth step: a hand beside or before
    the head is another run.
    """
    widths = np.zeros(len(view.depth))
    lowest, highest = scale * band[0], scale * band[1]
    # m across and in depth between the pixels of one run; a hand beside the head is another run
    run_gap, run_step = 0.06, 0.2
    rows = run_widths(view.points, view.depth, mask, head, lowest, highest, run_gap, np.float32(run_step), widths)
    return widths[: max(rows, 1)] / scale


def _open_outline(view: View, mask: np.ndarray, head: np.ndarray) -> float:
    """Return the fraction of the lateral outline of head and chest at which the surface ends: 0 to 1.

    A part of a wall or of a cupboard continues beside its outline.
    """
    aside = np.hypot(view.points[..., 0] - head[0], view.points[..., 2] - head[2])
    upper = mask & (view.points[..., 1] > head[1] + CHEST_BAND[0]) & (aside < CHEST_WIDTH[1] / 2)
    ends, total = 0, 0
    open_step = 0.06  # m, minimum depth step at the outline
    for side in (-1, 1):
        beside = np.roll(view.depth, -side, axis=1)
        edge = upper & ~np.roll(mask, -side, axis=1)
        edge[:, -1 if side > 0 else 0] = False
        total += int(np.count_nonzero(edge))
        ends += int(np.count_nonzero(edge & ((beside == 0) | (beside > view.depth + open_step))))

    return ends / max(total, 1)


def planar_share(view: View, coarse: CoarseCamera, mask: np.ndarray) -> float:
    """Return the fraction of a surface's pixels in one plane, 0 to 1; 0 where noise makes every surface flat."""
    v, u = np.nonzero(mask)
    planar_samples, planar_triples = 800, 200
    picked = np.linspace(0, len(v) - 1, min(planar_samples, len(v))).astype(np.int64)
    points = view.points[v[picked], u[picked]].astype(np.float64)
    tolerances = 0.02 + coarse.quantisation / 2 * (points**2).sum(axis=1)
    flattest = 0.04  # m of tolerance, at 3.8 m; beyond, people are as flat as doors
    if np.median(tolerances) > flattest:
        return 0.0
    triples = np.random.default_rng(0).integers(0, len(points), (planar_triples, 3))
    return best_plane(points, tolerances, np.ones(len(points)), triples, np.zeros(4)) / len(points)
