"""Swarm tracker: image joints and depth, without motion capture or joint network (Qammaz)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from toolkit.body.body import Body
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.objective import Objective
from toolkit.fitting.refiner import Refiner
from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import Range, constant
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
from toolkit.tracking.tracker_settings import SearchingSettings

HYPOTHESES = ("local", "swarm")


@dataclass(frozen=True)
class SwarmTrackerSettings(SearchingSettings):
    """Settings of the swarm tracker, one section per package.

    Attributes
    ----------
    hypotheses : competing hypotheses: "swarm" and optionally "local" (the refined previous pose), which is as good for
        slow motion at a tenth of the time
    extrema : number of geodesic extrema per frame, correspondences of the local optimisation
    """

    tracker: Literal["swarm"] = "swarm"
    hypotheses: tuple[str, ...] = HYPOTHESES
    extrema: Annotated[int, Range(5)] = constant(20)
    search: SwarmSearchSettings = constant(SwarmSearchSettings())
    swarm: SwarmSettings = field(default_factory=SwarmSettings)
    discrepancy: DiscrepancySettings = constant(DiscrepancySettings())
    fitting: FittingSettings = constant(FittingSettings(prior_weight=0.0))

    def __post_init__(self) -> None:
        super().__post_init__()
        if "swarm" not in self.hypotheses or (unknown := [n for n in self.hypotheses if n not in HYPOTHESES]):
            wrong = unknown if "swarm" in self.hypotheses else list(self.hypotheses)
            raise SettingsError(
                f"hypotheses of the swarm tracker are 'swarm' and at most 'local' beside it, not {wrong}"
            )
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
    settings: SwarmTrackerSettings

    def __init__(self, settings: SwarmTrackerSettings | None = None, *, body: Body | None = None) -> None:
        self.settings = settings or SwarmTrackerSettings()
        super().__init__(body)

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
