"""Tracker of Lopez-Mendez 2011: people from the waist up, by a hierarchical particle filter."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.objective import Comparison, Objective
from toolkit.fitting.placed import Placer
from toolkit.io.parts import Parts
from toolkit.io.typed_values import NotNegative, Range, constant
from toolkit.landmarks.graph import Workspace
from toolkit.people.connection import connected
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.sensing.camera import Camera
from toolkit.trackers.lopez2011.costs import ParticleFrame, mean_cost
from toolkit.trackers.lopez2011.effectors import Effectors, EffectorSettings, find_effectors, find_fork
from toolkit.trackers.lopez2011.filter import ParticleSettings, UpperFilter
from toolkit.trackers.lopez2011.initial import initial_pose
from toolkit.trackers.lopez2011.sighting import Limits, UpperSighting, UpperViewer
from toolkit.trackers.lopez2011.sizing import arm_length, shoulder_breadth, sized_body
from toolkit.trackers.lopez2011.upper import UNSEEN, UpperBodies
from toolkit.tracking.clock import StageClock
from toolkit.tracking.person import PREDICTED, FollowedPerson
from toolkit.tracking.registry import Registration, register
from toolkit.tracking.state import PersonState, Previous
from toolkit.tracking.tracker_protocol import Wanted
from toolkit.tracking.tracker_settings import TrackerSettings
from toolkit.tracks import EMPTY, LOST, TRACKED, FrameResult

PARTICLES, DETECTED = "particles", "detected"


@dataclass(frozen=True)
class ParticleTrackerSettings(TrackerSettings):
    """Settings of the particle filter tracker.

    Attributes
    ----------
    reach : maximum distance below the crown, metres; laps and chairs below it would attract trunk and arms. People
        truncated at the waist or behind a desk reach 0.7 to 0.9 m down; 0 = no limit
    lap : maximum distance below the crown for points in front of the trunk, metres: thighs, knees and desks. Elbows
        hang 0.6 m down; 0 = no limit
    measured_seconds : duration of the size measurement at the beginning, seconds ("a short period of time"); 0 = an
        average body
    lost_cost : cost of an estimate above which a frame is lost; a body that explains nothing costs 60, a correct one of
        the wrong size 20 to 30. A first pose is accepted if its log-probability by Eq. 7 exceeds the negative value: on
        the tuning takes the accepted ones are within 195 mm, the rejected one is 251 mm off
    patience : seconds of consecutive lost frames before a first pose is searched again
    """

    tracker: Literal["particles"] = "particles"
    reach: NotNegative = 0.9
    lap: NotNegative = 0.6
    measured_seconds: NotNegative = 1.5
    lost_cost: Annotated[float, Range(1e-6)] = 48.0
    patience: Annotated[float, Range(1e-6)] = 0.15
    effectors: EffectorSettings = field(default_factory=EffectorSettings)
    particles: ParticleSettings = field(default_factory=ParticleSettings)
    fitting: FittingSettings = constant(FittingSettings())

    @property
    def limits(self) -> Limits:
        """Return the limits of the upper body."""
        return Limits(self.reach, self.lap)


class ParticleFollower(FollowedPerson):
    """Tracker of one person's upper body; see `PersonFollower`.

    Attributes
    ----------
    state : all inputs of the next step besides the sighting; replaced by each `step`
    filtering : the three layers
    """

    def __init__(
        self, settings: ParticleTrackerSettings, camera: Camera, level_rotation: np.ndarray, state: PersonState
    ) -> None:
        small = camera.subsampled(max(1, camera.width // settings.particles.columns))
        self._viewer = UpperViewer(camera, level_rotation, settings.particles.columns, settings.limits)
        self._bodies = UpperBodies(level_rotation)
        self.filtering = UpperFilter(settings.particles)
        placer = Placer(state.body, small, level_rotation)
        super().__init__(state, placer, level_rotation, ParticleTracker.source_names)
        self.settings = settings
        self._objective = Objective(placer, settings.fitting)
        self._workspace = Workspace()

    def step_parts(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> Parts[FrameResult]:
        """See `PersonFollower.step_parts`: one part."""
        yield from ()
        return self.step(sighting, timestamp, clock)

    def step(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> FrameResult:
        """See `PersonFollower.step`: the three layers of the filter, or a first pose by the fork."""
        seen = None if sighting is None else self._viewer.observe(sighting, self._crown())
        clock.record("prepare")
        if seen is None or seen.points < max(self.settings.smallest_person, 1):
            self.state = replace(self.state, previous=None, timestamp=timestamp)
            return replace(self.predicted_row(self.state, EMPTY), stage_ms=clock.milliseconds)
        effectors = find_effectors(seen.cloud, self.settings.effectors, self._workspace)
        clock.record("detect")
        state, rng = self.state, self.rng(self.state)
        if state.centre is not None and not connected(state.centre, effectors.source, state.elapsed(timestamp)):
            state = replace(state, previous=None, lost=0.0)
        self.state = state = replace(state, centre=effectors.source)
        if state.previous is None:
            found = self._first(effectors, seen.frame(effectors))
            source = DETECTED
        else:
            found = self._next(seen.frame(effectors), timestamp, rng, clock)
            source = PARTICLES
        self.state = state = replace(self.state, generator=self.after(rng))
        if found is None:
            clock.record("detect")
            self.state = replace(state, timestamp=timestamp)
            return replace(self.predicted_row(self.state, LOST), stage_ms=clock.milliseconds)
        pose, particles, cost = found
        compared = self._objective.compare(state.body, pose, seen.scene(effectors, self.settings.fitting))
        row = self._commit(pose, particles, cost, compared, source, timestamp)
        clock.record("compare")
        return replace(row, stage_ms=clock.milliseconds)

    def _crown(self) -> float | None:
        """Return the height of the tracked head, metres, level frame."""
        if self.state.previous is None:
            return None
        tips = self.state.body.end_effector_positions(self.state.previous.pose)
        return float(tips[skeleton.END_EFFECTORS.index("head"), 1])

    def _first(self, effectors: Effectors, frame: ParticleFrame) -> tuple[np.ndarray, np.ndarray, float] | None:
        """Return pose, particles and cost of a first pose if Eq. 7 accepts it, else None. The threshold is the cost of
        a lost pose minus the distances of crown and hands.
        """
        fork = find_fork(effectors, self.settings.effectors)
        if fork is None:
            return None
        upper = self._bodies.of(self.state.body)
        first = initial_pose(upper, effectors, fork, frame)
        if first.score <= -self.settings.lost_cost:
            return None
        particles = np.repeat(first.pose[None], self.settings.particles.count, axis=0)
        return first.pose, particles, mean_cost(upper, first.pose, frame)

    def _next(
        self, frame: ParticleFrame, timestamp: float, rng: np.random.Generator, clock: StageClock
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return pose, particles and cost by the three layers."""
        state, upper = self.state, self._bodies.of(self.state.body)
        assert state.previous is not None and state.timestamp is not None
        dt, before = timestamp - state.timestamp, state.previous.pose
        particles = self.filtering.trunk(upper, state.memory[PARTICLES]["poses"], before, frame, dt, rng)
        clock.record("trunk")
        filtered = self.filtering.arms(upper, particles, before, frame, dt, rng)
        clock.record("arms")
        return filtered.estimate, filtered.particles, filtered.cost

    def _commit(
        self, pose: np.ndarray, particles: np.ndarray, cost: float, compared: Comparison, source: str, timestamp: float
    ) -> FrameResult:
        """Store the pose in the state and return its result."""
        state, settings = self.state, self.settings
        tracked = cost < settings.lost_cost
        lost = 0.0 if tracked else state.lost + state.elapsed(timestamp)
        given_up = lost >= settings.patience
        self.state = replace(
            state,
            previous=None if given_up else Previous.of_pose(state.body, pose),
            pose=pose,
            timestamp=timestamp,
            lost=0.0 if given_up else lost,
            memory={PARTICLES: {"poses": particles}},
        )
        joints = state.body.joint_positions(pose)
        confidence = self._objective.confidence(compared, joints) if tracked else np.zeros(len(joints))
        confidence[UNSEEN] = 0.0
        observed = np.ones(len(confidence), dtype=np.bool_)
        observed[UNSEEN] = False
        return self.row(pose, joints, confidence, observed, TRACKED if tracked else LOST, source)


