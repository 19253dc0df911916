"""Learning of a person's body from the first seconds in view."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from toolkit.body.body import Body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.refiner import mesh_terms
from toolkit.fitting.shape import ShapeEstimator, ShapeSettings
from toolkit.io.parts import Parts, whole
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.sensing.cloud import Cloud
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import Follower, StepContext
from toolkit.tracking.state import PersonState
from toolkit.tracking.stature import likeliest_size
from toolkit.tracks import TRACKED, FrameResult


class FollowedBody:
    """`BodyLearner` that follows the person with a body that becomes their own.

    Parameters
    ----------
    follower : from before the first sighting, of a body whose size is not known
    preview_follower : makes one that detects a person within a frame, of less accurate poses
    stages : names of the follower's stages
    settings : frames per second that take part, and weight of the shape prior
    fitting : settings of the terms that tie the body's surface to the frame

    Attributes
    ----------
    follower, settings : as above
    state : state of the follower before the next sighting
    result : result of the last sighting that was taken in; None before the first one
    """

    def __init__(
        self, follower: Follower, preview_follower: Callable[[], Follower], stages: tuple[str, ...],
        settings: ShapeSettings, fitting: FittingSettings,
    ) -> None:  # fmt: skip
        self._preview_follower = preview_follower
        self.follower, self.settings, self._stages, self._fitting = follower, settings, stages, fitting
        self.state = follower.state
        self._estimator: ShapeEstimator | None = None
        self._statures = (0.0, math.inf)
        self._pace = RateLimiter(settings.rate)
        self.result: FrameResult | None = None
        self._preview: Follower | None = None

    @property
    def found(self) -> bool:
        """See `BodyLearner.found`."""
        return self._newest.pose is not None

    @property
    def _newest(self) -> PersonState:
        """State of the preview, which may be later than that of the learner, if there is one."""
        return self.state if self._preview is None else self._preview.state

    @property
    def body(self) -> Body | None:
        """See `BodyLearner.body`."""
        return self.state.body if self.state.sized else None

    def predicted(self) -> PredictedBody:
        """See `BodyLearner.predicted`."""
        return self.follower.predicted_in(self._newest)

    def observe(self, sighting: Sighting, timestamp: float) -> None:
        """See `BodyLearner.observe`."""
        whole(self.observe_parts(sighting, timestamp))

    def observe_parts(self, sighting: Sighting, timestamp: float) -> Parts[None]:
        """See `BodyLearner.observe_parts`."""
        if not self._pace.takes(timestamp):
            return
        yield
        yield from self._take_parts(sighting, timestamp, StepContext(self.follower.sizes))

    def preview(self, sighting: Sighting | None, timestamp: float) -> FrameResult | None:
        """See `BodyLearner.preview`: that of the learner if it is of this frame, else one that follows on."""
        if self._preview is None:
            self._preview = self._preview_follower()
        preview = self._preview
        if self.result is not None and self.state.timestamp == timestamp:
            preview.state = self.state
            return self.result
        if self.body is not None:
            preview.state = replace(preview.state, body=self.body, sized=True)
        elif not preview.state.sized and sighting is not None:
            cloud = Cloud.from_depth(sighting.depth, sighting.camera, preview.level_rotation)
            observation = preview.observer.observe(cloud, timestamp, preview.state, sighting.unobserved)
            preview.sizes = (likeliest_size(self.follower.sizes, observation.estimate),)
        row = preview.step(sighting, timestamp, StageClock(self._stages))
        return row if preview.state.pose is not None else None

    def begin(self, body: Body, statures: tuple[float, float] = (0.0, math.inf)) -> None:
        """Detect the person again with a body that may be theirs, and is learnt between these statures, metres."""
        self.state = replace(self.state, body=body, sized=True, previous=None)
        self._estimator, self._statures = None, statures

    def rewind(self, state: PersonState) -> None:
        """Continue from an earlier state with the body as learnt since."""
        self.state = replace(state, body=self.state.body)

    def take(self, sighting: Sighting, timestamp: float, context: StepContext) -> float:
        """Take in a sighting; return the distance of the pose from it, metres, infinite if none was found."""
        return whole(self._take_parts(sighting, timestamp, context))

    def _take_parts(self, sighting: Sighting, timestamp: float, context: StepContext) -> Parts[float]:
        clock = StageClock(self._stages)
        followed = yield from self.follower.follow_parts(self.state, sighting, timestamp, context, clock)
        self.state, self.result = followed.state, followed.row
        if followed.row.state != TRACKED or followed.observation is None:
            return followed.distance
        if self._estimator is None:
            terms = mesh_terms(self._fitting)
            placer = self.follower.objective.placer
            self._estimator = ShapeEstimator(self.state.body, self.settings, placer, terms, self._statures)
        body = self._estimator.observe(followed.row.pose, followed.observation.scene)
        self.state = replace(self.state, body=body)
        return followed.distance


class RateLimiter:
    """Selector of evenly spread frames: at most about `rate` in a second."""

    def __init__(self, rate: float) -> None:
        self._rate, self._due = rate, -math.inf

    def takes(self, timestamp: float) -> bool:
        """Return True if the next frame, at `timestamp` seconds, is selected."""
        # clocks are uneven: a tolerance of a third of the interval
        if timestamp < self._due - 0.3 / self._rate:
            return False
        self._due = max(self._due, timestamp) + 1.0 / self._rate
        return True
