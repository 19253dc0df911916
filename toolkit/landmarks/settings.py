"""Settings of the landmarks: graph, geodesic extrema, centre and facing of a cloud."""

from __future__ import annotations

from dataclasses import dataclass, fields

from toolkit.errors import SettingsError


@dataclass(frozen=True)
class LandmarkSettings:
    """Constants of Baak 2013, 5.3.4 and 5.4.2. Lengths in metres for a body of adult size, times in seconds.

    Attributes
    ----------
    neighbour_distance : tau, edges of the graph are shorter than this. Just above the depth steps of a Kinect at 4 m
        (4.5 cm), and below the gap between an arm and the torso that it hides
    smallest_component : components of fewer nodes are noise; a hand at 4 m has 30 at half of a Kinect's resolution
    bridge_distance : components farther than this from the largest one stay unconnected (0.5 m in the paper)
    source_drop : the extrema are measured from this far below the centre, at the hips. From there head, hands and feet
        are about equally far; from the centre the knees are farther than the head and are found before it, and all five
        end effectors are among the first five extrema in 44 instead of 74 % of frames in which they are free
    centre_width, centre_height : half axes of the mean-shift ellipsoid, horizontal and vertical. It reaches from the
        chest to the thighs: a smaller one slides along the torso, where nothing holds it
    torso_radius : points nearer than this to the middle of the chest are taken for the torso (0.15 m in the paper)
    chest_height : the middle of the chest lies this far above the centre. 0 in the paper; but a belly is round, and its
        plane turns by 0.4 of the body's turn and by 0.1 for heavy people, a chest's by 0.6 and by 0.4
    turn_gain : the turn of the chest's plane away from the camera times this is the body's turn (1 in the paper)
    flat_curvature, curved_curvature : share of the smallest eigenvalue in the sum of the three, at and below which a
        torso counts as flat and from which its normal is ignored
    round_circularity, long_circularity : ratio of the two larger eigenvalues, at and above which the torso's patch
        counts as round and down to which its normal is ignored
    smallest_torso : a patch of fewer points says nothing about the facing
    facing_time : time constant of the smoothing of the facing direction at full weight
    """

    neighbour_distance: float = 0.05
    smallest_component: int = 20
    bridge_distance: float = 0.5
    source_drop: float = 0.3
    centre_width: float = 0.35
    centre_height: float = 0.5
    torso_radius: float = 0.15
    chest_height: float = 0.28
    turn_gain: float = 1.6
    flat_curvature: float = 0.03
    curved_curvature: float = 0.08
    round_circularity: float = 0.65
    long_circularity: float = 0.35
    smallest_torso: int = 30
    facing_time: float = 0.15

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
        if not self.flat_curvature < self.curved_curvature:
            raise SettingsError(
                f"landmarks.flat_curvature is {self.flat_curvature}; it must be below curved_curvature, "
                f"{self.curved_curvature}"
            )
        if not self.long_circularity < self.round_circularity:
            raise SettingsError(
                f"landmarks.long_circularity is {self.long_circularity}; it must be below round_circularity, "
                f"{self.round_circularity}"
            )