class MeasuredBody:
    """A `BodyLearner` that measures shoulders and arms; see `sizing`.

    Parameters
    ----------
    settings : see `ParticleTrackerSettings`
    camera, level_rotation : see `Tracker.learner`
    """

    found = False

    def __init__(self, settings: ParticleTrackerSettings, camera: Camera, level_rotation: np.ndarray) -> None:
        self._settings = settings
        self._viewer = UpperViewer(camera, level_rotation, settings.particles.columns, settings.limits)
        self._seen: list[UpperSighting] = []

    def observe(self, sighting: Sighting, timestamp: float) -> None:
        """See `BodyLearner.observe`."""
        seen = self._viewer.observe(sighting)
        if seen.points >= max(self._settings.smallest_person, 1):
            self._seen.append(seen)

    def observe_parts(self, sighting: Sighting, timestamp: float) -> Parts[None]:
        """See `BodyLearner.observe_parts`: a single part."""
        yield
        self.observe(sighting, timestamp)

    def preview(self, sighting: Sighting | None, timestamp: float) -> FrameResult | None:
        """Return None, because no person is tracked during the measurement."""
        return None

    def predicted(self) -> PredictedBody:
        """Raise NotImplementedError, because no person is tracked during the measurement."""
        raise NotImplementedError("a body measurement has no position")

    @property
    def body(self) -> Body | None:
        """See `BodyLearner.body`: from shoulder widths, and arm lengths in frames with a fork."""
        settings, workspace = self._settings.effectors, Workspace()
        breadths: list[float] = []
        arms: list[float] = []
        for seen in self._seen:
            breadth = shoulder_breadth(seen.cloud)
            breadths += [] if breadth is None else [breadth]
            effectors = find_effectors(seen.cloud, settings, workspace)
            fork = find_fork(effectors, settings)
            if fork is not None:
                lengths = [arm_length(effectors.paths[row]) for row in (fork.left_hand, fork.right_hand)]
                arms += [length for length in lengths if length is not None]
        return sized_body(breadths, arms)


