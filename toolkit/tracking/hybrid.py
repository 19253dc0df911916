"""The hybrid tracker: local optimisation and database lookup, fused late (Baak 2013, 5.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace, load_body
from toolkit.database.database import PoseDatabase
from toolkit.database.origin import ADULT_HEIGHT
from toolkit.fitting.arms import ArmSearch
from toolkit.fitting.fitter import Comparison, Fitter
from toolkit.fitting.scene import Scene
from toolkit.fitting.shape import ShapeEstimator
from toolkit.fitting.terms import GaussianPrior, JointTerm
from toolkit.kernels import linear
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.extrema import extrema_of_graph, source_node
from toolkit.landmarks.facing import FacingFilter, estimate_facing
from toolkit.landmarks.graph import Workspace, grid_graph
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.cleaning import Cleaner
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.track import EMPTY, LOST, TRACKED, FrameResult
from toolkit.tracking.clock import StageClock
from toolkit.tracking.lookup import EFFECTORS
from toolkit.tracking.proposals import ExtremaProposer, JointsProposer, Previous, Proposer
from toolkit.tracking.settings import HybridSettings
from toolkit.tracking.smoothing import PoseSmoother
from toolkit.tracking.view import View

STAGES = ("prepare", "landmarks", "local", "lookup", "select")
SOURCES = ("local", "extrema", "joints", "arms", "predicted")

LARGE_IMAGE = 200
"""Pixels of width above which the body is drawn at half the resolution of the image."""
VOTE_SIGMA = 0.3
"""Metres at which a regressed joint loses its pull: the spread of an uncertain vote."""
PULLED_ITERATIONS = 2
"""Iterations in which the regressed joints pull; the depth image has the last word."""
FIRST_STEP = 1.0 / 30.0
"""Seconds between the first frame and the one before that there never was."""
UNSEEN = (0.0, 0.0, -3.0)
"""Metres, level frame: where the root is said to be before anybody was seen."""


@dataclass
class Memory:
    """Everything that the next step depends on besides the depth image."""

    cleaner: Cleaner
    facing: FacingFilter
    smoother: PoseSmoother
    body: Body
    sized: bool
    previous: Previous | None = None
    pose: np.ndarray | None = None
    before: np.ndarray | None = None
    centre: np.ndarray | None = None
    timestamp: float | None = None
    lost: int = 0
    turn: int = 0


class HybridTracker:
    """Tracks one person; see `Tracker` for the attributes.

    Parameters
    ----------
    database : poses to look up, with or without a joint regressor
    settings : see `HybridSettings`
    body : the person's own body, if it is known; otherwise it is learnt from the recording
    database_path : where the database came from, for `run.json`
    """

    stage_names = STAGES
    source_names = SOURCES

    def __init__(
        self,
        database: PoseDatabase,
        settings: HybridSettings | None = None,
        *,
        body: Body | None = None,
        database_path: str = "",
    ) -> None:
        self.settings = settings or HybridSettings()
        self.database = database_path
        self._first_body = body or load_body("neutral")
        self._personal = body is None
        self._forest = database.forest if "joints" in self.settings.hypotheses else None
        weight = self.settings.fitting.prior_weight
        self._priors = [GaussianPrior.of_poses(database.poses, weight)] if weight > 0.0 else []
        self._proposers: dict[str, Proposer] = {}
        if "extrema" in self.settings.hypotheses:
            self._proposers["extrema"] = ExtremaProposer(database, self.settings.lookup)
        if self._forest is not None:
            self._proposers["joints"] = JointsProposer(database)
        self._arms: ArmSearch | None = None
        if {"local", "arms"} <= set(self.settings.hypotheses):
            self._arms = ArmSearch(database.poses, self._first_body, self.settings.arms)
        # While all is well, whole poses come from one source at a time, and where arms are searched every other frame.
        self._turns = [name for source in self._proposers for name in ((source, "") if self._arms else (source,))]

    @property
    def body(self) -> Body:
        """The body as fitted so far."""
        return self.memory.body

    def start(self, recording: Recording) -> None:
        """See `Tracker.start`.

        The person's shape is learnt here: the first frames are tracked once for it, and `step` then tracks all of them
        with that one body, so that bone lengths do not change within a track.
        """
        self._begin(recording, self._first_body, sized=not self._personal)
        shape = self.settings.shape
        if self._personal and shape.frames:
            body = self._learnt_body(recording)
            self._begin(recording, body, sized=True)

    def _begin(self, recording: Recording, body: Body, *, sized: bool) -> None:
        """Get ready for a first frame with a body whose size is right (`sized`) or has to be found."""
        cleaner = Cleaner.for_recording(recording, self.settings.sensing)
        self.level_rotation = level_rotation(recording.up_camera)
        smoother = PoseSmoother(self.settings.smoothing)
        self.memory: Memory = Memory(cleaner, FacingFilter(self.settings.landmarks), smoother, body, sized)
        small = cleaner.camera.subsampled(2) if cleaner.camera.width > LARGE_IMAGE else cleaner.camera
        self._fitter = Fitter(body, small, self.level_rotation, self.settings.fitting, self._priors)
        self._workspace = Workspace()

    def _learnt_body(self, recording: Recording) -> Body:
        """Personal shape from the recording's first frames."""
        shape = self.settings.shape
        estimator: ShapeEstimator | None = None
        for frame in range(0, min(shape.frames * shape.stride, len(recording)), shape.stride):
            result, view = self._track(recording.depth(frame), float(recording.timestamps[frame]), StageClock(STAGES))
            if view is None or result.state != TRACKED:
                continue
            estimator = estimator or ShapeEstimator(self.memory.body, shape, self._fitter.surface, self._fitter.cloud)
            self._fitter.posed.place(result.pose)
            self._fitter.posed.draw()
            self.memory.body = estimator.observe(self._fitter.posed, result.pose, view.scene)
        return self.memory.body

    def step(self, depth_mm: np.ndarray, timestamp: float) -> FrameResult:
        """See `Tracker.step`."""
        return self._track(depth_mm, timestamp, StageClock(STAGES))[0]

    def _track(self, depth_mm: np.ndarray, timestamp: float, clock: StageClock) -> tuple[FrameResult, View | None]:
        """One frame, as Baak 2013, 5.4 has it: prepare, landmarks, hypotheses, selection."""
        memory = self.memory
        if self._fitter.posed.body is not memory.body:
            self._fitter.posed.set_body(memory.body)

        depth = memory.cleaner.clean(depth_mm)
        cloud = Cloud.from_depth(depth, memory.cleaner.camera, self.level_rotation)
        clock.lap("prepare")
        if len(cloud) < self.settings.smallest_person:
            return self._predicted(EMPTY, timestamp, clock), None

        asked = self._asked()
        view = self._view(cloud, timestamp, votes=not asked.isdisjoint(self._proposers))
        clock.lap("landmarks")

        hypotheses: dict[str, np.ndarray] = {}
        compared: dict[str, Comparison] = {}
        if memory.previous is None:
            hypotheses = self._first_hypotheses(view)
        else:
            if "local" in self.settings.hypotheses:
                hypotheses["local"] = self._refined_locally(memory.previous.pose, view)
                compared["local"] = self._fitter.compare(hypotheses["local"], view.scene)
                clock.lap("local")
            if self._arms is not None:
                self._arms.set_body(memory.body)
                better = self._arms.improve(hypotheses["local"], compared["local"], self._fitter, view.scene)
                if better is not None:
                    hypotheses, compared = {"arms": better[0]}, {"arms": better[1]}
            bound = self.settings.promising * min((c.distance for c in compared.values()), default=np.inf)
            hypotheses |= self._retrieved(view, bound, asked)
        clock.lap("lookup")
        if not hypotheses:
            return self._predicted(LOST, timestamp, clock), None

        for name, pose in hypotheses.items():
            compared[name] = compared.get(name) or self._fitter.compare(pose, view.scene)
        winner = min(compared, key=lambda name: compared[name].distance)
        found = self._found(hypotheses[winner], winner, compared[winner], view, timestamp)
        clock.lap("select")
        return FrameResult(**found, stage_ms=clock.milliseconds), view

    def _asked(self) -> set[str]:
        """Sources of retrieved poses that are asked in this frame: one or none in turn while all is well, else all."""
        memory = self.memory
        if memory.previous is None or memory.lost or not self._turns:
            return set(self._turns)
        memory.turn += 1
        return {self._turns[memory.turn % len(self._turns)]}

    def _view(self, cloud: Cloud, timestamp: float, *, votes: bool) -> View:
        """Centre, facing, extrema and, if asked for, votes of a cloud (Baak 2013, 5.3.4 and 5.4.2)."""
        memory, settings = self.memory, self.settings
        scale = memory.body.height / ADULT_HEIGHT
        centre = cloud_centre(cloud.points, memory.centre, settings.landmarks, scale)
        dt = FIRST_STEP if memory.timestamp is None else timestamp - memory.timestamp
        estimate = estimate_facing(cloud.points, centre, settings.landmarks, scale)
        yaw = memory.facing.update(estimate, dt, centre)
        graph = grid_graph(cloud, settings.landmarks, self._workspace)
        extrema = extrema_of_graph(
            graph,
            cloud.points,
            settings.extrema,
            source_node(graph, cloud.points, centre, settings.landmarks, scale),
            self._workspace,
        )
        joints = self._forest.estimate(cloud, settings.vote_samples) if self._forest and votes else None
        fitting = settings.fitting
        scene = Scene(cloud, extrema.points.astype(np.float64), fitting.cloud_samples, fitting.search)
        memory.centre, memory.timestamp = centre, timestamp
        return View(cloud, centre, yaw, extrema, joints, scene)

    def _refined_locally(self, pose: np.ndarray, view: View) -> np.ndarray:
        """The local hypothesis (5.4.1): the previous pose (P,), moved on by a part of the step before it, refined."""
        before = self.memory.before
        if before is not None and self.settings.momentum > 0.0:
            step = pose - before
            step[skeleton.ROOT_ROTATION] = least_turn(before[skeleton.ROOT_ROTATION], pose[skeleton.ROOT_ROTATION])
            pose = np.clip(pose + self.settings.momentum * step, *skeleton.POSE_LIMITS.T)
        return self._fitter.refine(pose, view.scene)

    def _retrieved(self, view: View, bound: float, asked: set[str]) -> dict[str, np.ndarray]:
        """The database hypothesis (5.4.3): of all retrieved poses the one nearest to the frame, refined.

        None where all are farther than `bound`, so that no refinement could make them win.
        """
        memory = self.memory
        nearest, source, pose = bound, "", None
        for name, proposer in self._proposers.items():
            if name not in asked:
                continue
            for candidate in proposer.propose(view, memory.previous, memory.body, self.settings.candidates):
                distance = self._fitter.sparse_distance(candidate, view.scene, nearest)
                if distance < nearest:
                    nearest, source, pose = distance, name, candidate
        return {} if pose is None else {source: self._refined(source, pose, view)}

    def _refined(self, name: str, pose: np.ndarray, view: View, rounds: int = 1) -> np.ndarray:
        """A retrieved pose refined; one that the regressor asked for is first drawn to the joints that it saw."""
        iterations = rounds * self.settings.fitting.iterations
        if name == "joints" and view.votes is not None and self.settings.vote_pull > 0.0:
            targets = linear.rotated(view.votes.points, self.level_rotation)
            # A vote's weight is the fourth power of its certainty; a least squares weight is the second.
            pull = JointTerm(targets, self.settings.vote_pull * np.sqrt(view.votes.confidence), VOTE_SIGMA)
            pose = self._fitter.refine(pose, view.scene, pair_terms=[pull], iterations=rounds * PULLED_ITERATIONS)
            iterations -= PULLED_ITERATIONS
        return self._fitter.refine(pose, view.scene, iterations=max(iterations, 1))

    def _first_hypotheses(self, view: View) -> dict[str, np.ndarray]:
        """Hypotheses without a previous pose; for a person of unknown size in every size, which then is known."""
        memory, settings = self.memory, self.settings
        bodies = [memory.body]
        if not memory.sized:
            space, shape = ShapeSpace.load(), self._first_body.shape
            bodies = [space.body(np.concatenate([[size], shape[1:]])) for size in settings.sizes]
        best: dict[str, tuple[float, np.ndarray, Body]] = {}
        for body in bodies:
            self._fitter.posed.set_body(body)
            for name, proposer in self._proposers.items():
                for candidate in proposer.propose(view, None, body, settings.starts):
                    pose = self._refined(name, candidate, view, rounds=2)
                    distance = self._fitter.sparse_distance(pose, view.scene)
                    if name not in best or distance < best[name][0]:
                        best[name] = (distance, pose, body)
        if best:
            memory.body, memory.sized = min(best.values(), key=lambda entry: entry[0])[2], True
            self._fitter.posed.set_body(memory.body)
        return {name: pose for name, (_, pose, body) in best.items() if body is memory.body}

    def _found(
        self, pose: np.ndarray, source: str, compared: Comparison, view: View, timestamp: float
    ) -> dict[str, Any]:
        """Remember the winner and report it."""
        memory = self.memory
        state = TRACKED if compared.distance < self.settings.lost_distance else LOST
        joints = memory.body.joint_positions(pose)
        effectors = memory.body.end_effector_positions(pose)
        extrema = view.extrema.points[:EFFECTORS].astype(np.float64)
        memory.before = memory.previous.pose if memory.previous is not None and source == "local" else None
        memory.pose = pose
        memory.previous = Previous(pose, joints, effectors, extrema if len(extrema) == EFFECTORS else None)
        memory.lost = 0 if state == TRACKED else memory.lost + 1
        if memory.lost >= self.settings.patience:
            memory.previous, memory.lost = None, 0
        confidence = self._fitter.confidence(compared) if state == TRACKED else np.zeros(len(joints))
        reported = memory.smoother.update(pose, timestamp)
        if reported is not pose:
            joints = memory.body.joint_positions(reported)
        return {
            "pose": reported,
            "joints": linear.rotated(joints, self.level_rotation).astype(np.float32),
            "confidence": confidence.astype(np.float32),
            "state": state,
            "source": SOURCES.index(source),
        }

    def _predicted(self, state: int, timestamp: float, clock: StageClock) -> FrameResult:
        """The last known pose, or a standing one before there was any, for a frame that shows nobody."""
        memory = self.memory
        pose = np.zeros(skeleton.POSE_SIZE)
        pose[skeleton.ROOT_POSITION] = UNSEEN
        if memory.pose is not None:
            pose = memory.pose
        # Whoever comes back may stand anywhere, in any pose, facing anywhere.
        memory.previous, memory.centre, memory.timestamp = None, None, timestamp
        memory.facing.reset()
        memory.smoother.reset()
        joints = linear.rotated(memory.body.joint_positions(pose), self.level_rotation).astype(np.float32)
        none = np.zeros(len(joints), dtype=np.float32)
        return FrameResult(pose, joints, none, state, SOURCES.index("predicted"), clock.milliseconds)


def least_turn(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Difference (3,) of two rotation vectors, the first written as its turn the other way round if that is nearer."""
    angle = math.hypot(*before)
    other = before * (1.0 - 2.0 * np.pi / angle) if angle > 0.0 else before
    near, far = after - before, after - other
    return near if math.hypot(*near) <= math.hypot(*far) else far
