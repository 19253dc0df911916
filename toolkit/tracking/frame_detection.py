"""One person in any frame of a recording: detected again, or followed to from another frame."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit.body.body import Body
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import FollowedFrame, Follower, StepContext
from toolkit.tracking.heading import weighed
from toolkit.tracking.search.search_protocol import UNLIKELY
from toolkit.tracking.sightings import PersonSightings
from toolkit.tracking.state import PersonState, Previous
from toolkit.tracking.trajectory_choice import Direction, Step

NOTHING_FOUND = 0.4
"""Cost of a frame without a pose, metres: twice that of an unexplained point."""


@dataclass(frozen=True, eq=False)
class Detection:
    """A person in one frame, and the state from which the next frame can be followed.

    Attributes
    ----------
    followed : result of the follower
    step : as a step of a trajectory
    """

    followed: FollowedFrame
    step: Step


class FrameDetector:
    """Detects and follows one person, whose body is known, in any frame of a recording.

    Parameters
    ----------
    follower : follower of the person
    body : the person's own
    seen : the person's sightings
    timestamps : float64 (T,), seconds, of all frames of the recording
    stages : names of the follower's stages
    heading : float64 (T, 2), expected heading in each frame, see `toolkit.tracking.heading.heading`

    Attributes
    ----------
    unknown : state of the person before any frame
    """

    def __init__(
        self,
        follower: Follower,
        body: Body,
        seen: PersonSightings,
        timestamps: np.ndarray,
        stages: tuple[str, ...],
        heading: np.ndarray,
    ) -> None:
        self._follower, self._body, self._seen = follower, body, seen
        self._timestamps, self._stages, self._heading = timestamps, stages, heading
        self.unknown = replace(follower.state, body=body, sized=True)

    def follow(self, frame: int, state: PersonState, direction: Direction) -> Detection:
        """Follow the person to a frame from the state in another one."""
        clock, moment = StageClock(self._stages), float(self._timestamps[frame])
        followed = self._follower.follow(state, self._seen[frame], moment, self._context(frame), clock)
        if followed.winner is None:
            return Detection(followed, Step(followed.row, NOTHING_FOUND, direction, continues=False))
        hypothesis = followed.winner.hypothesis
        cost = weighed(followed.distance, hypothesis.pose, self._heading[frame])
        return Detection(followed, Step(followed.row, cost, direction, continues=hypothesis.continues))

    def redetect(self, frame: int, direction: Direction) -> Detection:
        """Detect the person in a frame independently of all others."""
        return self.follow(frame, self.unknown, direction)

    def state_at(self, frame: int, pose: np.ndarray) -> PersonState:
        """Return the state of a person who was just found in a pose (P,) in a frame."""
        previous, moment = Previous.of_pose(self._body, pose), float(self._timestamps[frame])
        return replace(self.unknown, previous=previous, pose=pose, timestamp=moment)

    def cost(self, frame: int, pose: np.ndarray, followed: FollowedFrame, *, prior: bool = False) -> float:
        """Return the cost of another pose (P,) in a frame that was followed, metres; infinite without a sighting.

        `prior` adds the energy of the pose prior, as for a pose that is detected independently of other frames.
        """
        if followed.observation is None:
            return np.inf
        compared = self._follower.objective.compare(self._body, pose, followed.observation.scene)
        distance = compared.distance + UNLIKELY * compared.energy if prior else compared.distance
        return weighed(distance, pose, self._heading[frame])

    def _context(self, frame: int) -> StepContext:
        return StepContext(self._follower.sizes, self._heading[frame])
