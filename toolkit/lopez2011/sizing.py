"""The size of a person seen from the waist up (Lopez-Mendez 2011, 3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.fitting.arms import SIDES
from toolkit.kernels import linear
from toolkit.lopez2011.upper import arm_of

BREADTH_NOISE, ARM_NOISE = 0.04, 0.09
"""Metres: standard deviations of the two measurements of a person's size, as their medians over a take."""
FLESH = 0.02
"""Metres by which a silhouette is broader at the shoulders than the distance of their joints."""
HIDDEN = 0.10
"""Metres of an arm before the point at which its path bends, below the shoulder."""


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
