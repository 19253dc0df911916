"""The size of a person seen from the waist up (Lopez-Mendez 2011, 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from toolkit import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace
from toolkit.fitting.arms import SIDES
from toolkit.kernels import linear
from toolkit.lopez2011.costs import ParticleFrame, costs_of_whole
from toolkit.lopez2011.effectors import Effectors, Fork
from toolkit.lopez2011.filter import UpperFilter
from toolkit.lopez2011.initial import InitialSettings, initial_pose
from toolkit.lopez2011.upper import UpperBodies, arm_of

BREADTH_NOISE, ARM_NOISE = 0.04, 0.09
"""Metres: standard deviations of the two measurements of a person's size, as their medians over a take."""
FLESH = 0.02
"""Metres by which a silhouette is broader at the shoulders than the distance of their joints."""
HIDDEN = 0.10
"""Metres of an arm before the point at which its path bends, below the shoulder."""
UNLIKELY = 1.0
"""Cost of a size one standard deviation from the mean, and a quarter of that of two: unseen legs leave size hardly
observable, and a first pose that is better by chance costs as much less."""
ROUNDS = 4
"""Rounds of filtering while sizes are compared: fewer than for a pose, for the trunk decides."""


SIZED_ON = 3
"""Frames on which sizes are tried."""


class FirstFrame(NamedTuple):
    """What is known of a frame in which no person is followed yet."""

    effectors: Effectors
    fork: Fork | None
    frame: ParticleFrame


def fitting_body(
    bodies: UpperBodies, filtering: UpperFilter, frames: Sequence[FirstFrame], settings: InitialSettings, seed: int
) -> Body | None:
    """Of bodies of the `settings.sizes` the likeliest, by how well first poses explain the frames; None without any.

    Between the sizes it is where the parabola through the best and its neighbours is lowest. All sizes get the same
    random numbers.
    """
    space, quick = ShapeSpace.load(), replace(settings, rounds=ROUNDS)
    tried: list[list[float]] = []
    for seen in frames:
        costs = []
        for size in settings.sizes:
            upper = bodies.of(space.body([size]))
            rng = np.random.Generator(np.random.PCG64(seed))
            first = initial_pose(upper, filtering, seen.effectors, seen.fork, seen.frame, quick, rng)
            if first is not None:
                costs.append(float(costs_of_whole(upper, first.pose[None], seen.frame)[0]))
        tried += [costs] if len(costs) == len(settings.sizes) else []
    if not tried:
        return None
    costs = np.array(tried).mean(axis=0) + UNLIKELY * np.array(settings.sizes) ** 2
    return space.body([lowest(settings.sizes, costs)])


def lowest(places: Sequence[float], values: np.ndarray) -> float:
    """Where the parabola through the least of `values` (N,) and its neighbours is least; `places` (N,) are even."""
    best = int(np.argmin(values))
    if not 0 < best < len(values) - 1:
        return float(places[best])
    before, least, after = values[best - 1 : best + 2]
    bend = before - 2.0 * least + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(places[best] + shift * (places[best + 1] - places[best]))


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
