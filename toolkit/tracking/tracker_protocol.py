"""Interface of trackers, the only one that the pipeline uses."""

from __future__ import annotations

from typing import Literal, Protocol, runtime_checkable

import numpy as np

from toolkit.body.body import Body
from toolkit.io.parts import Parts
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.sensing.camera import Camera
from toolkit.tracking.clock import StageClock
from toolkit.tracking.tracker_settings import TrackerSettings
from toolkit.tracks import FrameResult

Wanted = Literal["none", "offered", "required"]


class PersonFollower(Protocol):
    """Tracker of one person, frame by frame, without an initial pose.

    Attributes
    ----------
    CHECKPOINT : attributes on which the next step depends besides the sighting, see `toolkit.io.checkpoint`
    """

    CHECKPOINT: tuple[str, ...]

    @property
    def body(self) -> Body:
        """Body as fitted so far, with its shape and scale."""
        ...

    def step(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> FrameResult:
        """Find the person in the next frame, at `timestamp` seconds; None without a sighting."""
        ...

    def step_parts(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> Parts[FrameResult]:
        """Compute the same as `step` in parts; a detection has one for each search and body."""
        ...

    def predicted(self) -> PredictedBody:
        """Return the body predicted for the next frame."""
        ...


class BodyLearner(Protocol):
    """Learner of one person's body, from sighting to sighting.

    Attributes
    ----------
    found : True once the person was found, so that `predicted` is available
    body : as learnt so far; None before the first sighting
    """

    @property
    def found(self) -> bool:
        """See above."""
        ...

    @property
    def body(self) -> Body | None:
        """See above."""
        ...

    def observe(self, sighting: Sighting, timestamp: float) -> None:
        """Process the next sighting, at `timestamp` seconds."""
        ...

    def observe_parts(self, sighting: Sighting, timestamp: float) -> Parts[None]:
        """Compute the same as `observe` in parts, which begin with a stop; none if the sighting is left out."""
        ...

    def preview(self, sighting: Sighting | None, timestamp: float) -> FrameResult | None:
        """Return a pose of the newest frame, which may be later than the last observed one, with the body so far.

        None as long as the person is not found, and always for a learner that does not follow the person.
        """
        ...

    def predicted(self) -> PredictedBody:
        """Return the body predicted for the next frame."""
        ...


@runtime_checkable
class AcceptsBody(Protocol):
    """Tracker that accepts the person's own body."""

    def set_body(self, body: Body) -> None:
        """Set the body of all people tracked from now on; none is learnt."""
        ...


class Tracker(Protocol):
    """Tracking method with its settings; it makes the followers of the people in front of a camera.

    Attributes
    ----------
    settings : written beside its results
    database : path of the pose database it uses, empty for none
    stage_names : of the timed stages, in the order of `FrameResult.stage_ms`; the first is "prepare"
    source_names : of the hypotheses that can win, indexed by `FrameResult.source`
    learning_seconds : how long a person is seen before a body is learnt and the first row is written; 0 = no body is
    joints_wanted : use of image joints: "none" ignores them, "offered" uses those of the recording or the user,
        "required" needs them unless the user declines
    """

    database: str

    @property
    def settings(self) -> TrackerSettings:
        """See above."""
        ...

    @property
    def stage_names(self) -> tuple[str, ...]:
        """See above."""
        ...

    @property
    def source_names(self) -> tuple[str, ...]:
        """See above."""
        ...

    @property
    def learning_seconds(self) -> float:
        """See above."""
        ...

    @property
    def joints_wanted(self) -> Wanted:
        """See above."""
        ...

    def learner(self, camera: Camera, level_rotation: np.ndarray, floor: float | None = None) -> BodyLearner:
        """Return a learner of one person's body; only called if `learning_seconds` is not 0.

        `floor` is its y, metres, level frame, where it is known.
        """
        ...

    def follower(self, camera: Camera, level_rotation: np.ndarray, body: Body | None = None) -> PersonFollower:
        """Return a follower of one person, with the body of a `learner` if there is one."""
        ...
