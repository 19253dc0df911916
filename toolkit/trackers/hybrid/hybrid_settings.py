"""Settings of the hybrid tracker, and the constants of its parts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.shape import ShapeSettings
from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import AtLeastOne, Range, Share, constant
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.trackers.qammaz.discrepancy import DiscrepancySettings
from toolkit.trackers.qammaz.swarm import SwarmSettings
from toolkit.trackers.qammaz.swarm_search import SwarmSearchSettings
from toolkit.tracking.search.arm_search import ArmSettings
from toolkit.tracking.search.labelings import LookupSettings
from toolkit.tracking.tracking_settings import check_seed

Hypothesis = Literal["local", "extrema", "joints", "arms", "swarm"]


@dataclass(frozen=True)
class HybridSettings:
    """Settings of the hybrid tracker (Baak 2013, 5.4, with extensions suggested in 5.5.5).

    Attributes
    ----------
    tracker : the name under which this tracker is registered
    seed : seed of all random numbers
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
    momentum : fraction of the last velocity in the prediction, in [0, 1]; higher values follow fast limbs and amplify
        noise
    sizes : standard deviations of height, tall to small: bodies of 1.84, 1.71, 1.58, 1.44, 1.28, 1.07 and 0.85 m are
        tried on the first frame
    smallest_person : minimum number of measured points; frames with fewer are empty. A person at 8 m in a 176x144 image
    lost_distance : maximum sparse distance of the winner, metres; frames above it are lost. Over twice the largest
        value of a correct pose on the tuning suite
    estimate_pull : weight of a confident estimated joint relative to one correspondence, in the refinement of poses
        found by joints, in body estimation of truncated people and after losses; 0 = none
    patience : seconds of consecutive lost frames before the next one is treated as a first frame
    smoothing : time constant and lag of the smoothing of reported poses, seconds; 0 for still pictures
    """

    tracker: Literal["hybrid", "baak2013"] = "hybrid"
    seed: int = 0
    passes: Literal[1, 2] = 2
    hypotheses: tuple[Hypothesis, ...] = ("local", "extrema", "joints", "arms", "swarm")
    body: Literal["auto", "whole", "upper"] = "auto"
    extrema: Annotated[int, Range(5)] = 20
    candidates: AtLeastOne = constant(2)
    promising: float = constant(2.5)
    lookup_period: AtLeastOne = 3
    restarts: AtLeastOne = 3
    momentum: Share = constant(0.7)
    sizes: tuple[float, ...] = (-1.6, -0.6, 0.4, 1.5, 2.7, 4.2, 5.8)
    smallest_person: int = 300
    lost_distance: float = 0.25
    estimate_pull: float = constant(30.0)
    patience: float = 0.15
    smoothing: float = 0.0
    sensing: SensingSettings = field(default_factory=SensingSettings)
    landmarks: LandmarkSettings = constant(LandmarkSettings())
    lookup: LookupSettings = constant(LookupSettings())
    arms: ArmSettings = constant(ArmSettings())
    fitting: FittingSettings = constant(FittingSettings())
    shape: ShapeSettings = field(default_factory=ShapeSettings)
    search: SwarmSearchSettings = constant(SwarmSearchSettings())
    swarm: SwarmSettings = constant(SwarmSettings())
    discrepancy: DiscrepancySettings = constant(DiscrepancySettings())

    def __post_init__(self) -> None:
        check_seed(self.seed)
        first = ("extrema", "joints", "swarm")
        if not {*self.hypotheses} & {*first}:
            raise SettingsError(f"hypotheses {[*self.hypotheses]} have no first pose; add one of {', '.join(first)}")
        if not self.sizes:
            raise SettingsError("sizes is empty; give at least one")
