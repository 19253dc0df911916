"""The hybrid tracker: local optimisation and database lookup with late fusion (Baak 2013, 5.4)."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cached_property

from toolkit.body.body import Body
from toolkit.database.database import PoseDatabase
from toolkit.fitting.guide import Guide
from toolkit.fitting.objective import Objective
from toolkit.fitting.open3d_scene import SCENES
from toolkit.fitting.priors import GaussianPrior, PoseTerm
from toolkit.fitting.refiner import Refiner
from toolkit.landmarks.joint_network import JointNetwork, joint_network
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.initial_pose import InitialPoseVerifier
from toolkit.trackers.qammaz.swarm_search import SwarmSearch
from toolkit.tracking.observation import Observer
from toolkit.tracking.occluded_limbs import OccludedLimbs
from toolkit.tracking.person import PREDICTED
from toolkit.tracking.registry import Registration, register
from toolkit.tracking.search.arm_search import ArmSearch, NetworkArms
from toolkit.tracking.search.database_lookup import DatabaseLookup, Query
from toolkit.tracking.search.estimate_query import EstimatedJointsQuery
from toolkit.tracking.search.extrema_query import ExtremaQuery
from toolkit.tracking.search.local_search import LocalSearch
from toolkit.tracking.search.search_protocol import Search
from toolkit.tracking.searching import SearchingTracker
from toolkit.tracking.tracker_protocol import Wanted

STILL_RESTARTS = 10
"""`restarts` for a recording of one frame; more have no effect, nor in longer recordings."""


class HybridTracker(SearchingTracker):
    """Tracker of Baak 2013, 5.4, with the joint network, arm search, pose prior and estimated shape; see `Tracker`.

    Parameters
    ----------
    database : poses to look up
    settings : see `HybridSettings`
    body : the person's own body if known; default: estimated from the recording
    database_path : path of the database, for `run.json`
    """

    settings: HybridSettings

    def __init__(
        self,
        database: PoseDatabase,
        settings: HybridSettings | None = None,
        *,
        body: Body | None = None,
        database_path: str = "",
    ) -> None:
        self.guide: Guide = Guide()
        self.settings = settings or HybridSettings()
        super().__init__(body)
        self.database = database_path
        search = self.settings.lookup.search
        self._poses = database if search == database.search else replace(database, search=search)
        uses_network = {"joints", "arms"} & set(self.settings.hypotheses)
        self._network: JointNetwork | None = joint_network() if uses_network else None
        self._verifies = "arms" in self.settings.hypotheses

    @property
    def stage_names(self) -> tuple[str, ...]:
        """See `Tracker.stage_names`."""
        return ("prepare", "landmarks", "local", "arms", "lookup", *self._swarm, "select")

    @property
    def source_names(self) -> tuple[str, ...]:
        """See `Tracker.source_names`."""
        return ("local", "extrema", "joints", "arms", *self._swarm, PREDICTED)

    @property
    def passes(self) -> int:
        """See `SearchingTracker.passes`."""
        return self.settings.passes

    @property
    def joints_wanted(self) -> Wanted:
        """See `Tracker.joints_wanted`: initial poses of the swarm, and evidence in each frame."""
        return "offered" if self._swarm else "none"

    def searches(self, objective: Objective, refiner: Refiner) -> tuple[Search, ...]:
        """Return the searches of the settings in their order of execution."""
        settings, asked = self.settings, self.settings.hypotheses
        members: list[Search] = []
        if "local" in asked:
            members.append(LocalSearch(refiner, settings.momentum))
        if {"local", "arms"} <= set(asked):
            members.append(ArmSearch(self._arms(objective, refiner), self._period))
        lookup = DatabaseLookup(
            self.queries(), objective, refiner, candidates=settings.candidates, restarts=settings.restarts,
            promising=settings.promising, period=self._period,
        )  # fmt: skip
        members.append(lookup)
        if self._swarm:
            parts = settings.search, settings.swarm, settings.discrepancy
            members.append(SwarmSearch(*parts, objective, refiner, first_only=True))
        return tuple(members)

    def of_still(self) -> HybridTracker:
        """See `SearchingTracker.of_still`: refines more poses of the database."""
        other = copy(self)
        other.settings = replace(self.settings, restarts=max(self.settings.restarts, STILL_RESTARTS))
        return other

    def of_preview(self) -> HybridTracker:
        """See `SearchingTracker.of_preview`: detects a person by the joint network, if it is used, and one pose."""
        other, asked = copy(self), self.settings.hypotheses
        fewer = tuple(name for name in asked if name != "extrema") if "joints" in asked else asked
        other.settings, other._verifies = replace(self.settings, hypotheses=fewer, restarts=1), False
        return other

    def verifier(self, objective: Objective, refiner: Refiner) -> InitialPoseVerifier | None:
        """See `SearchingTracker.verifier`."""
        return InitialPoseVerifier(objective, refiner, self._arms(objective, refiner)) if self._verifies else None

    def _arms(self, objective: Objective, refiner: Refiner) -> NetworkArms:
        kinematics = Refiner(objective.placer, self.settings.fitting, self.priors, terms=())
        return NetworkArms(objective, refiner, kinematics, self.settings.arms)

    def queries(self) -> list[Query]:
        """Return the database queries for whole poses that the settings name."""
        queries: list[Query] = []
        if "extrema" in self.settings.hypotheses:
            queries.append(ExtremaQuery(self._poses, self.settings.lookup))
        if "joints" in self.settings.hypotheses:
            queries.append(self._estimates)
        return queries

    @property
    def observer(self) -> Observer:
        """Return the observer of this tracker."""
        s = self.settings
        return Observer(
            s.landmarks, s.extrema, s.fitting.cloud_samples, self._network,
            self.guide, s.estimate_pull, body=s.body, told_joints=bool(self._swarm), period=self._period,
            scene=SCENES[s.fitting.correspondences],
        )  # fmt: skip

    @cached_property
    def priors(self) -> tuple[PoseTerm, ...]:
        """See `SearchingTracker`: the poses of the database define what is likely."""
        weight = self.settings.fitting.prior_weight
        return (GaussianPrior.of_poses(self._poses.poses, weight),) if weight > 0.0 else ()

    @cached_property
    def occluded_limbs(self) -> OccludedLimbs | None:
        """See `SearchingTracker`; databases of older versions have no prior."""
        return None if self._poses.prior is None else OccludedLimbs(self._poses.prior)

    @property
    def _period(self) -> int:
        """Return the interval of periodic searches; without the local hypothesis, each frame needs a lookup."""
        return self.settings.lookup_period if "local" in self.settings.hypotheses else 1

    @property
    def _swarm(self) -> tuple[str, ...]:
        """Return the name of the swarm's stage and source, or nothing without the swarm."""
        return ("swarm",) if "swarm" in self.settings.hypotheses else ()

    @cached_property
    def _estimates(self) -> EstimatedJointsQuery:
        return EstimatedJointsQuery(self._poses, self.settings.estimate_pull)


register(
    "hybrid",
    Registration(
        HybridSettings,
        needs_database=True,
        build=lambda settings, database, path: HybridTracker(database, settings, database_path=path),
    ),
)
