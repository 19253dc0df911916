"""The hybrid tracker: local optimisation and database lookup, fused late (Baak 2013, 5.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace, load_body
from toolkit.database.database import PoseDatabase
from toolkit.fitting.fitter import Fitter
from toolkit.fitting.scene import Scene
from toolkit.fitting.shape import ShapeEstimator
from toolkit.fitting.terms import GaussianPrior
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.extrema import extrema_of_graph, source_node
from toolkit.landmarks.facing import FacingFilter, estimate_facing
from toolkit.landmarks.graph import Workspace, grid_graph
from toolkit.landmarks.parts import JointForest
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.cleaning import Cleaner
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.track import EMPTY, LOST, TRACKED, FrameResult
from toolkit.tracking.clock import StageClock
from toolkit.tracking.proposals import ExtremaProposer, JointsProposer, Previous, Proposer
from toolkit.tracking.settings import HybridSettings
from toolkit.tracking.view import View

STAGES = ("prepare", "landmarks", "local", "lookup", "select", "shape")
SOURCES = ("local", "extrema", "joints", "predicted")


@dataclass
class Memory:
    """Everything that the next step depends on besides the depth image."""

    cleaner: Cleaner
    facing: FacingFilter
    shape: ShapeEstimator | None
    body: Body
    previous: Previous | None = None
    centre: np.ndarray | None = None
    timestamp: float | None = None
    joints: np.ndarray | None = None


class HybridTracker:
    """Tracks one person; see `Tracker` for the attributes."""

    stage_names = STAGES
    source_names = SOURCES

    def __init__(
        self,
        database: PoseDatabase,
        settings: HybridSettings | None = None,
        *,
        forest: JointForest | None = None,
        body: Body | None = None,
        database_path: str = "",
    ) -> None:
        self.settings = settings or HybridSettings()
        self.database = database_path
        self._first_body = body or load_body("neutral")
        self._personal = body is None
        self._forest = forest if "joints" in self.settings.hypotheses else None
        weight = self.settings.fitting.prior_weight
        self._priors = [GaussianPrior.of_poses(database.poses, weight)] if weight > 0.0 else []
        self._proposers: dict[str, Proposer] = {}
        if "extrema" in self.settings.hypotheses:
            self._proposers["extrema"] = ExtremaProposer(database, self.settings.lookup)
        if self._forest is not None:
            self._proposers["joints"] = JointsProposer(database)

    @property
    def body(self) -> Body:
        """The body as fitted so far."""
        return self.memory.body

    def start(self, recording: Recording) -> None:
        """See `Tracker.start`."""
        cleaner = Cleaner.for_recording(recording, self.settings.sensing)
        self.level_rotation = level_rotation(recording.up_camera)
        self.memory: Memory = Memory(cleaner, FacingFilter(self.settings.landmarks), None, self._first_body)
        small = cleaner.camera.subsampled(2) if cleaner.camera.width > 200 else cleaner.camera
        self._fitter = Fitter(self._first_body, small, self.level_rotation, self.settings.fitting, self._priors)
        self._workspace = Workspace()

    def step(self, depth_mm: np.ndarray, timestamp: float) -> FrameResult:
        """See `Tracker.step`. Reads like Baak 2013, 5.4: prepare, landmarks, two hypotheses, selection."""
        memory, clock = self.memory, StageClock(STAGES)
        self._fitter.posed.set_body(memory.body)

        depth = memory.cleaner.clean(depth_mm)
        cloud = Cloud.from_depth(depth, memory.cleaner.camera, self.level_rotation)
        clock.lap("prepare")
        if len(cloud) < self.settings.smallest_person:
            return self._predicted(EMPTY, timestamp, clock)

        view = self._view(cloud, timestamp)
        clock.lap("landmarks")

        if memory.previous is None:
            hypotheses = self._first_hypotheses(view)
            clock.lap("lookup")
        else:
            hypotheses = {}
            if "local" in self.settings.hypotheses:
                hypotheses["local"] = self._fitter.refine(memory.previous.pose, view.scene)
                clock.lap("local")
            hypotheses |= self._retrieved(view)
            clock.lap("lookup")
        if not hypotheses:
            return self._predicted(LOST, timestamp, clock)

        distances = {name: self._fitter.sparse_distance(pose, view.scene) for name, pose in hypotheses.items()}
        winner = min(distances, key=distances.__getitem__)
        pose = hypotheses[winner]
        state = TRACKED if distances[winner] < self.settings.lost_distance else LOST
        result = self._result(pose, view, state, winner, timestamp)
        clock.lap("select")

        if state == TRACKED:
            self._learn_shape(pose, view)
            clock.lap("shape")
        return FrameResult(**result, stage_ms=clock.milliseconds)

    def _view(self, cloud: Cloud, timestamp: float) -> View:
        """Centre, facing, extrema and votes of a cloud (Baak 2013, 5.3.4 and 5.4.2)."""
        memory, settings = self.memory, self.settings
        scale = memory.body.height / 1.7
        centre = cloud_centre(cloud.points, memory.centre, settings.landmarks, scale)
        dt = 1 / 30 if memory.timestamp is None else timestamp - memory.timestamp
        estimate = estimate_facing(cloud.points, centre, settings.landmarks, scale)
        yaw = memory.facing.update(estimate, dt, centre)
        graph = grid_graph(cloud, settings.landmarks, self._workspace)
        extrema = extrema_of_graph(
            graph, cloud.points, settings.extrema, source_node(graph, cloud.points, centre), self._workspace
        )
        votes = None if self._forest is None else self._forest.estimate(cloud, settings.vote_samples)
        fitting = settings.fitting
        scene = Scene(cloud, extrema.points.astype(np.float64), fitting.cloud_samples, fitting.search)
        memory.centre, memory.timestamp = centre, timestamp
        return View(cloud, centre, yaw, extrema, votes, scene)

    def _retrieved(self, view: View) -> dict[str, np.ndarray]:
        """One refined hypothesis per proposer: of its best candidates the one nearest to the frame (5.4.3)."""
        hypotheses = {}
        for name, proposer in self._proposers.items():
            candidates = proposer.propose(view, self.memory.previous, self.memory.body, self.settings.candidates)
            if len(candidates) > 1:
                distances = [self._fitter.sparse_distance(pose, view.scene) for pose in candidates]
                candidates = candidates[[int(np.argmin(distances))]]
            if len(candidates):
                hypotheses[name] = self._fitter.refine(candidates[0], view.scene)
        return hypotheses

    def _first_hypotheses(self, view: View) -> dict[str, np.ndarray]:
        """Hypotheses without a previous pose, for every size of the body on the very first frame; sets that size."""
        memory, settings = self.memory, self.settings
        bodies = [memory.body]
        if self._personal and memory.shape is None:
            space, shape = ShapeSpace.load(), self._first_body.shape
            bodies = [space.body(np.concatenate([[size], shape[1:]])) for size in settings.sizes]
        best: dict[str, tuple[float, np.ndarray, Body]] = {}
        for body in bodies:
            self._fitter.posed.set_body(body)
            for name, proposer in self._proposers.items():
                for candidate in proposer.propose(view, None, body, settings.starts):
                    pose = self._fitter.refine(candidate, view.scene, iterations=2 * settings.fitting.iterations)
                    distance = self._fitter.sparse_distance(pose, view.scene)
                    if name not in best or distance < best[name][0]:
                        best[name] = (distance, pose, body)
        if best:
            memory.body = min(best.values(), key=lambda entry: entry[0])[2]
            self._fitter.posed.set_body(memory.body)
        return {name: pose for name, (_, pose, body) in best.items() if body is memory.body}

    def _result(self, pose: np.ndarray, view: View, state: int, source: str, timestamp: float) -> dict[str, Any]:
        """Remember the winner and report it."""
        memory = self.memory
        joints = memory.body.joint_positions(pose)
        effectors = memory.body.end_effector_positions(pose)
        extrema = view.extrema.points[:5].astype(np.float64)
        memory.previous = Previous(pose, joints, effectors, extrema if len(extrema) == 5 else None)
        return {
            "pose": pose,
            "joints": (joints @ self.level_rotation).astype(np.float32),
            "confidence": np.full(len(joints), 1.0 if state == TRACKED else 0.0, dtype=np.float32),
            "state": state,
            "source": SOURCES.index(source),
        }

    def _predicted(self, state: int, timestamp: float, clock: StageClock) -> FrameResult:
        """The last known pose, or a standing one before there was any, for a frame that shows nobody."""
        memory = self.memory
        pose = np.zeros(skeleton.POSE_SIZE)
        pose[2] = -3.0
        if memory.previous is not None:
            pose = memory.previous.pose
        memory.timestamp = timestamp
        joints = (memory.body.joint_positions(pose) @ self.level_rotation).astype(np.float32)
        none = np.zeros(len(joints), dtype=np.float32)
        return FrameResult(pose, joints, none, state, SOURCES.index("predicted"), clock.milliseconds)

    def _learn_shape(self, pose: np.ndarray, view: View) -> None:
        """Personal shape from the first tracked frames, then fixed."""
        memory = self.memory
        if not self._personal or self.settings.shape.frames == 0:
            return
        if memory.shape is None:
            memory.shape = ShapeEstimator(memory.body, self.settings.shape, self._fitter.surface, self._fitter.cloud)
        if not memory.shape.certain:
            self._fitter.posed.place(pose)
            self._fitter.posed.draw()
            memory.body = memory.shape.observe(self._fitter.posed, pose, view.scene)
