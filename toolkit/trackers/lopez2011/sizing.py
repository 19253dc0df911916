"""Body size of a person from the waist up, from silhouettes and geodesic paths (Lopez-Mendez 2011, 3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.kernels import linear
from toolkit.sensing.cloud import Cloud
from toolkit.trackers.lopez2011.upper import arm_of


def sized_body(breadths: Sequence[float], arms: Sequence[float]) -> Body | None:
    """Return the most probable body for measured shoulder widths and arm lengths, metres; None without any.

    Both are nearly linear in the Gaussian shape coefficients. The body is the conditional mean given the medians of the
    measurements without outliers.
    """
    space = ShapeSpace.load()
    # Standard deviations of the two measurements (medians over a recording), metres.
    breadth_noise, arm_noise = 0.04, 0.09
    measured = [
        (_settled(values), noise, read)
        for values, noise, read in ((breadths, breadth_noise, _breadth), (arms, arm_noise, _arm))
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
    """Return the mean of the values within one standard deviation of their median (Lopez-Mendez 2011, 3)."""
    array = np.array(values)
    near = np.abs(array - np.median(array)) <= array.std() + 1e-9
    return float(array[near].mean())


def _breadth(body: Body) -> float:
    left, right = (body.joints[skeleton.JOINT_NAMES.index(f"{side}_shoulder")] for side in skeleton.SIDES)
    flesh = 0.02  # difference between the silhouette's width at the shoulders and the distance of the joints, metres
    return float(left[0] - right[0]) + flesh


def _arm(body: Body) -> float:
    arm = arm_of("left", body)
    hidden = 0.10  # length of an arm above the bend of its path, metres
    return float(linear.lengths(np.stack([arm.bones.upper, arm.fore, arm.hand])).sum()) - hidden


def shoulder_breadth(cloud: Cloud) -> float | None:
    """Return the silhouette width at the shoulders, metres, of an upright person with lowered arms, or None.

    The shoulders are the first maximum of the growth of the width below the head.
    """
    if len(cloud) == 0:
        return None
    x, y = cloud.points[:, 0].astype(np.float64), cloud.points[:, 1].astype(np.float64)
    bin = 0.01  # height of a row for the widths, metres
    rows = ((y.max() - y) / bin).astype(np.int64)
    lowest = 0.45  # maximum distance of the shoulders below the crown, metres
    count = int(lowest / bin)
    left, right = np.full(count, np.inf), np.full(count, -np.inf)
    inside = rows < count
    np.minimum.at(left, rows[inside], x[inside])
    np.maximum.at(right, rows[inside], x[inside])
    known = np.isfinite(left)
    if known.sum() < count // 2:
        return None
    widths = np.interp(np.arange(count), np.flatnonzero(known), (right - left)[known])
    smooth_rows = 5  # number of averaged rows
    smooth = np.convolve(
        np.pad(widths, smooth_rows // 2, mode="edge"), np.full(smooth_rows, 1.0 / smooth_rows), mode="valid"
    )
    growth = np.gradient(smooth, bin)
    steepest = 1.0  # minimum width gain per height of a prominent maximum
    shoulder_rows = 0.06  # distance below the maximum in which the outermost points are taken, metres
    breadths = (0.25, 0.60)  # range of valid silhouette widths, metres; raised arms exceed it
    head_to_shoulders = 0.16  # minimum distance of the shoulders below the crown, metres; the head itself widens faster
    for row in range(int(head_to_shoulders / bin), count - 1):
        if growth[row] >= max(growth[row - 1], growth[row + 1], steepest):
            breadth = float(np.median(widths[row : row + int(shoulder_rows / bin)]))
            return breadth if breadths[0] <= breadth <= breadths[1] else None
    return None


def arm_length(path: np.ndarray) -> float | None:
    """Return the length of an arm, metres, from the path (k, 3) from trunk to hand; None for a path without a bend.

    The arm begins at the largest image curvature between a quarter and a half of the path.
    """
    steps = np.sqrt((np.diff(path, axis=0) ** 2).sum(axis=1))
    along = np.concatenate([[0.0], np.cumsum(steps)])
    step = 0.02  # distance of path points for the curvature, metres
    count = int(along[-1] / step) + 1
    if count < 8:
        return None
    places = np.linspace(0.0, along[-1], count)
    plane = np.stack([np.interp(places, along, path[:, axis]) for axis in (0, 1)], axis=1)
    span = max(count // 10, 1)
    back, ahead = plane[span:-span] - plane[: -2 * span], plane[2 * span :] - plane[span:-span]
    turns = np.abs(np.arctan2(back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], (back * ahead).sum(axis=1)))
    shares = places[span:-span] / along[-1]
    bend_range = (0.25, 0.50)  # range of the shoulder bend as fractions of the path length
    allowed = (shares >= bend_range[0]) & (shares <= bend_range[1])
    if not allowed.any():
        return None
    bend = int(np.argmax(np.where(allowed, turns, -1.0)))
    length = float(along[-1] * (1.0 - shares[bend]))
    arms = (0.45, 0.85)  # range of valid arm lengths, metres
    return length if arms[0] <= length <= arms[1] else None
