"""Arm search: the best hypothesis so far with its arms at the joints that the network estimates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.arms import SIDES, ArmSettings
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.scene import Scene
from toolkit.fitting.terms import JointTerm
from toolkit.kernels import linear
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.search_protocol import NOTHING, Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import PersonState

ITERATIONS = 2
"""Iterations that refine a pose with one new limb."""
KINEMATIC_ITERATIONS = 8
"""Iterations that move an arm to joints; an arm on the wrong side of the body is within 1 cm after them."""
HOLD, REACH = 300.0, 1.0
"""Weight of a joint against the pose prior, and metres at which it fades: a hand may be as far off."""
ARM_ROWS: tuple[np.ndarray, ...] = tuple(
    np.array([skeleton.REPORTED.index(f"{side}_{joint}") for joint in ("elbow", "wrist", "hand")]) for side in SIDES
)
"""Rows of the joints to which the left and the right arm are moved."""


@dataclass(frozen=True)
class LimbExchange:
    """Refinement of arm candidates; keeps the pose that leaves least unexplained.

    Attributes
    ----------
    objective, refiner : compare with the frame, and refine
    settings : see `ArmSettings`
    """

    objective: Objective
    refiner: Refiner
    settings: ArmSettings

    def best(
        self, body: Body, pose: np.ndarray, compared: Comparison, candidates: Iterable[np.ndarray], scene: Scene
    ) -> tuple[np.ndarray, Comparison]:
        """Return the best of a pose (P,), `compared` with the frame, and its `candidates` (P,)."""
        # Maximum factor by which the sparse distance may grow; beyond it the new arm covers measured points.
        farther = 1.2
        for candidate in candidates:
            refined = self.refiner.refine(body, candidate, scene, iterations=ITERATIONS)
            tried = self.objective.compare(body, refined, scene, farther * compared.distance)
            if unexplained(tried, self.settings) < unexplained(compared, self.settings) - self.settings.margin:
                pose, compared = refined, tried
        return pose, compared


class ArmSearch:
    """Search for the arms of the best pose at the joints that the network estimates.

    A retrieved whole pose rarely beats the local optimum (Baak 2013, 5.4.3), although one of its arms often would. One
    arm after the other is moved to its estimated joints while the other joints stay, and the pose is refined. The
    unexplained part of the frame and the pose prior decide. The other parts of the sparse distance do not help: they
    are smallest for an arm inside the body. A better pose replaces the hypothesis that it comes from.

    Parameters
    ----------
    objective, refiner : compare the answers with the frame, and refine
    kinematics : refiner without terms of the depth
    settings : see `ArmSettings`
    period : of `DatabaseLookup`: arms are searched as often as whole poses, in other frames unless the person is lost
    """

    name = "arms"

    def __init__(
        self, objective: Objective, refiner: Refiner, kinematics: Refiner, settings: ArmSettings, period: int = 1
    ) -> None:
        self._kinematics, self._period = kinematics, period
        self._exchange = LimbExchange(objective, refiner, settings)

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """Propose arms, see `Search.propose`."""
        waits = not state.lost and state.turn % self._period != 0
        if state.previous is None or best is None or waits or observation.estimate is None:
            return NOTHING
        body, scene, estimate = best.body, observation.scene, observation.estimate
        pose, compared = best.hypothesis.pose, best.comparison
        for rows in ARM_ROWS:
            targets = body.joint_positions(pose)
            targets[rows] = estimate.points[rows]
            weights = np.ones(len(targets))
            weights[rows] = np.sqrt(estimate.confidence[rows])
            term = JointTerm(linear.rotated(targets, observation.cloud.rotation), HOLD * weights, REACH)
            moved = self._kinematics.refine(body, pose, scene, terms=[term], iterations=KINEMATIC_ITERATIONS)
            pose, compared = self._exchange.best(body, pose, compared, [moved], scene)
        if pose is best.hypothesis.pose:
            return NOTHING
        return Proposal((Hypothesis("arms", pose, compared, improves=best),))


def unexplained(compared: Comparison, settings: ArmSettings) -> float:
    """Return the cost of an arm, metres: distance of the samples to the drawn body, plus the pose prior."""
    if not np.isfinite(compared.distance):
        return np.inf
    return float(compared.sample_gaps.mean()) + settings.prior * compared.energy
