"""Settings of the landmarks: graph, geodesic extrema and facing of a cloud."""

from __future__ import annotations

from dataclasses import dataclass, fields

from toolkit.io.errors import SettingsError


@dataclass(frozen=True)
class LandmarkSettings:
    """What variants of Baak 2013, 5.3.4 and 5.4.2 differ in, metres for a body of adult size.

    Attributes
    ----------
    neighbour_distance : tau, edges of the graph are shorter than this. Just above the depth steps of a Kinect at 4 m
        (4.5 cm), and below the gap between an arm and the torso that it hides
    smallest_component : components of fewer nodes are noise; a hand at 4 m has 30 at half of a Kinect's resolution
    bridge_distance : components farther than this from the largest one stay unconnected (0.5 m in the paper)
    source_drop : the extrema are measured from this far below the centre, at the hips. From there head, hands and feet
        are about equally far; from the centre the knees are farther than the head and are found before it, and all five
        end effectors are among the first five extrema in 44 instead of 74 % of frames in which they are free
    chest_height : the middle of the chest lies this far above the centre. 0 in the paper; but a belly is round, and its
        plane turns by 0.4 of the body's turn and by 0.1 for heavy people, a chest's by 0.6 and by 0.4
    turn_gain : the turn of the chest's plane away from the camera times this is the body's turn (1 in the paper)
    """

    neighbour_distance: float = 0.05
    smallest_component: int = 20
    bridge_distance: float = 0.5
    source_drop: float = 0.3
    chest_height: float = 0.28
    turn_gain: float = 1.6

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (value > 0 or (value == 0 and field.name in ("chest_height", "source_drop"))):
                raise SettingsError(f"landmarks.{field.name} is {value}; it must be above 0")
        if self.neighbour_distance > 10 or self.bridge_distance > 10:
            raise SettingsError(
                f"landmarks.neighbour_distance and bridge_distance are {self.neighbour_distance} and "
                f"{self.bridge_distance} m; lengths within a body are below 10 m"
            )