class ParticleTracker:
    """Tracker of Lopez-Mendez 2011: first pose and size by geodesic candidates, then the particle filter.

    Legs are not tracked: they hang straight down with confidence 0.

    Parameters
    ----------
    settings : see `ParticleTrackerSettings`
    body : the person's own body if known; default: measured
    """

    stage_names = ("prepare", "detect", "trunk", "arms", "compare")
    source_names = (PARTICLES, DETECTED, PREDICTED)
    database = ""
    joints_wanted: Wanted = "none"

    def __init__(self, settings: ParticleTrackerSettings | None = None, *, body: Body | None = None) -> None:
        self.settings = settings or ParticleTrackerSettings()
        self._known_body = body

    @property
    def learning_seconds(self) -> float:
        """See `Tracker.learning_seconds`."""
        return self.settings.measured_seconds if self._known_body is None else 0.0

    def set_body(self, body: Body) -> None:
        """Set the body of all people tracked from now on; none is measured."""
        self._known_body = body

    def learner(self, camera: Camera, level_rotation: np.ndarray, floor: float | None = None) -> MeasuredBody:
        """See `Tracker.learner`."""
        return MeasuredBody(self.settings, camera, level_rotation)

    def follower(self, camera: Camera, level_rotation: np.ndarray, body: Body | None = None) -> ParticleFollower:
        """See `Tracker.follower`."""
        known = body or self._known_body
        state = PersonState.begin(known or load_body("neutral"), sized=known is not None, seed=self.settings.seed)
        return ParticleFollower(self.settings, camera, level_rotation, state)


register(
    "particles",
    Registration(
        ParticleTrackerSettings,
        needs_database=False,
        build=lambda settings, database, path: ParticleTracker(settings),
    ),
)
