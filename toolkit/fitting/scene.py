"""Input of a fit from one frame: measured depth, samples of its points, and nearest-point queries."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from toolkit.fitting.orientation import FrameEvidence
from toolkit.fitting.placed import PlacedBody
from toolkit.fitting.priors import PoseTerm
from toolkit.kernels import linear
from toolkit.kernels.fit import pairs
from toolkit.sensing.cloud import Cloud, cropped, marked

EXTREMUM_WEIGHT = 3.0
"""Weight of a geodesic extremum relative to other samples, which are mostly on the torso."""


class Scene:
    """One cleaned frame as input of the fit.

    Attributes
    ----------
    depth : float32 (H, W), metres, 0 where no person was measured
    intrinsics : float64 (4,) of that image
    seen : float32 (H, W): the same depth, 0 in the background and NaN in unobserved pixels
    samples : float64 (N, 3), camera frame: every n-th measured point in scan order, then the geodesic extrema
    plain_samples : number of samples before the extrema
    extrema : float64 (E, 3), camera frame: geodesic extrema (`E_I^20`)
    cut : bool (E,), extrema at cuts by the image border or an occluder, which are no limbs
    evidence, priors : evidence on the placed body, and priors on the pose, besides depth
    withheld : bool (18,), joints whose links are out of view and have no measured points; None for none
    """

    def __init__(
        self,
        cloud: Cloud,
        extrema_level: np.ndarray,
        samples: int,
        evidence: Sequence[FrameEvidence] = (),
        *,
        priors: Sequence[PoseTerm] = (),
        unobserved: np.ndarray | None = None,
        cut: np.ndarray | None = None,
        withheld: np.ndarray | None = None,
    ) -> None:
        self.evidence, self.priors, self.withheld = tuple(evidence), tuple(priors), withheld
        self.depth = cloud.depth
        self.seen = cloud.depth if unobserved is None else marked(cloud.depth, unobserved, np.nan)
        self.cut = np.zeros(len(extrema_level), dtype=np.bool_) if cut is None else cut
        self.intrinsics = np.array(cloud.camera.intrinsics, dtype=np.float64)
        self._person = cropped(self.depth, self.intrinsics)
        rows = cloud.spread_rows(samples)
        self.extrema = linear.rotated(extrema_level, cloud.rotation)
        self.plain_samples = len(rows)
        self.samples = np.ascontiguousarray(
            np.concatenate([linear.rotated(cloud.points.take(rows, axis=0), cloud.rotation), self.extrema])
        )

    def medians(self, points: np.ndarray, wanted: np.ndarray, reach: float, count: int, out: np.ndarray) -> None:
        """Fill `out` (C, 3) with the median of the `count` measured points nearest to each of `points` (C, 3).

        Camera frame, metres. Rows that are not `wanted` (C,) or have no point within `reach` become NaN in column 0.
        The search on the pixel grid is exact (`toolkit.kernels.image.pixel_search`).
        """
        pairs.nearest_medians(points, wanted, *self._person, reach, count, out)

    def nearest_drawn(self, placed: PlacedBody, samples: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Find the point nearest to each of `samples` (N, 3), camera frame, on the surface that the camera sees.

        Returns
        -------
        points : float64 (N, 3)
        vertex_of : int64 (N,), their mesh vertices, -1 where there is nothing within `reach`, or only a link that is
            out of view (`withheld`)
        """
        points, vertex_of = np.empty_like(samples), np.empty(len(samples), dtype=np.int64)
        pairs.nearest_model_points(
            samples, placed.drawn.depth, placed.drawn.triangle, placed.drawn.intrinsics, placed.placer.faces,
            placed.vertices, reach, points, vertex_of,
        )  # fmt: skip
        return points, self.without_withheld(placed, vertex_of)

    def without_withheld(self, placed: PlacedBody, vertex_of: np.ndarray) -> np.ndarray:
        """Return `vertex_of` (N,) with -1 in the place of vertices of links that are out of view."""
        if self.withheld is not None:
            vertex_of[self.withheld[placed.body.part[vertex_of]]] = -1
        return vertex_of

    @cached_property
    def weights(self) -> np.ndarray:
        """Return the weights of the samples, float64 (N,): `EXTREMUM_WEIGHT` for extrema that may be limbs, else 1."""
        return np.concatenate([np.ones(self.plain_samples), np.where(self.cut, 1.0, EXTREMUM_WEIGHT)])
