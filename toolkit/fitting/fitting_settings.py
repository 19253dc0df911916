"""Settings of the fit: correspondences, local optimisation and comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from toolkit.io.typed_values import AtLeastOne, Range


@dataclass(frozen=True)
class FittingSettings:
    """Settings of the local optimisation and of the comparison of poses. Lengths in metres, angles in radians.

    Attributes
    ----------
    iterations : linearisations, at most
    correspondences : "grid" searches the pixel grid with compiled code, "open3d" by Open3D's kd-trees, as in the paper;
        the correspondences are the same to the bit
    neighbours : number l of measured points in the median of a vertex; few, because hands are small and the 3x3 median
        already removed noise; not given in the paper
    reach : maximum distance from a vertex to its measured point: the largest jump between frames, mu of Eq. 5.4
    unexplained : maximum cost of a point in the comparison of poses, metres; larger values only take more time
    sigma : scale of the Geman-McClure weight of correspondences: an error of a limb's width has a quarter of the weight
    vertices : chosen vertices with correspondences: the visible ones ("seen"), or a fixed set at the "front" of the
        body, independent of visibility, as in the paper (Baak 2013, Fig. 5.6a)
    facing : minimum cosine between a vertex's normal and the direction to the camera; grazing angles give no reliable
        correspondence
    surface_plane, surface_point : weights of the two parts of a mesh-to-cloud pair: point-to-plane converges,
        point-to-point keeps limbs from sliding
    cloud_samples : number of measured points with correspondences on the mesh, also used in the comparison; 0 =
        mesh-to-cloud pairs only, and the geodesic extrema in the comparison, as in the paper
    prior_weight : weight of the Gaussian pose prior of the database; 0 = none
    contact_weight : weight of two overlapping body parts relative to one vertex, against self-penetration; 5 and 20 are
        no better
    """

    iterations: AtLeastOne = 5
    correspondences: Literal["grid", "open3d"] = "grid"
    neighbours: Annotated[int, Range(1, 9)] = 3
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
