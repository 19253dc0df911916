"""One person looked at in any frame of a recording: where they are found afresh, or followed to from another frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from toolkit.body.body import Body
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import Follower
from toolkit.tracking.sightings import PersonSightings
from toolkit.tracking.state import PersonState
from toolkit.tracking.trajectory_choice import Step

NOTHING_FOUND = 0.4
"""Metres that a frame costs in which no pose was found: twice what an unexplained point does."""


@dataclass(frozen=True, eq=False)
class Detection:
    """What a look afresh says of one frame.

    Attributes
    ----------
    step : as a step of a way
    state : of the follower after it
    cost : metres, of the pose, with how unlikely it is; infinite where none was found
    """

    step: Step
    state: PersonState
    cost: float


class FrameDetector:
    """Looks at one person in any frame of a recording.

    Parameters
    ----------
    follower : of the person
    seen : the person's sightings
    timestamps : float64 (T,), seconds, of all frames of the recording
    stages : names of the follower's stages
    heading : float64 (T, 2), where the person heads in each frame, see `heading`

    Attributes
    ----------
    follower, heading : as above; more may be known of the latter later
    """

    def __init__(
        self,
        follower: Follower,
        seen: PersonSightings,
        timestamps: np.ndarray,
        stages: tuple[str, ...],
        heading: np.ndarray,
    ) -> None:
        self.follower, self._unknown = follower, follower.state
        self._seen, self._timestamps, self._stages, self.heading = seen, timestamps, stages, heading

    def follow(self, frame: int) -> Step:
        """Follow on to a frame, from where the follower is."""
        follower = self.follower
        follower.heading = self.heading[frame]
        result = follower.step(self._seen[frame], float(self._timestamps[frame]), StageClock(self._stages))
        if follower.winner is None:
            return Step(result, NOTHING_FOUND, continues=False)
        cost = follower.weighed(follower.distance, follower.winner.hypothesis.pose)
        return Step(result, cost, follower.winner.hypothesis.continues)

    def redetect(self, frame: int, body: Body) -> Detection:
        """Find the person, whose body this is, in a frame without knowing anything of the others."""
        self.follower.state = replace(self._unknown, body=body, sized=True)
        step = self.follow(frame)
        winner = self.follower.winner
        return Detection(step, self.follower.state, math.inf if winner is None else self.follower.cost(winner))
