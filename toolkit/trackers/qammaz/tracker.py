"""Swarm tracker: image joints and depth, without motion capture or joint network (Qammaz)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from toolkit.body.body import Body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.fitting.shape import ShapeSettings
from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import Range, Share, constant
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.trackers.qammaz.discrepancy import DiscrepancySettings
from toolkit.trackers.qammaz.swarm import SwarmSettings
from toolkit.trackers.qammaz.swarm_search import SwarmSearch, SwarmSearchSettings
from toolkit.tracking.observation import Observer
from toolkit.tracking.person import PREDICTED
from toolkit.tracking.registry import Registration, register
from toolkit.tracking.search.local_search import LocalSearch
from toolkit.tracking.search.search_protocol import Search
from toolkit.tracking.searching import SearchingTracker
from toolkit.tracking.tracker_protocol import Wanted
from toolkit.tracking.tracking_settings import check_seed

HYPOTHESES = ("local", "swarm")


@dataclass(frozen=True)
class SwarmTrackerSettings:
    """Settings of the swarm tracker, one section per package.

    Attributes
    ----------
    tracker : the name under which this tracker is registered
    seed : seed of all random numbers
    hypotheses : competing hypotheses: "swarm" and optionally "local" (the refined previous pose), which is as good for
        slow motion at a tenth of the time
    extrema : number of geodesic extrema per frame, correspondences of the local optimisation
    momentum : share of the last speed at which the pose is expected to move on, in [0, 1], as of the hybrid tracker
    sizes : standard deviations of height, tall to small: bodies of 1.84, 1.71, 1.58, 1.44, 1.28, 1.07 and 0.85 m are
        tried on the first frame
    smallest_person : minimum number of measured points; frames with fewer are empty. A person at 8 m in a 176x144 image
    lost_distance : maximum sparse distance of the winner, metres; frames above it are lost. Over twice the largest
        value of a correct pose on the tuning suite
    patience : seconds of consecutive lost frames before the next one is treated as a first frame
    smoothing : time constant and lag of the smoothing of reported poses, seconds; 0 for still pictures
    """

    tracker: Literal["swarm"] = "swarm"
    seed: int = 0
    hypotheses: tuple[str, ...] = HYPOTHESES
    extrema: Annotated[int, Range(5)] = constant(20)
    momentum: Share = constant(0.7)
    sizes: tuple[float, ...] = (-1.6, -0.6, 0.4, 1.5, 2.7, 4.2, 5.8)
    smallest_person: int = 300
    lost_distance: float = 0.25
    patience: float = 0.15
    smoothing: float = 0.0
    sensing: SensingSettings = field(default_factory=SensingSettings)
    landmarks: LandmarkSettings = constant(LandmarkSettings())
    search: SwarmSearchSettings = constant(SwarmSearchSettings())
    swarm: SwarmSettings = field(default_factory=SwarmSettings)
    discrepancy: DiscrepancySettings = constant(DiscrepancySettings())
    fitting: FittingSettings = constant(FittingSettings(prior_weight=0.0))
    shape: ShapeSettings = field(default_factory=ShapeSettings)

    def __post_init__(self) -> None:
        check_seed(self.seed)
        if "swarm" not in self.hypotheses or (unknown := [n for n in self.hypotheses if n not in HYPOTHESES]):
            wrong = unknown if "swarm" in self.hypotheses else list(self.hypotheses)
            raise SettingsError(
                f"hypotheses of the swarm tracker are 'swarm' and at most 'local' beside it, not {wrong}"
            )
        if not self.sizes:
            raise SettingsError("sizes is empty; give at least one")
        if self.fitting.prior_weight:
            raise SettingsError(
                f"fitting.prior_weight is {self.fitting.prior_weight}; set 0, because the prior needs a database"
            )


class SwarmTracker(SearchingTracker):
    """Tracker of Qammaz, with local optimisation after the swarm and beside it; see `Tracker`.

    Parameters
    ----------
    settings : see `SwarmTrackerSettings`
    body : the person's own body if known; default: estimated from the recording
    """

    stage_names = ("prepare", "landmarks", "local", "swarm", "select")
    source_names = ("local", "swarm", "joints", PREDICTED)
    database = ""
    joints_wanted: Wanted = "required"

    def __init__(self, settings: SwarmTrackerSettings | None = None, *, body: Body | None = None) -> None:
        self.settings = settings or SwarmTrackerSettings()
        super().__init__(self.settings, body)

    def searches(self, objective: Objective, refiner: Refiner) -> tuple[Search, ...]:
        """See `SearchingTracker.searches`."""
        s = self.settings
        swarm = SwarmSearch(s.search, s.swarm, s.discrepancy, objective, refiner)
        return (LocalSearch(refiner, s.momentum), swarm) if "local" in s.hypotheses else (swarm,)

    @property
    def observer(self) -> Observer:
        """See `SearchingTracker.observer`."""
        s = self.settings
        return Observer(s.landmarks, s.extrema, s.fitting.cloud_samples, None)


register(
    "swarm",
    Registration(
        SwarmTrackerSettings, needs_database=False, build=lambda settings, database, path: SwarmTracker(settings)
    ),
)
