"""All settings of the hybrid tracker, one section per room that owns them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Protocol

from toolkit.errors import SettingsError
from toolkit.fitting.arms import ArmSettings
from toolkit.fitting.settings import FittingSettings
from toolkit.fitting.shape import ShapeSettings
from toolkit.landmarks.settings import LandmarkSettings
from toolkit.sensing.settings import SensingSettings
from toolkit.tracking.search.labelings import LookupSettings


class FollowerSettings(Protocol):
    """When a frame counts as empty or lost, and what is reported; see `HybridSettings`."""

    @property
    def smallest_person(self) -> int: ...  # noqa: D102
    @property
    def lost_distance(self) -> float: ...  # noqa: D102
    @property
    def patience(self) -> float: ...  # noqa: D102
    @property
    def smoothing(self) -> float: ...  # noqa: D102


def check_seed(seed: int) -> None:
    """A seed is a number that generators take.

    Raises
    ------
    SettingsError
        It is negative.
    """
    if seed < 0:
        raise SettingsError(f"seed is {seed}; it is a whole number, at least 0")


@dataclass(frozen=True)
class HybridSettings:
    """Settings of the hybrid tracker (Baak 2013, 5.4, with what its section 5.5.5 left open).

    Attributes
    ----------
    tracker : the name under which this tracker is registered
    seed : of everything random
    hypotheses : which compete: "local", "extrema" (lookup by geodesic extrema), "joints" (lookup by regressed joints,
        where extrema merge with the body), "arms" (the local one with arms of other poses), "head_hands" (on first
        frames and after losses, hands where the cloud ends, and the best pose turned round), "swarm" (likewise, where
        joints are seen in the image; set up as in configs/swarm.yaml)
    body : how much of a person there is to see: "auto" (the regressor tells which links are out of view, frame by
        frame), "whole" (nothing is out of view that the frame does not hide), "upper" (legs are never looked for)
    extrema : geodesic extrema per frame, Eq. 5.8
    candidates : retrieved poses that are compared before one of them is refined: a comparison costs a fifth of a
        refinement; 1 takes the best by Eq. 5.6 unseen
    promising : the best retrieved pose is refined if its distance is at most this times that of the local hypothesis:
        a refinement halves a distance, seldom more, so that a farther pose cannot win
    rest : frames between two in which the database is asked for whole poses, while all is well. Arms are searched in
        these; with 1 or 2 the error is the same, and no frame bears both
    starts : poses refined on a first frame or after a loss, per size of the body: no previous pose says which one is
        right
    momentum : share of the last speed at which the pose is expected to move on, in [0, 1], so that fast limbs stay
        within reach; the noise of a step is carried on by as much
    sizes : standard deviations of height, tall to small: bodies of 1.84, 1.71, 1.58, 1.44, 1.28, 1.07 and 0.85 m are
        tried on the first frame
    smallest_person : measured points below which a frame counts as empty: a person at 8 m in a 176x144 image
    lost_distance : metres of the sparse distance of the winner above which a frame counts as lost: over twice the
        largest of a correct pose on the tuning suite
    vote_pull : weight of a sure joint of the regressor against one correspondence while a pose is refined that was
        found by the joints, or the body of one who is cut off is learnt, or somebody is looked for: as much as the
        vertices around it; 0 = none
    patience : seconds of lost frames in a row after which the next one is treated as a first frame: some frames of bad
        luck are not a loss
    smoothing : seconds by which the reported poses are smoothed and lag; users of still pictures want none
    vote_samples : points that vote for the joints; hands have few, so that with fewer votes they are found less often
    """

    tracker: Literal["hybrid"] = "hybrid"
    seed: int = 0
    hypotheses: tuple[str, ...] = ("local", "extrema", "joints", "arms", "head_hands", "swarm")
    body: Literal["auto", "whole", "upper"] = "auto"
    extrema: int = 20
    candidates: int = 2
    promising: float = 2.5
    rest: int = 2
    starts: int = 3
    momentum: float = 0.7
    sizes: tuple[float, ...] = (-1.6, -0.6, 0.4, 1.5, 2.7, 4.2, 5.8)
    smallest_person: int = 300
    lost_distance: float = 0.25
    vote_pull: float = 30.0
    patience: float = 0.15
    smoothing: float = 0.0
    vote_samples: int = 500
    sensing: SensingSettings = field(default_factory=SensingSettings)
    landmarks: LandmarkSettings = field(default_factory=LandmarkSettings)
    lookup: LookupSettings = field(default_factory=LookupSettings)
    arms: ArmSettings = field(default_factory=ArmSettings)
    fitting: FittingSettings = field(default_factory=FittingSettings)
    shape: ShapeSettings = field(default_factory=ShapeSettings)

    def __post_init__(self) -> None:
        check_seed(self.seed)
        known = ("local", "extrema", "joints", "arms", "head_hands", "swarm")
        if unknown := [name for name in self.hypotheses if name not in known]:
            raise SettingsError(f"hypotheses {unknown} are unknown; choose from {', '.join(known)}")
        if self.body not in ("auto", "whole", "upper"):
            raise SettingsError(f"body is {self.body!r}; choose auto, whole or upper")
        if not self.hypotheses:
            raise SettingsError(f"a tracker needs a hypothesis; choose from {', '.join(known)}")
        if not 0.0 <= self.momentum <= 1.0:
            raise SettingsError(f"momentum is {self.momentum}; it is a share and lies in [0, 1]")
        if self.rest < 0:
            raise SettingsError(f"rest is {self.rest}; it is a number of frames, at least 0")
        if self.extrema < 5 or self.candidates < 1 or self.starts < 1 or not self.sizes:
            raise SettingsError("extrema is at least 5; candidates, starts and the number of sizes at least 1")
