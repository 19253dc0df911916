"""Settings of the hybrid tracker, and the constants of its parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import AtLeastOne, Range, constant
from toolkit.trackers.qammaz.discrepancy import DiscrepancySettings
from toolkit.trackers.qammaz.swarm import SwarmSettings
from toolkit.trackers.qammaz.swarm_search import SwarmSearchSettings
from toolkit.tracking.search.arm_search import ArmSettings
from toolkit.tracking.search.labelings import LookupSettings
from toolkit.tracking.tracker_settings import SearchingSettings

Hypothesis = Literal["local", "extrema", "joints", "arms", "swarm"]


@dataclass(frozen=True)
class HybridSettings(SearchingSettings):
    """Settings of the hybrid tracker (Baak 2013, 5.4, with extensions suggested in 5.5.5).

    Attributes
    ----------
    passes : 2 adds backward tracking with detections in keyframes for each person; 1 finishes each frame when it
        arrives, as for a stream
    hypotheses : competing hypotheses: "local", "extrema" (lookup by geodesic extrema), "joints" (lookup by joints
        of the joint network, for extrema that merge with the body), "arms" (the best one with arms at these joints; on
        first frames and after losses also turned by 180 degrees), "swarm" (on first frames and after losses, with image
        joints, which are then evidence in each frame; settings as in configs/swarm.yaml). "local" and "arms" start from
        a pose of the others, of which at least one is needed
    body : visible part of a person: "auto" (the joint network decides per frame), "whole" (all links, unless
        occluded), "upper" (no legs)
    extrema : number of geodesic extrema per frame, for the lookup and as correspondences of the local optimisation
    candidates : number of retrieved poses that are compared with the frame before one is refined; a comparison costs a
        fifth of a refinement. 1 takes the best by Eq. 5.6 without comparison
    promising : maximum ratio of a retrieved pose's distance to that of the local hypothesis for a refinement, which
        rarely reduces a distance by more than half
    lookup_period : interval of database lookups in frames while tracking is stable. Arms are searched at the same
        interval, in other frames if it is above 1. The joints in view of a truncated person are estimated at this
        interval if it is below 0.3 s, else in each frame
    restarts : number of poses refined on a first frame or after a loss, per body size
    estimate_pull : weight of a confident estimated joint relative to one correspondence, in the refinement of poses
        found by joints, in body estimation of truncated people and after losses; 0 = none
    """

    tracker: Literal["hybrid", "baak2013"] = "hybrid"
    passes: Literal[1, 2] = 2
    hypotheses: tuple[Hypothesis, ...] = ("local", "extrema", "joints", "arms", "swarm")
    body: Literal["auto", "whole", "upper"] = "auto"
    extrema: Annotated[int, Range(5)] = 20
    candidates: AtLeastOne = constant(2)
    promising: float = constant(2.5)
    lookup_period: AtLeastOne = 3
    restarts: AtLeastOne = 3
    estimate_pull: float = constant(30.0)
    lookup: LookupSettings = constant(LookupSettings())
    arms: ArmSettings = constant(ArmSettings())
    search: SwarmSearchSettings = constant(SwarmSearchSettings())
    swarm: SwarmSettings = constant(SwarmSettings())
    discrepancy: DiscrepancySettings = constant(DiscrepancySettings())

    def __post_init__(self) -> None:
        super().__post_init__()
        first = ("extrema", "joints", "swarm")
        if not {*self.hypotheses} & {*first}:
            raise SettingsError(f"hypotheses {[*self.hypotheses]} have no first pose; add one of {', '.join(first)}")
