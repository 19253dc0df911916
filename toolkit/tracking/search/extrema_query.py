"""Query of the database by geodesic extrema (Baak 2013, 5.4.3)."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.database import canonical
from toolkit.database.database import PoseDatabase
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.database_lookup import placed_poses
from toolkit.tracking.search.labelings import EFFECTORS, LookupSettings, fused_scores, label_candidates, labelings
from toolkit.tracking.state import Previous

TIPS: np.ndarray = np.array([skeleton.REPORTED.index(name) for name in skeleton.END_EFFECTORS])
"""Rows of the reported joints that are end effectors."""


class ExtremaQuery:
    """Lookup of Baak 2013, 5.4.3: the first five extrema, in every admissible labeling, query the database.

    Two more queries use those of all extrema that lie near the end effectors of the detected joints and of the previous
    pose.
    """

    source = "extrema"

    def __init__(self, database: PoseDatabase, settings: LookupSettings) -> None:
        self._database = database
        self._settings = settings

    def poses(self, observation: Observation, previous: Previous | None, body: Body, count: int) -> np.ndarray:
        """Return poses for the observation, see `Query.poses`."""
        points, present = self.queries(observation, previous)
        if len(points) == 0:
            return np.empty((0, skeleton.POSE_SIZE))
        database = self._database
        size = canonical.torso_length(body) / database.torso_length
        centre = self.centre(observation, size)
        features = canonical.normalise(points, centre, observation.yaw).reshape(len(points), -1) / size
        distances, indices = database.query(features, self._settings.neighbours, present)
        flat = indices.ravel()
        # Eq. 5.5; where end effectors are missing, as if they were as far off as those that are there.
        scores = (distances * np.sqrt(EFFECTORS / present.sum(axis=1))[:, None]).ravel() / EFFECTORS
        if previous is not None:
            offsets = database.offsets[flat]
            joints = canonical.normalise(database.joints[flat], offsets[:, :3], offsets[:, 3])
            before = canonical.normalise(previous.joints, centre, observation.yaw) / size
            scores = fused_scores(scores, joints, before, self._settings.balance)
        best = flat[np.argsort(scores, kind="stable")[:count]]
        return placed_poses(database, best, database.offsets[best], centre, observation.yaw, size)

    def centre(self, observation: Observation, size: float) -> np.ndarray:
        """Return the origin of the normalised extrema: float64 (3,), metres, level frame; `size` against an adult."""
        return canonical.frontal_centre(observation.centre, observation.yaw, size)

    def queries(self, observation: Observation, previous: Previous | None) -> tuple[np.ndarray, np.ndarray]:
        """Return labelled end effectors (M, 5, 3), level frame, and a mask of those present (M, 5)."""
        settings = self._settings
        extrema = observation.free_extrema
        points, present = np.empty((0, EFFECTORS, 3)), np.empty((0, EFFECTORS), dtype=np.bool_)
        if len(extrema) >= EFFECTORS:
            effectors = None if previous is None else previous.effectors
            before = None if previous is None else previous.extrema
            points = extrema[labelings(extrema[:EFFECTORS], effectors, before, observation.elapsed, settings)]
            present = np.ones(points.shape[:2], dtype=np.bool_)
        expected = [] if observation.estimate is None else [observation.estimate.points[TIPS]]
        expected += [] if previous is None else [previous.effectors]
        fewest_known = 3  # minimum number of end effectors of a partial query: with two, any pose fits
        for effectors in expected if settings.candidate_distance > 0.0 else ():
            found, known = label_candidates(extrema, effectors, settings.candidate_distance)
            if known.sum() >= fewest_known:
                points, present = np.concatenate([points, found[None]]), np.concatenate([present, known[None]])
        return points, present

    def pull(self, observation: Observation) -> None:
        """Return None: extrema are pairs of every refinement already; see `Query.pull`."""
