"""Settings that trackers share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from toolkit.fitting.fitting_settings import FittingSettings
from toolkit.fitting.shape import ShapeSettings
from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import Range, Share, constant
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.sensing_settings import SensingSettings


@dataclass(frozen=True)
class TrackerSettings:
    """Settings of every tracker.

    Attributes
    ----------
    tracker : the name under which this tracker is registered
    seed : seed of all random numbers
    smallest_person : minimum number of measured points; frames with fewer are empty. A person at 8 m in a 176x144 image
    """

    tracker: str = ""
    seed: Annotated[int, Range(0)] = 0
    smallest_person: Annotated[int, Range(0)] = 300
    sensing: SensingSettings = field(default_factory=SensingSettings)


@dataclass(frozen=True)
class SearchingSettings(TrackerSettings):
    """Settings of a tracker whose follower queries searches.

    Attributes
    ----------
    momentum : share of the last speed at which the pose is expected to move on, in [0, 1]; higher values follow fast
        limbs and amplify noise
    sizes : standard deviations of height, tall to small: bodies of 1.84, 1.71, 1.58, 1.44, 1.28, 1.07 and 0.85 m are
        tried on the first frame
    lost_distance : maximum sparse distance of the winner, metres; frames above it are lost. Over twice the largest
        value of a correct pose on the tuning suite
    patience : seconds of consecutive lost frames before the next one is treated as a first frame
    smoothing : time constant and lag of the smoothing of reported poses, seconds; 0 for still pictures
    """

    momentum: Share = constant(0.7)
    sizes: tuple[float, ...] = (-1.6, -0.6, 0.4, 1.5, 2.7, 4.2, 5.8)
    lost_distance: float = 0.25
    patience: float = 0.15
    smoothing: float = 0.0
    landmarks: LandmarkSettings = constant(LandmarkSettings())
    fitting: FittingSettings = constant(FittingSettings())
    shape: ShapeSettings = field(default_factory=ShapeSettings)

    def __post_init__(self) -> None:
        if not self.sizes:
            raise SettingsError("sizes is empty; give at least one")
