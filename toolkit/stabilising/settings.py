"""How a track is stabilised."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolkit.errors import SettingsError
from toolkit.retrieval.priors.expectation import ExpectationSettings
from toolkit.retrieval.priors.gaps import GapSettings
from toolkit.retrieval.priors.marks import MarkSettings


@dataclass(frozen=True)
class ChoiceSettings:
    """How one of several ways through a gap is chosen, frame by frame; on the tuning split of the sequences.

    Attributes
    ----------
    unlikely : metres of distance from the frame that one standard deviation, squared, of one angle counts
    stiffness : metres that a step of one radian, squared, of one angle counts from one frame to the next
    margin : metres by which another way must be better than the track's own
    """

    unlikely: float = 0.00015
    stiffness: float = 0.02
    margin: float = 0.0007

    def __post_init__(self) -> None:
        if min(self.unlikely, self.stiffness, self.margin) < 0.0:
            raise SettingsError(
                "unlikely, stiffness and margin of a choice are metres from 0 on; leave them as they are"
            )


@dataclass(frozen=True)
class StabiliseSettings:
    """Settings of the loop of Fig. 6.1.

    Attributes
    ----------
    rounds : at most; five in the thesis
    threshold : costs at or above it are no hits (0.07 in the thesis, for tracks of another kind)
    prior_weight : square metres per square radian and variance: what the angles of a hidden limb pull while the
        recording is tracked again; a tenth of what the samples at a seen arm do
    prior_spread : radians, added to the spread of what is expected
    widened : frames by which a gap is looked at beyond its ends: a limb is mistaken before it is given up
    agreed : share of the frames' labels that agree when the loop may stop
    moved : metres that joints move on average when the loop may stop
    """

    rounds: int = 5
    threshold: float = 0.1
    prior_weight: float = 0.003
    prior_spread: float = 0.15
    widened: int = 20
    agreed: float = 0.99
    moved: float = 0.002
    gaps: GapSettings = field(default_factory=GapSettings)
    expectation: ExpectationSettings = field(default_factory=ExpectationSettings)
    choice: ChoiceSettings = field(default_factory=ChoiceSettings)
    marks: MarkSettings = field(default_factory=MarkSettings)

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise SettingsError(f"{self.rounds} rounds are impossible; give a whole number from 1 on")
        if not 0.0 < self.threshold <= 1.0:
            raise SettingsError(f"threshold {self.threshold} is not in (0, 1]; try 0.1")
