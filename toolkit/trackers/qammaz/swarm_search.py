"""Swarm search: best fit to depth image and joints around the previous pose, or within all limits (Qammaz)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.terms import JointTerm
from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import AtLeastOne, NotNegative, Range
from toolkit.kernels import linear
from toolkit.trackers.qammaz.discrepancy import Discrepancy, DiscrepancySettings, SeenJoints, SmallImage, small_image
from toolkit.trackers.qammaz.observed_pixels import exchanged, first_poses, gap, seen_joints, sides_exchanged
from toolkit.trackers.qammaz.swarm import SwarmSettings, minimise
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.search_protocol import NOTHING, Hypothesis, Proposal, ScoredHypothesis
from toolkit.tracking.state import PersonState


@dataclass(frozen=True)
class SwarmSearchSettings:
    """Search window of a swarm, and refinement of its result.

    Attributes
    ----------
    window : half range of each angle and of the root's rotation about each axis around the previous pose, radians; more
        than any joint turns in 1/30 s
    reach : maximum distance of the root from its previous place in each direction, metres
    tries : number of global searches for each facing before a last swarm around the best; one third more first frames
        are correct than with one
    history : number of previous poses that are particles too (from the paper)
    joints_first : a swarm on the joints alone, which costs a fifth, shows the swarm on everything where to begin
    frozen : joints of `skeleton.JOINT_NAMES` that stay in the T-pose; none, because people move all of them
    limits : limits of single angles by `skeleton.POSE_NAMES`, radians; None = those of the skeleton
    pulled, refined : iterations of the local optimisation with and without joint terms, 0 and 0 for none; depth is more
        accurate than joints
    disagreement : mean distance from the joints that triggers a global search, metres, 0 = never; twice the error of
        lifted joints for correct poses
    sides : minimum improvement in metres for a body with exchanged left and right; detectors without faces confuse
        front and back in a twentieth of the backs. None uses the joints as given and selects by E of Eq. 2, as in the
        paper
    """

    window: Annotated[float, Range(1e-6)] = 0.7
    reach: Annotated[float, Range(1e-6)] = 0.3
    tries: AtLeastOne = 3
    history: Annotated[int, Range(0)] = 5
    joints_first: bool = True
    frozen: tuple[str, ...] = ()
    limits: dict[str, tuple[float, float]] | None = None
    pulled: Annotated[int, Range(0)] = 2
    refined: Annotated[int, Range(0)] = 4
    disagreement: NotNegative = 0.08
    sides: float | None = 0.015

    def __post_init__(self) -> None:
        if unknown := [name for name in self.frozen if name not in skeleton.JOINT_NAMES[1:]]:
            raise SettingsError(f"frozen {unknown} are no joints; there are: {', '.join(skeleton.JOINT_NAMES[1:])}")
        for name, (low, high) in (self.limits or {}).items():
            if name not in skeleton.POSE_NAMES[6:] or not low <= high:
                raise SettingsError(
                    f"limits of {name!r} are {low} to {high}; name an angle of the pose such as "
                    f"{skeleton.POSE_NAMES[6]}, its lower limit first"
                )

    def pose_limits(self) -> np.ndarray:
        """Return lower and upper limit of each entry, float64 (P, 2); those of the root are infinite."""
        limits = skeleton.POSE_LIMITS.copy()
        for name, (low, high) in (self.limits or {}).items():
            limits[skeleton.POSE_NAMES.index(name)] = low, high
        for joint in self.frozen:
            limits[3 + np.flatnonzero(skeleton.DOF_JOINT == skeleton.JOINT_NAMES.index(joint))] = 0.0
        return limits


class SwarmSearch:
    """Search with a swarm, around the previous pose or, without one, around poses from the joints.

    Parameters
    ----------
    objective, refiner : compare the found poses with the frame, and refine them
    first_only : propose only without a previous pose and with detected joints
    """

    name = "swarm"

    def __init__(
        self,
        settings: SwarmSearchSettings,
        swarm: SwarmSettings,
        discrepancy: DiscrepancySettings,
        objective: Objective,
        refiner: Refiner,
        *,
        first_only: bool = False,
    ) -> None:
        self._first_only = first_only
        self._settings, self._swarm, self._discrepancy = settings, swarm, discrepancy
        self._objective, self._refiner = objective, refiner
        self._limits = settings.pose_limits()

    def propose(
        self, observation: Observation, state: PersonState, rng: np.random.Generator, best: ScoredHypothesis | None
    ) -> Proposal:
        """See `Search.propose`."""
        if self._first_only and (state.previous is not None or observation.joints is None):
            return NOTHING
        frame, doubts = self._frame(observation, state)
        if state.previous is None:
            found, _ = self.global_search(frame, state.body, rng)
            return Proposal((Hypothesis("swarm", found.pose, found.comparison),), _memory(found.pose[None], 0.0, 0.0))
        poses = self._history(state)
        believed = 0.35  # duration of exchanged sides after which a global search decides, seconds
        kept, asked = poses[: self._settings.history], doubts > believed
        rest = max(_remembered(state, "rest") - observation.elapsed, 0.0)
        rivals = [] if best is None else [_Found(best.hypothesis.pose, best.comparison)]
        found = self._follow(frame, state.body, poses, rivals, rng)
        nearest = min([*rivals, found], key=lambda rival: rival.comparison.distance)
        # Minimum time between two unsuccessful global searches, seconds; their cause usually lasts longer.
        least_rest = 0.3
        if asked or (rest == 0.0 and self._disagrees(frame, state.body, nearest)):
            restart, score = self.global_search(frame, state.body, rng)
            if score < self._score_of(frame, state.body, nearest):
                hypothesis = Hypothesis("joints", restart.pose, restart.comparison, improves=best)
                return Proposal((hypothesis,), _memory(kept, 0.0, 0.0))
            rest = least_rest
        memory = _memory(kept, 0.0 if asked else doubts, rest)
        return Proposal((Hypothesis("swarm", found.pose, found.comparison, continues=True),), memory)

    def _frame(self, observation: Observation, state: PersonState) -> tuple[_Frame, float]:
        """Return the state of the search: the frame, and the duration of exchanged sides in seconds."""
        s, cloud, doubts = self._discrepancy, observation.cloud, 0.0
        seen = seen_joints(observation, on_skin=s.published)
        if seen is not None and state.previous is not None and self._settings.sides is not None:
            doubts = _remembered(state, "doubts")
            wrong = sides_exchanged(seen, linear.rotated(state.previous.joints, cloud.rotation))
            doubts = doubts + observation.elapsed if wrong else 0.0
            if wrong:
                seen = exchanged(seen)
        image = small_image(cloud.depth, observation.unobserved, cloud.camera.intrinsics, (s.height, s.width))
        return _Frame(observation, seen, image), doubts

    def _history(self, state: PersonState) -> np.ndarray:
        """Return the previous pose and earlier ones, (1 + K, P), the last one first."""
        assert state.previous is not None
        before = state.memory.get(self.name, {}).get("poses", np.empty((0, skeleton.POSE_SIZE)))
        return np.concatenate([state.previous.pose[None], before])[: 1 + self._settings.history]

    def _follow(
        self, frame: _Frame, body: Body, poses: np.ndarray, rivals: list[_Found], rng: np.random.Generator
    ) -> _Found:
        """Return the best pose in the window around the first of `poses` (K, P); rivals are particles too."""
        s = self._settings
        costs = frame.discrepancy(body, poses[0], self._discrepancy, previous=True)
        starts = costs.position_of(np.concatenate([poses[:1], *(rival.pose[None] for rival in rivals), poses[1:]]))
        half = np.full(skeleton.POSE_SIZE, s.window)
        half[skeleton.ROOT_POSITION] = s.reach
        limits = self._window(starts[0], half)
        return self._finished(frame, body, costs, self._searched(costs, starts, limits, rng))

    def global_search(self, frame: _Frame, body: Body, rng: np.random.Generator) -> tuple[_Found, float]:
        """Return the best pose within all limits and facings, and its score, metres.

        The detector may have exchanged left and right. The wrong facing is farther from the frame, which decides,
        unless joints are used as given.
        """
        best = self._anywhere(frame, body, rng)
        least, other = self._score_of(frame, body, best), frame.exchanged()
        if other is not None and self._settings.sides is not None:
            found = self._anywhere(other, body, rng)
            score = self._score_of(other, body, found) + self._settings.sides
            if score < least:
                best, least = found, score
        return best, least

    def _anywhere(self, frame: _Frame, body: Body, rng: np.random.Generator) -> _Found:
        """Return the best pose within all limits for joints with known sides, refined by a last swarm around it."""
        found = []
        s = self._settings
        half = np.full(skeleton.POSE_SIZE, np.inf)
        # Range of the root rotation about each axis without a previous pose, radians; shoulders and hips give the
        # orientation of the trunk.
        tilt = 0.8
        half[skeleton.ROOT_POSITION], half[skeleton.ROOT_ROTATION] = s.reach, tilt
        for start in first_poses(frame.observation, frame.seen):
            costs = frame.discrepancy(body, start, self._discrepancy)
            starts = costs.position_of(np.clip(start, *self._limits.T)[None])
            limits = self._window(starts[0], half)
            for _ in range(s.tries):
                found.append(self._finished(frame, body, costs, self._searched(costs, starts, limits, rng)))
        best = min(found, key=lambda rival: self._score_of(frame, body, rival))
        again = self._follow(frame, body, best.pose[None], [], rng)
        return min([best, again], key=lambda rival: self._score_of(frame, body, rival))

    def _window(self, position: np.ndarray, half: np.ndarray) -> np.ndarray:
        """Return limits (P, 2) of the positions within `half` of one and within the joint limits."""
        low, high = self._limits.T
        middle = np.clip(position, low, high)
        return np.stack([np.maximum(middle - half, low), np.minimum(middle + half, high)], axis=1)

    def _searched(
        self, costs: Discrepancy, starts: np.ndarray, limits: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """Return the best position (P,) of a swarm with the initial positions `starts` (K, P)."""
        s = self._settings
        # Number of best results of the joint-only swarm that start the next swarm, and their minimum distance in
        # radians and metres.
        copy_count, copy_spread = 7, 0.05
        angles = np.arange(6, skeleton.POSE_SIZE)  # pose entries that perturbations change
        if s.joints_first and costs.guided:
            alone = minimise(costs.joints_alone(), starts, limits, self._swarm, rng, perturbed=angles).position
            copies = alone + copy_spread * rng.standard_normal((copy_count, len(alone)))
            starts = np.concatenate([starts, alone[None], copies])
        return minimise(costs, starts, limits, self._swarm, rng, perturbed=angles).position

    def _finished(self, frame: _Frame, body: Body, costs: Discrepancy, position: np.ndarray) -> _Found:
        """Return a position as a refined and scored pose."""
        s, scene, pose = self._settings, frame.observation.scene, costs.pose_of(position)
        # Weight of a confident joint relative to one correspondence, and distance in metres beyond which a joint has
        # no weight, because occluded joints are lifted to the occluder.
        pull, pull_sigma = 20.0, 0.1
        if s.pulled and frame.seen is not None and costs.guided:
            weights = np.where(np.isfinite(frame.seen.points[:, 0]), pull * frame.seen.confidence, 0.0)
            term = JointTerm(np.nan_to_num(frame.seen.points), weights, pull_sigma)
            pose = self._refiner.refine(body, pose, scene, terms=[term], iterations=s.pulled)
        if s.refined:
            pose = self._refiner.refine(body, pose, scene, iterations=s.refined)
        return _Found(pose, self._objective.compare(body, pose, scene))

    def _disagrees(self, frame: _Frame, body: Body, found: _Found) -> bool:
        limit = self._settings.disagreement
        return limit > 0.0 and frame.gap(body, found.pose) > limit

    def _score_of(self, frame: _Frame, body: Body, found: _Found) -> float:
        """Return the score of a pose with its joints, metres; E of Eq. 2 if joints are used as given."""
        if self._settings.sides is None:
            costs = frame.discrepancy(body, found.pose, self._discrepancy)
            return float(costs(costs.position_of(found.pose[None]))[0])
        trust = 0.5  # weight of the mean joint distance in the score of a pose, relative to the distance from the frame
        return found.comparison.distance + trust * frame.gap(body, found.pose)


@dataclass(frozen=True, eq=False)
class _Found:
    """A pose (P,), level frame, and its score."""

    pose: np.ndarray
    comparison: Comparison


@dataclass(frozen=True, eq=False)
class _Frame:
    """A frame as input of the swarm."""

    observation: Observation
    seen: SeenJoints | None
    image: SmallImage

    def exchanged(self) -> _Frame | None:
        """Return the same frame with left and right of the joints exchanged; None without joints."""
        return None if self.seen is None else replace(self, seen=exchanged(self.seen))

    def discrepancy(
        self, body: Body, around: np.ndarray, settings: DiscrepancySettings, *, previous: bool = False
    ) -> Discrepancy:
        """Return the objective for poses around one (P,)."""
        rotation = self.observation.cloud.rotation
        return Discrepancy(body, self.image, self.seen, rotation, around, settings, previous=previous)

    def gap(self, body: Body, pose: np.ndarray) -> float:
        """Return the weighted mean distance of the body's joints in a pose from their detected positions, metres."""
        return gap(self.seen, linear.rotated(body.joint_positions(pose), self.observation.cloud.rotation))


def _memory(poses: np.ndarray, doubts: float, rest: float) -> dict[str, np.ndarray]:
    """Return the memory between frames: poses (K, P), duration of exchanged sides, time to the next global search."""
    return {"poses": poses, "doubts": np.array([doubts]), "rest": np.array([rest])}


def _remembered(state: PersonState, name: str) -> float:
    return float(state.memory.get(SwarmSearch.name, {}).get(name, np.zeros(1))[0])
