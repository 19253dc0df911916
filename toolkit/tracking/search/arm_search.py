"""Arm search: the best hypothesis so far with its arms at the joints that the network estimates."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.terms import JointTerm
from toolkit.kernels import linear
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.search_protocol import NOTHING, Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import PersonState

SOURCE = "arms"
"""Name of the search and of its hypotheses."""
ITERATIONS, KINEMATIC_ITERATIONS = 4, 8
"""Iterations that refine a pose with a moved arm, and that move the arm to joints: an arm on the wrong side of the body
is within 2 cm of them after eight."""
JOINT_WEIGHT, JOINT_SIGMA = 30.0, 1.0
"""Weight of a joint against the pose prior, and scale of its Geman-McClure weight, metres."""
ARM_ROWS: tuple[np.ndarray, ...] = tuple(
    np.array([skeleton.REPORTED.index(f"{side}_{joint}") for joint in ("elbow", "wrist", "hand")])
    for side in skeleton.SIDES
)
"""Rows of the joints to which the left and the right arm are moved."""


@dataclass(frozen=True)
class ArmSettings:
    """Settings of the choice between two arms.

    Attributes
    ----------
    explained : distance of a sample from the body that needs no other arm, metres; typical of correct poses
    margin : minimum reduction of the unexplained distance, metres: one of 400 samples that is 20 cm off; with 0, noise
        moves occluded arms
    prior : cost in metres per unit of the pose prior's energy, which decides between arms with equal fit
    """

    explained: float = 0.03
    margin: float = 0.0005
    prior: float = 0.05


class NetworkArms:
    """Arms of a pose moved to the joints that the network estimates, if that leaves less of the frame unexplained.

    One arm after the other is moved while pulls hold the other joints, and the pose is refined. The unexplained part of
    the frame and the pose prior decide. The other parts of the sparse distance do not help: they are smallest for an
    arm inside the body.

    Parameters
    ----------
    objective, refiner : compare poses with the frame, and refine them
    kinematics : refiner without terms of the depth
    settings : see `ArmSettings`
    """

    def __init__(self, objective: Objective, refiner: Refiner, kinematics: Refiner, settings: ArmSettings) -> None:
        self._objective, self._refiner, self._kinematics = objective, refiner, kinematics
        self._settings = settings

    def better(self, scored: ScoredHypothesis, observation: Observation) -> Hypothesis | None:
        """Return the pose of a hypothesis with better arms; None without, or without an estimate of the network.

        The network is not evaluated where arms cannot explain more of the samples than the margin.
        """
        body, scene, pose, compared = scored.body, observation.scene, scored.hypothesis.pose, scored.comparison
        excess = np.maximum(compared.sample_gaps - self._settings.explained, 0.0)
        if excess.sum() < self._settings.margin * len(excess):
            return None
        estimate = observation.estimate
        if estimate is None:
            return None
        for rows in ARM_ROWS:
            targets = body.joint_positions(pose)
            targets[rows] = estimate.points[rows]
            weights = np.ones(len(targets))
            weights[rows] = np.sqrt(estimate.confidence[rows])
            term = JointTerm(linear.rotated(targets, observation.cloud.rotation), JOINT_WEIGHT * weights, JOINT_SIGMA)
            moved = self._kinematics.refine(body, pose, scene, terms=[term], iterations=KINEMATIC_ITERATIONS)
            pose, compared = self._nearer(body, pose, compared, moved, observation)
        if pose is scored.hypothesis.pose:
            return None
        return Hypothesis(SOURCE, pose, compared)

    def _nearer(
        self, body: Body, pose: np.ndarray, compared: Comparison, moved: np.ndarray, observation: Observation
    ) -> tuple[np.ndarray, Comparison]:
        """Return a pose (P,), `compared` with the frame, or the refined `moved` one."""
        farther = 1.2  # maximum factor of the sparse distance; beyond it the moved arm covers measured points
        refined = self._refiner.refine(body, moved, observation.scene, iterations=ITERATIONS)
        tried = self._objective.compare(body, refined, observation.scene, farther * compared.distance)
        if self._unexplained(tried) < self._unexplained(compared) - self._settings.margin:
            return refined, tried
        return pose, compared

    def _unexplained(self, compared: Comparison) -> float:
        """Return the cost of an arm, metres: distance of the samples to the drawn body, plus the pose prior."""
        if not np.isfinite(compared.distance):
            return np.inf
        return float(compared.sample_gaps.mean()) + self._settings.prior * compared.energy


class ArmSearch:
    """Search for better arms of the best pose of a tracked person.

    A retrieved whole pose rarely beats the local optimum (Baak 2013, 5.4.3), although one of its arms often would. A
    better pose replaces the hypothesis that it comes from.

    Parameters
    ----------
    arms : moves the arms
    period : of `DatabaseLookup`: arms are searched as often as whole poses, in other frames unless the person is lost
    """

    name = SOURCE

    def __init__(self, arms: NetworkArms, period: int = 1) -> None:
        self._arms, self._period = arms, period

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """Propose arms, see `Search.propose`."""
        if state.previous is None or best is None or not state.is_due(self._period, ahead=0):
            return NOTHING
        found = self._arms.better(best, observation)
        return NOTHING if found is None else Proposal((replace(found, improves=best),))
