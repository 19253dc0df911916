"""Base of trackers whose followers use searches: camera, body, and body learning from the first frames."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace, load_body
from toolkit.fitting.joint_confidence import JointConfidence, joint_confidence
from toolkit.fitting.objective import Objective
from toolkit.fitting.placed import Placer
from toolkit.fitting.priors import PoseTerm
from toolkit.fitting.refiner import Refiner
from toolkit.io.parts import Parts
from toolkit.sensing.camera import Camera
from toolkit.tracking.body_learning import FollowedBody
from toolkit.tracking.follower import Follower
from toolkit.tracking.observation import Observer
from toolkit.tracking.occluded_limbs import OccludedLimbs
from toolkit.tracking.passes import BidirectionalTracker, Followed
from toolkit.tracking.planning import Planner
from toolkit.tracking.search.search_protocol import Search, Verifier
from toolkit.tracking.sightings import PersonSightings
from toolkit.tracking.state import PersonState
from toolkit.tracking.tracker_protocol import Wanted
from toolkit.tracking.tracker_settings import SearchingSettings


class SearchingTracker(ABC):
    """Tracker whose followers query searches, and which learns the body of each person from the first frames.

    Subclasses define the observation of sightings and the searches; see `Tracker` for the rest.

    Parameters
    ----------
    body : the person's own body, if it is known; otherwise it is learnt from the recording
    """

    kind: type[Follower] = Follower
    settings: SearchingSettings

    def __init__(self, body: Body | None) -> None:
        self._known_body: Body | None = None
        self._first_body = load_body("neutral")
        if body is not None:
            self.set_body(body)

    def set_body(self, body: Body) -> None:
        """Set the body of all people tracked from now on; none is learnt."""
        self._known_body = self._first_body = body

    @property
    @abstractmethod
    def stage_names(self) -> tuple[str, ...]:
        """See `Tracker`."""

    @property
    @abstractmethod
    def source_names(self) -> tuple[str, ...]:
        """See `Tracker`."""

    @property
    def priors(self) -> Sequence[PoseTerm]:
        """Terms in the pose vector, for the local optimisation and for comparisons."""
        return ()

    @property
    def occluded_limbs(self) -> OccludedLimbs | None:
        """Estimator of occluded limbs; None keeps the winner unchanged."""
        return None

    @property
    def regressions(self) -> JointConfidence:
        """Regressions of the confidence of joints."""
        return joint_confidence()

    @property
    @abstractmethod
    def observer(self) -> Observer:
        """Return the observer of this tracker's sightings."""

    @abstractmethod
    def searches(self, objective: Objective, refiner: Refiner) -> tuple[Search, ...]:
        """Return the searches of the settings in their order."""

    def verifier(self, objective: Objective, refiner: Refiner) -> Verifier | None:
        """Return the verifier of first poses; None leaves the selection to the costs."""
        return None

    @property
    def joints_wanted(self) -> Wanted:
        """Use of image joints, see `Tracker.joints_wanted`: none, unless a subclass overrides it."""
        return "none"

    @property
    def learning_seconds(self) -> float:
        """See `Tracker.learning_seconds`."""
        return self.settings.shape.seconds if self._known_body is None else 0.0

    def learner(self, camera: Camera, level_rotation: np.ndarray, floor: float | None = None) -> FollowedBody:
        """See `Tracker.learner`."""
        follower = self._follower(camera, level_rotation, self._first_body, sized=False, learning=True, floor=floor)
        preview = partial(self.of_preview()._follower, camera, level_rotation, self._first_body, sized=False)
        return FollowedBody(follower, preview, self.stage_names, self.settings.shape, self.settings.fitting)

    def follower(self, camera: Camera, level_rotation: np.ndarray, body: Body | None = None) -> Follower:
        """See `Tracker.follower`."""
        known = body or self._known_body
        return self._follower(camera, level_rotation, known or self._first_body, sized=known is not None)

    def of_still(self) -> SearchingTracker:
        """Return the tracker for a recording of one frame."""
        return self

    def of_preview(self) -> SearchingTracker:
        """Return the tracker for poses that are shown while the body is learnt, see `BodyLearner.preview`."""
        return self

    @property
    def passes(self) -> int:
        """Number of passes over a recording; 2 adds the second pass over each person."""
        return 1

    def second_pass(
        self,
        camera: Camera,
        level_rotation: np.ndarray,
        seen: PersonSightings,
        timestamps: np.ndarray,
        body: Body,
        first_pass: np.ndarray,
        floor: float | None = None,
    ) -> Parts[Followed | None]:
        """Follow the person with these sightings a second time; body and rows are those of the first pass.

        None if too little was seen.
        """
        maker = self if len(timestamps) > 1 else self.of_still()
        learner = maker.learner(camera, level_rotation, floor)
        follower = maker.follower(camera, level_rotation, body)
        planner = Planner(
            learner, follower, seen, timestamps, self.stage_names, self.settings.smallest_person, body, first_pass,
            relearn=self._known_body is None,
        )  # fmt: skip
        plan = yield from planner.run()
        if plan is None:
            return None
        follower = maker.follower(camera, level_rotation, plan.body)
        return (yield from BidirectionalTracker(follower, seen, timestamps, plan, self.stage_names, first_pass).run())

    def assembled(
        self,
        objective: Objective,
        refiner: Refiner,
        observer: Observer,
        level_rotation: np.ndarray,
        state: PersonState,
        floor: float | None = None,
    ) -> Follower:
        """Return a follower of these parts."""
        members = self.searches(objective, refiner)
        return self.kind(
            observer, members, objective, level_rotation, self.settings, self._sizes, self.source_names, state,
            self.occluded_limbs, self.verifier(objective, refiner), floor,
        )  # fmt: skip

    def _follower(
        self,
        camera: Camera,
        level_rotation: np.ndarray,
        body: Body,
        *,
        sized: bool,
        learning: bool = False,
        floor: float | None = None,
    ) -> Follower:
        settings = self.settings
        large_width = 200  # pixels; larger images are drawn at half resolution
        small = camera.subsampled(2) if camera.width > large_width else camera
        placer = Placer(self._first_body, small, level_rotation)
        objective = Objective(placer, settings.fitting, self.priors, self.regressions)
        refiner = Refiner(placer, settings.fitting, self.priors)
        state = PersonState.begin(body, sized=sized, seed=settings.seed)
        observer = replace(self.observer, learning=True) if learning else self.observer
        return self.assembled(objective, refiner, observer, level_rotation, state, floor)

    @cached_property
    def _sizes(self) -> Sequence[Body]:
        """Return bodies to try for a person of unknown size; small ones have the proportions of toddlers."""
        space, bodies = ShapeSpace.load(), []
        for size in self.settings.sizes:
            shape = space.childhood(size) + self._first_body.shape
            shape[0] = size
            bodies.append(space.body(shape))
        return bodies
