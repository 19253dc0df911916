"""The hybrid tracker: local optimisation and database lookup, fused late (Baak 2013, 5.4)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import islice

import numpy as np

from toolkit.body.body import Body
from toolkit.body.shape import ShapeSpace, load_body
from toolkit.database.database import PoseDatabase
from toolkit.fitting.arms import ArmPoses
from toolkit.fitting.objective import Objective
from toolkit.fitting.placed import Placer
from toolkit.fitting.refiner import Refiner, mesh_terms
from toolkit.fitting.shape import ShapeEstimator
from toolkit.fitting.terms import GaussianPrior, PoseTerm
from toolkit.sensing.camera import Camera
from toolkit.sensing.people.sighting import Sighting
from toolkit.track import TRACKED
from toolkit.tracking.clock import StageClock
from toolkit.tracking.follower import PREDICTED, Follower
from toolkit.tracking.guide import Guide, NoGuide
from toolkit.tracking.observation import Observer
from toolkit.tracking.registry import Registration, register
from toolkit.tracking.search.arms import ArmSearch
from toolkit.tracking.search.extrema import ExtremaQuery
from toolkit.tracking.search.local import LocalSearch
from toolkit.tracking.search.lookup import DatabaseLookup, Effort, Query
from toolkit.tracking.search.protocol import Search
from toolkit.tracking.search.votes import VotesQuery
from toolkit.tracking.settings import HybridSettings
from toolkit.tracking.state import PersonState

LARGE_IMAGE = 200
"""Pixels of width above which the body is drawn at half the resolution of the image."""


class HybridTracker:
    """Baak 2013, 5.4, with regressed joints, arms of the database, a pose prior and a learnt shape; see `Tracker`.

    Parameters
    ----------
    database : poses to look up, with or without a joint regressor
    settings : see `HybridSettings`
    body : the person's own body, if it is known; otherwise it is learnt from the recording
    database_path : where the database came from, for `run.json`
    guide : what is known of the frames besides their depth
    """

    kind = Follower
    stage_names = ("prepare", "landmarks", "local", "arms", "lookup", "select")
    source_names = ("local", "extrema", "joints", "arms", PREDICTED)

    def __init__(
        self,
        database: PoseDatabase,
        settings: HybridSettings | None = None,
        *,
        body: Body | None = None,
        database_path: str = "",
        guide: Guide | None = None,
    ) -> None:
        self.guide = guide or NoGuide()
        self.settings = settings or HybridSettings()
        self.database = database_path
        self._poses = database
        self._known_body = body
        self._first_body = body or load_body("neutral")
        self._forest = database.forest if "joints" in self.settings.hypotheses else None

    @property
    def learning_frames(self) -> int:
        """See `Tracker.learning_frames`."""
        return self.settings.shape.frames * self.settings.shape.stride if self._known_body is None else 0

    def learn_body(
        self, camera: Camera, level_rotation: np.ndarray, frames: Iterable[tuple[Sighting, float]]
    ) -> Body | None:
        """See `Tracker.learn_body`: the frames are tracked once, with a body that becomes the person's own."""
        follower = self._follower(camera, level_rotation, self._first_body, sized=False)
        estimator: ShapeEstimator | None = None
        for sighting, timestamp in islice(frames, 0, None, self.settings.shape.stride):
            result = follower.step(sighting, timestamp, StageClock(self.stage_names))
            if result.state != TRACKED or follower.observation is None:
                continue
            if estimator is None:
                terms = mesh_terms(self.settings.fitting)
                estimator = ShapeEstimator(follower.body, self.settings.shape, follower.objective.placer, terms)
            body = estimator.observe(result.pose, follower.observation.scene)
            follower.state = replace(follower.state, body=body)
        return follower.body if follower.state.sized else None

    def follower(self, camera: Camera, level_rotation: np.ndarray, body: Body | None = None) -> Follower:
        """See `Tracker.follower`."""
        known = body or self._known_body
        return self._follower(camera, level_rotation, known or self._first_body, sized=known is not None)

    def searches(self, objective: Objective, refiner: Refiner) -> tuple[Search, ...]:
        """The searches of the settings, in the order in which they are asked."""
        settings, asked = self.settings, self.settings.hypotheses
        members: list[Search] = []
        if "local" in asked:
            members.append(LocalSearch(refiner, settings.momentum))
        if self._arms is not None:
            members.append(ArmSearch(self._arms, objective, refiner, settings.arms))
        # Where arms are searched, whole poses are retrieved every other frame.
        rest = 0 if self._arms is None else 1
        effort = Effort(settings.candidates, settings.starts, settings.promising, rest)
        return (*members, DatabaseLookup(self.queries(), objective, refiner, effort))

    def queries(self) -> list[Query]:
        """The ways of the settings to ask the database for whole poses."""
        queries: list[Query] = []
        if "extrema" in self.settings.hypotheses:
            queries.append(ExtremaQuery(self._poses, self.settings.lookup))
        if self._forest is not None:
            queries.append(self._votes)
        return queries

    def assembled(
        self, objective: Objective, refiner: Refiner, observer: Observer, level_rotation: np.ndarray, state: PersonState
    ) -> Follower:
        """A follower from these parts."""
        members = self.searches(objective, refiner)
        return self.kind(
            observer, members, objective, level_rotation, self.settings, self._sizes, self.source_names, state
        )

    def _follower(self, camera: Camera, level_rotation: np.ndarray, body: Body, *, sized: bool) -> Follower:
        settings = self.settings
        small = camera.subsampled(2) if camera.width > LARGE_IMAGE else camera
        placer = Placer(self._first_body, small, level_rotation)
        objective = Objective(placer, settings.fitting, self._priors)
        refiner = Refiner(placer, settings.fitting, self._priors)
        state = PersonState.begin(body, sized=sized, seed=settings.seed)
        return self.assembled(objective, refiner, self.observer, level_rotation, state)

    @property
    def observer(self) -> Observer:
        """How this tracker looks at sightings."""
        s = self.settings
        return Observer(
            s.landmarks, s.extrema, s.fitting.cloud_samples, s.fitting.search, self._forest, s.vote_samples, self.guide
        )

    @cached_property
    def _priors(self) -> tuple[PoseTerm, ...]:
        weight = self.settings.fitting.prior_weight
        return (GaussianPrior.of_poses(self._poses.poses, weight),) if weight > 0.0 else ()

    @cached_property
    def _votes(self) -> VotesQuery:
        return VotesQuery(self._poses, self.settings.vote_pull)

    @cached_property
    def _arms(self) -> ArmPoses | None:
        wanted = {"local", "arms"} <= set(self.settings.hypotheses)
        return ArmPoses(self._poses.poses, self._first_body, self.settings.arms.count) if wanted else None

    @cached_property
    def _sizes(self) -> Sequence[Body]:
        """Bodies to try for a person of unknown size; the small ones have the proportions of toddlers."""
        space, bodies = ShapeSpace.load(), []
        for size in self.settings.sizes:
            shape = space.childhood(size) + self._first_body.shape
            shape[0] = size
            bodies.append(space.body(shape))
        return bodies


register(
    "hybrid",
    Registration(
        HybridSettings,
        needs_database=True,
        build=lambda settings, database, path: HybridTracker(database, settings, database_path=path),
    ),
)
