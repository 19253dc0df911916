"""A person's own body, learnt from the first seconds in which they are seen."""

from __future__ import annotations

import math
from dataclasses import replace

from toolkit.body.body import Body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.refiner import mesh_terms
from toolkit.fitting.shape import ShapeEstimator, ShapeSettings
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import Follower
from toolkit.tracks import TRACKED, FrameResult


class FollowedBody:
    """A `BodyLearner` that follows the person with a body that becomes their own.

    Parameters
    ----------
    follower : from before the first sighting, of a body whose size is not known
    stages : names of the follower's stages
    settings : how many frames of a second take part, and what holds the body to the likely ones
    fitting : of the terms that tie the body's surface to the frame

    Attributes
    ----------
    follower, settings : as above
    result : see `BodyLearner.result`
    """

    def __init__(
        self, follower: Follower, stages: tuple[str, ...], settings: ShapeSettings, fitting: FittingSettings
    ) -> None:
        self.follower, self.settings, self._stages, self._fitting = follower, settings, stages, fitting
        self._estimator: ShapeEstimator | None = None
        self._statures = (0.0, math.inf)
        self._pace = RateLimiter(settings.rate)
        self.result: FrameResult | None = None

    @property
    def found(self) -> bool:
        """See `BodyLearner.found`."""
        return self.follower.state.pose is not None

    @property
    def body(self) -> Body | None:
        """See `BodyLearner.body`."""
        return self.follower.body if self.follower.state.sized else None

    def predicted(self) -> PredictedBody:
        """See `BodyLearner.predicted`."""
        return self.follower.predicted()

    def observe(self, sighting: Sighting, timestamp: float) -> None:
        """See `BodyLearner.observe`."""
        if self._pace.takes(timestamp):
            self.take(sighting, timestamp)

    def begin(self, body: Body, statures: tuple[float, float] = (0.0, math.inf)) -> None:
        """Forget the person; they are found anew with a body that may be theirs, and is learnt between these statures,
        metres.
        """
        self.follower.state = replace(self.follower.state, body=body, sized=True, previous=None)
        self._estimator, self._statures = None, statures

    def take(self, sighting: Sighting, timestamp: float) -> None:
        """Take in a sighting, however soon after the one before."""
        follower = self.follower
        self.result = result = follower.step(sighting, timestamp, StageClock(self._stages))
        if result.state != TRACKED or follower.observation is None:
            return
        if self._estimator is None:
            terms = mesh_terms(self._fitting)
            placer = follower.objective.placer
            self._estimator = ShapeEstimator(follower.body, self.settings, placer, terms, self._statures)
        body = self._estimator.observe(result.pose, follower.observation.scene)
        follower.state = replace(follower.state, body=body)


class RateLimiter:
    """Chooses evenly spread frames: at most about `rate` in a second."""

    def __init__(self, rate: float) -> None:
        self._rate, self._due = rate, -math.inf

    def takes(self, timestamp: float) -> bool:
        """Whether the next frame, at `timestamp` seconds, is one of them."""
        # Clocks are not even: a third of the time between two is let go.
        if timestamp < self._due - 0.3 / self._rate:
            return False
        self._due = max(self._due, timestamp) + 1.0 / self._rate
        return True
