"""Where global pose hypotheses come from: the pose database, asked by geodesic extrema or by regressed joints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.database import canonical
from toolkit.database.database import PoseDatabase
from toolkit.kernels import nearest
from toolkit.tracking.lookup import EFFECTORS, LookupSettings, fused_scores, label_candidates, labelings
from toolkit.tracking.view import View


@dataclass(frozen=True, eq=False)
class Previous:
    """The frame before, level frame: pose (P,), joints (20, 3), end effectors (5, 3) and extrema (5, 3) or None."""

    pose: np.ndarray
    joints: np.ndarray
    effectors: np.ndarray
    extrema: np.ndarray | None


class Proposer(Protocol):
    """A source of pose hypotheses for a frame."""

    def propose(self, view: View, previous: Previous | None, body: Body, count: int) -> np.ndarray:
        """The best hypotheses first, at most `count`: float64 (C, P), level frame."""


class ExtremaProposer:
    """The lookup of Baak 2013, 5.4.3: the first five extrema, in every admissible labeling, query the database.

    Two more queries ask with those of all extrema that lie where a regressor, and where the previous pose, expect the
    end effectors.
    """

    def __init__(self, database: PoseDatabase, settings: LookupSettings) -> None:
        self._database = database
        self._settings = settings

    def propose(self, view: View, previous: Previous | None, body: Body, count: int) -> np.ndarray:
        """See `Proposer.propose`."""
        points, present = self.queries(view, previous)
        if len(points) == 0:
            return np.empty((0, skeleton.POSE_SIZE))
        database = self._database
        size = canonical.torso_length(body) / database.torso_length
        centre = canonical.frontal_centre(view.centre, view.yaw, size)
        features = canonical.normalise(points, centre, view.yaw).reshape(len(points), -1) / size
        distances, indices = database.query(features, self._settings.neighbours, present)
        flat = indices.ravel()
        # Eq. 5.5; where end effectors are missing, as if they were as far off as those that are there.
        scores = (distances * np.sqrt(EFFECTORS / present.sum(axis=1))[:, None]).ravel() / EFFECTORS
        if previous is not None:
            offsets = database.offsets[flat]
            joints = canonical.normalise(database.joints[flat], offsets[:, :3], offsets[:, 3])
            before = canonical.normalise(previous.joints, centre, view.yaw) / size
            scores = fused_scores(scores, joints, before, self._settings.balance)
        best = flat[np.argsort(scores, kind="stable")[:count]]
        return _placed(database, best, database.offsets[best], centre, view.yaw, size)

    def queries(self, view: View, previous: Previous | None) -> tuple[np.ndarray, np.ndarray]:
        """Labelled end effectors (M, 5, 3), level frame, and which of them are present (M, 5)."""
        settings = self._settings
        extrema = view.extrema.points.astype(np.float64)
        points, present = np.empty((0, EFFECTORS, 3)), np.empty((0, EFFECTORS), dtype=np.bool_)
        if len(extrema) >= EFFECTORS:
            effectors = None if previous is None else previous.effectors
            before = None if previous is None else previous.extrema
            points = extrema[labelings(extrema[:EFFECTORS], effectors, before, settings)]
            present = np.ones(points.shape[:2], dtype=np.bool_)
        expected = [] if view.votes is None else [view.votes.points[_TIPS]]
        expected += [] if previous is None else [previous.effectors]
        for effectors in expected if settings.candidate_distance > 0.0 else ():
            found, known = label_candidates(extrema, effectors, settings.candidate_distance)
            if known.sum() >= FEWEST_KNOWN:
                points, present = np.concatenate([points, found[None]]), np.concatenate([present, known[None]])
        return points, present


class JointsProposer:
    """The regressor's joints query the database: the poses whose joints lie nearest to the votes, by confidence."""

    def __init__(self, database: PoseDatabase) -> None:
        self._database = database
        joints = database.joints[:, _QUERIED] - database.joints[:, [_PELVIS]]
        self._columns = np.ascontiguousarray(joints.reshape(len(joints), -1).T)

    def propose(self, view: View, previous: Previous | None, body: Body, count: int) -> np.ndarray:
        """See `Proposer.propose`."""
        if view.votes is None:
            return np.empty((0, skeleton.POSE_SIZE))
        points = view.votes.points
        size = canonical.torso_length(body) / self._database.torso_length
        yaw, pelvis = facing_of_joints(points), points[_PELVIS]
        query = canonical.normalise(points, pelvis, yaw)[_QUERIED] / size
        weights = np.repeat(view.votes.confidence[_QUERIED], 3)
        count = min(count, len(self._database))
        distances, best = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.int64)
        nearest.weighted_nearest(
            query.ravel().astype(np.float32), weights.astype(np.float32), self._columns, distances, best
        )
        return _placed(self._database, best, np.zeros((count, 4)), pelvis, yaw, size)


def facing_of_joints(joints: np.ndarray) -> float:
    """Facing yaw of joints (20, 3) in a y-up frame, from the lines of the shoulders and of the hips, radians."""
    index = skeleton.REPORTED.index
    lateral = np.zeros(3)
    for name in ("shoulder", "hip"):
        line = joints[index(f"left_{name}")] - joints[index(f"right_{name}")]
        lateral += line / max(math.hypot(*line), 1e-9)
    return float(np.arctan2(-lateral[2], lateral[0]))


def _placed(
    database: PoseDatabase, rows: np.ndarray, origins: np.ndarray, centre: np.ndarray, yaw: float, size: float
) -> np.ndarray:
    """Database poses with their origins, for a body `size` times as large, at a centre and facing."""
    scaled = np.array(origins, dtype=np.float64)
    scaled[:, :3] *= size
    return canonical.place(database.poses[rows].astype(np.float64), scaled, centre, yaw)


_QUERIED: np.ndarray = np.array(
    [
        row
        for row, name in enumerate(skeleton.REPORTED)
        if name.split("_")[-1] in ("head", "shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    ]
)
_TIPS: np.ndarray = np.array([skeleton.REPORTED.index(name) for name in skeleton.END_EFFECTORS])
FEWEST_KNOWN = 3
"""End effectors that a partial query needs: with two, any pose fits."""
_PELVIS = skeleton.REPORTED.index("pelvis")
