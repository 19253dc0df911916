"""Settings of the fit: correspondences, local optimisation and comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from toolkit.io.errors import SettingsError


@dataclass(frozen=True)
class FittingSettings:
    """Constants of the local optimisation and of the comparison of poses. Lengths in metres, angles in radians.

    Attributes
    ----------
    iterations : linearisations, at most
    neighbours : l, measured points whose median a vertex is drawn to: few, because hands are small and the 3x3 median
        has taken the noise away; the paper gives no number
    reach : metres from a vertex to its measured point, at most: the largest jump between frames, mu of Eq. 5.4
    unexplained : metres that a point costs at most in the comparison of poses; more only takes longer to find
    sigma : metres; a correspondence that is wrong by a limb's width pulls a quarter
    vertices : which of the chosen vertices have counterparts and are compared: those that are "seen", or a fixed set
        at the "front" of the body, whatever the camera sees of them, as in the paper (Baak 2013, Fig. 5.6a)
    facing : cosine between a vertex's normal and the direction to the camera; at a grazing angle there is no reliable
        counterpart
    surface_plane, surface_point : weights of the two parts of a pair from mesh to cloud: point to plane converges,
        the point part keeps limbs from sliding
    cloud_samples : measured points that are drawn to the mesh and compared with it; 0 = only the mesh is drawn to the
        points, and the geodesic extrema are compared with it, as in the paper
    prior_weight : of the Gaussian pose prior of the database; 0 = none
    contact_weight : of two overlapping parts of the body against one vertex: no self-penetration; 5 and 20 are no
        better
    """

    iterations: int = 5
    neighbours: int = 3
    reach: float = 0.5
    unexplained: float = 0.2
    sigma: float = 0.12
    vertices: Literal["seen", "front"] = "seen"
    facing: float = 0.1
    surface_plane: float = 1.0
    surface_point: float = 0.3
    cloud_samples: int = 400
    prior_weight: float = 0.001
    contact_weight: float = 1.0

    def __post_init__(self) -> None:
        if self.iterations < 1 or not 1 <= self.neighbours <= 9:
            raise SettingsError(
                f"fitting needs at least 1 iteration and 1 to 9 neighbours, not {self.iterations} and {self.neighbours}"
            )
