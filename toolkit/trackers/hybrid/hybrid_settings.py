"""All settings of the hybrid tracker, and the constants that it hands to its parts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from toolkit.fitting.arms import ArmSettings
from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.shape import ShapeSettings
from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import constant
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.trackers.lopez2011.head_hands import HeadHandSettings
from toolkit.trackers.qammaz.discrepancy import DiscrepancySettings
from toolkit.trackers.qammaz.swarm import SwarmSettings
from toolkit.trackers.qammaz.swarm_search import SwarmSearchSettings
from toolkit.tracking.search.labelings import LookupSettings
from toolkit.tracking.tracking_settings import check_seed


@dataclass(frozen=True)
class HybridSettings:
    """Settings of the hybrid tracker (Baak 2013, 5.4, with what its section 5.5.5 left open).

    Attributes
    ----------
    tracker : the name under which this tracker is registered
    seed : of everything random
    passes : 2 follows each person in a recording a second time, from their surest frame outwards; 1 is done with each
        frame as it comes, as with a stream
    hypotheses : which compete: "local", "extrema" (lookup by geodesic extrema), "joints" (lookup by regressed joints,
        where extrema merge with the body), "arms" (the local one with arms of other poses), "head_hands" (on first
        frames and after losses, hands where the cloud ends, and the best pose turned round), "swarm" (likewise, where
        joints are seen in the image, which are evidence in every frame then; set up as in configs/swarm.yaml)
    body : how much of a person there is to see: "auto" (the regressor tells which links are out of view, frame by
        frame), "whole" (nothing is out of view that the frame does not hide), "upper" (legs are never looked for)
    extrema : geodesic extrema per frame: the lookup asks by them, and the local optimisation draws the body to them
    candidates : retrieved poses that are compared before one of them is refined: a comparison costs a fifth of a
        refinement; 1 takes the best by Eq. 5.6 unseen
    promising : the best retrieved pose is refined if its distance is at most this times that of the local hypothesis:
        a refinement halves a distance, seldom more, so that a farther pose cannot win
    lookup_period : while all is well the database is asked for whole poses in every so manieth frame. Arms are searched
        in the others; with 2 or 3 the error is the same, and no frame bears both
    restarts : poses refined on a first frame or after a loss, per size of the body: no previous pose says which one is
        right
    momentum : share of the last speed at which the pose is expected to move on, in [0, 1], so that fast limbs stay
        within reach; the noise of a step is carried on by as much
    sizes : standard deviations of height, tall to small: bodies of 1.84, 1.71, 1.58, 1.44, 1.28, 1.07 and 0.85 m are
        tried on the first frame
    smallest_person : measured points below which a frame counts as empty: a person at 8 m in a 176x144 image
    lost_distance : metres of the sparse distance of the winner above which a frame counts as lost: over twice the
        largest of a correct pose on the tuning suite
    vote_pull : weight of a sure joint of the regressor against one correspondence while a pose is refined that was
        found by the joints, or the body of one who is cut off is learnt, or a person is looked for: as much as the
        vertices around it; 0 = none
    patience : seconds of lost frames in a row after which the next one is treated as a first frame: some frames of bad
        luck are not a loss
    smoothing : seconds by which the reported poses are smoothed and lag; users of still pictures want none
    vote_samples : points that vote for the joints; hands have few, so that with fewer votes they are found less often
    """

    tracker: Literal["hybrid", "baak2013"] = "hybrid"
    seed: int = 0
    passes: Literal[1, 2] = 2
    hypotheses: tuple[str, ...] = ("local", "extrema", "joints", "arms", "head_hands", "swarm")
    body: Literal["auto", "whole", "upper"] = "auto"
    extrema: int = 20
    candidates: int = constant(2)
    promising: float = constant(2.5)
    lookup_period: int = 3
    restarts: int = 3
    momentum: float = constant(0.7)
    sizes: tuple[float, ...] = (-1.6, -0.6, 0.4, 1.5, 2.7, 4.2, 5.8)
    smallest_person: int = 300
    lost_distance: float = 0.25
    vote_pull: float = constant(30.0)
    patience: float = 0.15
    smoothing: float = 0.0
    vote_samples: int = constant(500)
    sensing: SensingSettings = field(default_factory=SensingSettings)
    landmarks: LandmarkSettings = constant(LandmarkSettings())
    lookup: LookupSettings = constant(LookupSettings())
    arms: ArmSettings = constant(ArmSettings())
    fitting: FittingSettings = constant(FittingSettings())
    shape: ShapeSettings = field(default_factory=ShapeSettings)
    head_hands: HeadHandSettings = constant(HeadHandSettings())
    search: SwarmSearchSettings = constant(SwarmSearchSettings())
    swarm: SwarmSettings = constant(SwarmSettings())
    discrepancy: DiscrepancySettings = constant(DiscrepancySettings())

    def __post_init__(self) -> None:
        check_seed(self.seed)
        known = ("local", "extrema", "joints", "arms", "head_hands", "swarm")
        if unknown := [name for name in self.hypotheses if name not in known]:
            raise SettingsError(f"hypotheses {unknown} are unknown; choose from {', '.join(known)}")
        if self.passes not in (1, 2):
            raise SettingsError(f"passes is {self.passes}; choose 1 or 2")
        if self.body not in ("auto", "whole", "upper"):
            raise SettingsError(f"body is {self.body!r}; choose auto, whole or upper")
        if not self.hypotheses:
            raise SettingsError(f"a tracker needs a hypothesis; choose from {', '.join(known)}")
        if not 0.0 <= self.momentum <= 1.0:
            raise SettingsError(f"momentum is {self.momentum}; it is a share and lies in [0, 1]")
        if self.lookup_period < 1:
            raise SettingsError(f"lookup_period is {self.lookup_period}; it is a number of frames, at least 1")
        if self.extrema < 5 or self.candidates < 1 or self.restarts < 1 or not self.sizes:
            raise SettingsError("extrema is at least 5; candidates, restarts and the number of sizes at least 1")
