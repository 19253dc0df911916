"""The size of a person seen from the waist up, read off silhouettes and geodesic paths (Lopez-Mendez 2011, 3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.fitting.arms import SIDES
from toolkit.kernels import linear
from toolkit.sensing.cloud import Cloud
from toolkit.trackers.lopez2011.upper import arm_of

BREADTH_NOISE, ARM_NOISE = 0.04, 0.09
"""Metres: standard deviations of the two measurements of a person's size, as their medians over a take."""
FLESH = 0.02
"""Metres by which a silhouette is broader at the shoulders than the distance of their joints."""
HIDDEN = 0.10
"""Metres of an arm before the point at which its path bends, below the shoulder."""
BIN = 0.01
"""Metres of height of a row in which widths are counted."""
SMOOTH = 5
"""Rows that are averaged."""
HEAD = 0.16
"""Metres below the crown from which on shoulders are looked for: the crown itself widens faster."""
LOWEST = 0.45
"""Metres below the crown down to which they are."""
STEEPEST = 1.0
"""Metres of width per metre of height from which on a maximum is prominent."""
SHOULDER_ROWS = 0.06
"""Metres below the maximum over which the outermost points are taken."""
BREADTHS = (0.25, 0.60)
"""Metres: breadths of the silhouette that are possible; with arms raised it is broader."""
STEP = 0.02
"""Metres between the points of a path at which its curvature is taken."""
BEND = (0.25, 0.50)
"""Shares of a path's length between which it bends round the shoulder."""
ARMS = (0.45, 0.85)
"""Metres: lengths of an arm that are possible."""


def sized_body(breadths: Sequence[float], arms: Sequence[float]) -> Body | None:
    """The likeliest body of the shape space for measured shoulder breadths and arm lengths, metres; None without any.

    Both are linear in the coefficients to good approximation, and the coefficients are Gaussian: given the medians of
    the measurements, without outliers, the body is their conditional mean.
    """
    space = ShapeSpace.load()
    measured = [
        (_settled(values), noise, read)
        for values, noise, read in ((breadths, BREADTH_NOISE, _breadth), (arms, ARM_NOISE, _arm))
        if len(values)
    ]
    if not measured:
        return None
    mean = space.body()
    rows = [[read(space.body(unit)) - read(mean) for unit in np.eye(space.size)] for _, _, read in measured]
    change = np.array(rows)
    noise = np.diag([sigma**2 for _, sigma, _ in measured])
    away = np.array([value - read(mean) for value, _, read in measured])
    gain = linear.solved(linear.gram(change.T.copy(), np.ones(space.size)) + noise, away)
    return space.body(linear.combined(gain, change))


def _settled(values: Sequence[float]) -> float:
    """Mean of the values within one standard deviation of their median (Lopez-Mendez 2011, 3)."""
    array = np.array(values)
    near = np.abs(array - np.median(array)) <= array.std() + 1e-9
    return float(array[near].mean())


def _breadth(body: Body) -> float:
    left, right = (body.joints[skeleton.JOINT_NAMES.index(f"{side}_shoulder")] for side in SIDES)
    return float(left[0] - right[0]) + FLESH


def _arm(body: Body) -> float:
    arm = arm_of("left", body)
    return float(linear.lengths(np.stack([arm.bones.upper, arm.fore, arm.hand])).sum()) - HIDDEN


def shoulder_breadth(cloud: Cloud) -> float | None:
    """Breadth of the silhouette at the shoulders, metres, of an upright person with the arms down; None without one.

    The shoulders are where the width over the rows first grows fastest below the head.
    """
    if len(cloud) == 0:
        return None
    x, y = cloud.points[:, 0].astype(np.float64), cloud.points[:, 1].astype(np.float64)
    rows = ((y.max() - y) / BIN).astype(np.int64)
    count = int(LOWEST / BIN)
    left, right = np.full(count, np.inf), np.full(count, -np.inf)
    inside = rows < count
    np.minimum.at(left, rows[inside], x[inside])
    np.maximum.at(right, rows[inside], x[inside])
    known = np.isfinite(left)
    if known.sum() < count // 2:
        return None
    widths = np.interp(np.arange(count), np.flatnonzero(known), (right - left)[known])
    smooth = np.convolve(np.pad(widths, SMOOTH // 2, mode="edge"), np.full(SMOOTH, 1.0 / SMOOTH), mode="valid")
    growth = np.gradient(smooth, BIN)
    for row in range(int(HEAD / BIN), count - 1):
        if growth[row] >= max(growth[row - 1], growth[row + 1], STEEPEST):
            breadth = float(np.median(widths[row : row + int(SHOULDER_ROWS / BIN)]))
            return breadth if BREADTHS[0] <= breadth <= BREADTHS[1] else None
    return None


def arm_length(path: np.ndarray) -> float | None:
    """Length of an arm, metres, from the path (k, 3) that leads from the trunk to its hand; None where it has no bend.

    Beyond the point of largest curvature between a quarter and a half of the path, as seen in the image, the path runs
    along the arm.
    """
    steps = np.sqrt((np.diff(path, axis=0) ** 2).sum(axis=1))
    along = np.concatenate([[0.0], np.cumsum(steps)])
    count = int(along[-1] / STEP) + 1
    if count < 8:
        return None
    places = np.linspace(0.0, along[-1], count)
    plane = np.stack([np.interp(places, along, path[:, axis]) for axis in (0, 1)], axis=1)
    span = max(count // 10, 1)
    back, ahead = plane[span:-span] - plane[: -2 * span], plane[2 * span :] - plane[span:-span]
    turns = np.abs(np.arctan2(back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], (back * ahead).sum(axis=1)))
    shares = places[span:-span] / along[-1]
    allowed = (shares >= BEND[0]) & (shares <= BEND[1])
    if not allowed.any():
        return None
    bend = int(np.argmax(np.where(allowed, turns, -1.0)))
    length = float(along[-1] * (1.0 - shares[bend]))
    return length if ARMS[0] <= length <= ARMS[1] else None
