"""Interface of trackers, the only one that the pipeline uses."""

from __future__ import annotations

from typing import Literal, Protocol, runtime_checkable

import numpy as np

from toolkit.body.body import Body
from toolkit.fitting.guide import Guide
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
    """Learner of one person's body, from sighting to sighting."""

    @property
    def found(self) -> bool:
        """True once the person was found, so that `predicted` is available."""
        ...

    @property
    def body(self) -> Body | None:
        """Body as learnt so far; None before the first sighting."""
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


@runtime_checkable
class AcceptsGuide(Protocol):
    """Tracker that inertial sensors guide."""

    guide: Guide


class Tracker(Protocol):
    """Tracking method with its settings; it makes the followers of the people in front of a camera.

    Attributes
    ----------
    database : path of the pose database it uses, empty for none
    """

    database: str

    @property
    def settings(self) -> TrackerSettings:
        """Settings, written beside the results."""
        ...

    @property
    def stage_names(self) -> tuple[str, ...]:
        """Names of the timed stages, in the order of `FrameResult.stage_ms`; the first is "prepare"."""
        ...

    @property
    def source_names(self) -> tuple[str, ...]:
        """Names of the hypotheses that can win, indexed by `FrameResult.source`."""
        ...

    @property
    def learning_seconds(self) -> float:
        """Seconds in view before a body is learnt and the first row is written; 0 = no body is learnt."""
        ...

    @property
    def joints_wanted(self) -> Wanted:
        """Use of image joints: "none", "offered" (of the recording or the user), "required" (unless declined)."""
        ...

    def learner(self, camera: Camera, level_rotation: np.ndarray, floor: float | None = None) -> BodyLearner:
        """Return a learner of one person's body; only called if `learning_seconds` is not 0.

        `floor` is its y, metres, level frame, where it is known.
        """
        ...

    def follower(self, camera: Camera, level_rotation: np.ndarray, body: Body | None = None) -> PersonFollower:
        """Return a follower of one person, with the body of a `learner` if there is one."""
        ...
