"""Settings of the landmarks: graph, geodesic extrema and facing of a cloud."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from toolkit.io.typed_values import AtLeastOne, NotNegative, Range


@dataclass(frozen=True)
class LandmarkSettings:
    """Parameters of Baak 2013, 5.3.4 and 5.4.2, in metres for an adult body.

    Attributes
    ----------
    neighbour_distance : tau, edges of the graph are shorter than this. Just above the depth steps of a Kinect at 4 m
        (4.5 cm), and below the gap between an arm and the torso that it hides
    smallest_component : minimum number of nodes of a component; a hand at 4 m has 30 at half of a Kinect's resolution
    bridge_distance : components farther than this from the largest one stay unconnected (0.5 m in the paper)
    source_drop : distance of the source of the extrema below the centre, at the hips. Head, hands and feet are about
        equally far from the hips; from the centre the knees are farther than the head. All five end effectors are among
        the first five extrema in 74 % of the frames in which they are free (44 % from the centre)
    chest_height : height of the middle of the chest above the centre. 0 in the paper; but a belly is round: its plane
        turns by 0.4 of the body's turn (0.1 for heavy people), that of the chest by 0.6 (0.4)
    turn_gain : ratio of the body's turn away from the camera to that of the chest plane (1 in the paper)
    """

    neighbour_distance: Annotated[float, Range(1e-6, 10.0)] = 0.05
    smallest_component: AtLeastOne = 20
    bridge_distance: Annotated[float, Range(1e-6, 10.0)] = 0.5
    source_drop: NotNegative = 0.3
    chest_height: NotNegative = 0.28
    turn_gain: Annotated[float, Range(1e-6)] = 1.6
