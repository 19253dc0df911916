"""The tracker of Baak 2013 as it is printed, and the reference that a reader follows with the paper in hand.

Its constants stand in `configs/baak2013.yaml`, its deviations in `docs/baak2013.md`; here is what no constant switches.
`Follower.step` is one frame, from top to bottom:

| paper | code |
|---|---|
| 5.3.1: background subtraction, contour pixels, median | `SinglePersonSegmenter.clean`, `DepthFilter.filtered` |
| 5.3.1: point cloud `M_I` | `Cloud.from_depth` |
| 5.3.2: mesh `M_chi` and joints of a pose `chi` | `PlacedBody`, `Body.joint_positions` |
| 5.3.3, Eq. 5.1: database, features `E_chi^5`, kd-tree | `PoseDatabase`, `Open3DSearch` |
| 5.3.4: centre and viewing direction | `cloud_centre`, `estimate_facing` |
| 5.4.1: correspondences, the median of the l nearest points | `SurfaceTerm.targets`, `Open3DScene.medians` |
| 5.4.1: local optimisation | `LocalSearch.propose`, `Refiner.refine` |
| 5.4.2: geodesic extrema `E_I^20` | `grid_graph`, `extrema_of_graph` |
| 5.4.3, Eq. 5.4: admissible labelings | `labelings` |
| 5.4.3, Eq. 5.5 and 5.6: retrieved poses and their scores | `ExtremaQuery.poses`, `fused_scores` |
| 5.4.4, Eq. 5.7 to 5.9: sparse symmetric distance, late fusion | `Objective.compare`, `Follower.step` |

The neighbours are found by Open3D's kd-trees; `tests/support/plain_pipeline.py` has the remaining steps in NumPy and
SciPy.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracking.follower import Follower
from toolkit.tracking.observation import Observation, Observer
from toolkit.tracking.registry import Registration, register
from toolkit.tracking.search.database_lookup import Query
from toolkit.tracking.search.extrema_query import ExtremaQuery


class PublishedObservation(Observation):
    """Observation in which each extremum may be a limb (5.4.2), also one at the image border."""

    @cached_property
    def cut(self) -> np.ndarray:
        """None of the extrema: bool (n,)."""
        return np.zeros(len(self.extrema.nodes), dtype=np.bool_)


class PublishedQuery(ExtremaQuery):
    """Query with extrema normalised about the centre of the surface (5.3.4)."""

    def centre(self, observation: Observation, size: float) -> np.ndarray:
        """See `ExtremaQuery.centre`."""
        return observation.centre


class PublishedFollower(Follower):
    """Follower that expects no person at the last place."""

    held = 0.0


class Baak2013Tracker(HybridTracker):
    """Tracker of Baak 2013, 5.4: of two hypotheses the one with the lower cost is the pose."""

    kind = PublishedFollower
    occluded_limbs = None

    def queries(self) -> list[Query]:
        """Return the lookup by the first five extrema (5.4.3), unless the settings leave it out."""
        wanted = "extrema" in self.settings.hypotheses
        return [PublishedQuery(self._poses, self.settings.lookup)] if wanted else []

    @property
    def observer(self) -> Observer:
        """See `HybridTracker.observer`."""
        return replace(super().observer, kind=PublishedObservation)


register(
    "baak2013",
    Registration(
        HybridSettings,
        needs_database=True,
        build=lambda settings, database, path: Baak2013Tracker(database, settings, database_path=path),
    ),
)
