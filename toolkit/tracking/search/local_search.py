"""Local hypothesis: the previous pose, refined (Baak 2013, 5.4.1)."""

from __future__ import annotations

import math

import numpy as np

from toolkit.body import skeleton
from toolkit.fitting.refiner import Refiner
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.search_protocol import NOTHING, Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import PersonState, Previous


class LocalSearch:
    """Refinement of the previous pose, extrapolated by a part of the last step.

    Parameters
    ----------
    refiner : the local optimisation
    momentum : fraction of the previous step that is added to the pose, in [0, 1]
    """

    name = "local"

    def __init__(self, refiner: Refiner, momentum: float) -> None:
        self._refiner, self._momentum = refiner, momentum

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """Propose the refined previous pose, see `Search.propose`."""
        if state.previous is None:
            return NOTHING
        start = moved_on(state.previous, self._momentum, observation.elapsed)
        pose = self._refiner.refine(state.body, start, observation.scene)
        return Proposal((Hypothesis("local", pose, continues=True),))


def moved_on(previous: Previous, momentum: float, elapsed: float) -> np.ndarray:
    """Return the previous pose (P,), extrapolated within the joint limits by `momentum` times its speed.

    `elapsed` seconds have passed since then.
    """
    pose, before = previous.pose, previous.before
    if before is None or momentum == 0.0:
        return pose
    step = pose - before
    step[skeleton.ROOT_ROTATION] = least_turn(before[skeleton.ROOT_ROTATION], pose[skeleton.ROOT_ROTATION])
    farthest = 3.0  # maximum extrapolation, in steps of the previous frame rate
    steps = min(elapsed / previous.elapsed, farthest)
    return np.clip(pose + momentum * steps * step, *skeleton.POSE_LIMITS.T)


def least_turn(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the difference (3,) of two rotation vectors, the first in its representation nearest to the second."""
    angle = math.hypot(*before)
    other = before * (1.0 - 2.0 * np.pi / angle) if angle > 0.0 else before
    near, far = after - before, after - other
    return near if math.hypot(*near) <= math.hypot(*far) else far
