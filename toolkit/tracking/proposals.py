"""Where global pose hypotheses come from: the pose database, asked by geodesic extrema or by regressed joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.database import canonical
from toolkit.database.database import PoseDatabase
from toolkit.tracking.lookup import EFFECTORS, LookupSettings, labelings, score_candidates
from toolkit.tracking.view import View


@dataclass(frozen=True, eq=False)
class Previous:
    """The frame before: its final pose (P,), joints (20, 3), end effectors (5, 3) and extrema (5, 3) or None; level frame."""

    pose: np.ndarray
    joints: np.ndarray
    effectors: np.ndarray
    extrema: np.ndarray | None


class Proposer(Protocol):
    """A source of pose hypotheses for a frame."""

    def propose(self, view: View, previous: Previous | None, body: Body, count: int) -> np.ndarray:
        """The best hypotheses first, at most `count`: float64 (C, P), level frame."""


class ExtremaProposer:
    """The lookup of Baak 2013, 5.4.3: the first five extrema, in every admissible labeling, query the database."""

    def __init__(self, database: PoseDatabase, settings: LookupSettings) -> None:
        self._database = database
        self._settings = settings

    def propose(self, view: View, previous: Previous | None, body: Body, count: int) -> np.ndarray:
        """See `Proposer.propose`."""
        extrema = view.extrema.points[:EFFECTORS].astype(np.float64)
        if len(extrema) < EFFECTORS:
            return np.empty((0, skeleton.POSE_SIZE))
        rows = labelings(
            extrema,
            None if previous is None else previous.effectors,
            None if previous is None else previous.extrema,
            self._settings,
        )
        if len(rows) == 0:
            return np.empty((0, skeleton.POSE_SIZE))
        size = canonical.torso_length(body) / self._database.torso_length
        features = canonical.normalise(extrema[rows], view.centre, view.yaw).reshape(len(rows), -1) / size
        distances, indices = self._database.query(features, self._settings.neighbours)
        flat = indices.ravel()
        joints = previous_joints = None
        if previous is not None:
            joints = canonical.normalise(
                self._database.joints[flat], self._database.offsets[flat, :3], self._database.offsets[flat, 3]
            )
            previous_joints = canonical.normalise(previous.joints, view.centre, view.yaw) / size
        scores = score_candidates(distances.ravel(), joints, previous_joints, self._settings.balance)
        best = flat[np.argsort(scores, kind="stable")[:count]]
        return _placed(self._database, best, self._database.offsets[best], view.centre, view.yaw, size)


class JointsProposer:
    """The regressor's joints query the database: the poses whose joints lie nearest to the votes, weighted by confidence."""

    def __init__(self, database: PoseDatabase) -> None:
        self._database = database

    def propose(self, view: View, previous: Previous | None, body: Body, count: int) -> np.ndarray:
        """See `Proposer.propose`."""
        if view.votes is None:
            return np.empty((0, skeleton.POSE_SIZE))
        points, confidence = view.votes.points, view.votes.confidence
        size = canonical.torso_length(body) / self._database.torso_length
        yaw = facing_of_joints(points)
        pelvis = points[_PELVIS]
        query = canonical.normalise(points, pelvis, yaw)[_QUERIED] / size
        root = self._database.joints[:, _PELVIS]
        difference = self._database.joints[:, _QUERIED] - root[:, None] - query.astype(np.float32)
        distances = np.einsum("njc,njc,j->n", difference, difference, confidence[_QUERIED].astype(np.float32))
        best = np.argpartition(distances, count)[:count] if count < len(distances) else np.arange(len(distances))
        best = best[np.argsort(distances[best], kind="stable")]
        origins = np.zeros((len(best), 4))
        return _placed(self._database, best, origins, pelvis, yaw, size)


_QUERIED: np.ndarray = np.array(
    [
        i
        for i, n in enumerate(skeleton.REPORTED)
        if n.split("_")[-1] in ("head", "elbow", "wrist", "knee", "ankle", "shoulder", "hip")
    ]
)
_PELVIS = skeleton.REPORTED.index("pelvis")


def facing_of_joints(joints: np.ndarray) -> float:
    """Facing yaw of joints (20, 3) in a y-up frame, from the lines of the shoulders and of the hips, radians."""
    index = skeleton.REPORTED.index
    lateral = np.zeros(3)
    for name in ("shoulder", "hip"):
        line = joints[index(f"left_{name}")] - joints[index(f"right_{name}")]
        lateral += line / max(float(np.linalg.norm(line)), 1e-9)
    return float(np.arctan2(-lateral[2], lateral[0]))


def _placed(
    database: PoseDatabase, rows: np.ndarray, origins: np.ndarray, centre: np.ndarray, yaw: float, size: float
) -> np.ndarray:
    """Database poses with their origins, for a body `size` times as large, at a centre and facing."""
    scaled = np.array(origins, dtype=np.float64)
    scaled[:, :3] *= size
    return canonical.place(database.poses[rows].astype(np.float64), scaled, centre, yaw)
