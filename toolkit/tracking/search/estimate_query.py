"""Lookup by the joints that the network estimates."""

from __future__ import annotations

import math

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.database import canonical
from toolkit.database.database import PoseDatabase
from toolkit.fitting.terms import JointTerm
from toolkit.kernels import linear
from toolkit.kernels.cloud import nearest
from toolkit.tracking.observation import Observation
from toolkit.tracking.search.database_lookup import placed_poses
from toolkit.tracking.state import Previous

ESTIMATE_SIGMA = 0.3
"""Metres at which an estimated joint loses its pull: the spread of an uncertain estimate."""

PELVIS = skeleton.REPORTED.index("pelvis")
QUERIED: np.ndarray = np.array(
    [
        row
        for row, name in enumerate(skeleton.REPORTED)
        if name.split("_")[-1] in ("head", "shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    ]
)


class EstimatedJointsQuery:
    """Lookup of the poses whose joints lie nearest to the estimated ones, weighted by their confidence.

    Parameters
    ----------
    pull : weight of a sure joint against one correspondence while an answer is refined; 0 = none
    """

    source = "joints"

    def __init__(self, database: PoseDatabase, pull: float) -> None:
        self._database, self._pull = database, pull
        joints = database.joints[:, QUERIED] - database.joints[:, [PELVIS]]
        self._columns = np.ascontiguousarray(joints.reshape(len(joints), -1).T)

    def poses(self, observation: Observation, previous: Previous | None, body: Body, count: int) -> np.ndarray:
        """See `Query.poses`."""
        if observation.estimate is None:
            return np.empty((0, skeleton.POSE_SIZE))
        points = observation.estimate.points
        size = canonical.torso_length(body) / self._database.torso_length
        yaw, pelvis = facing_of_joints(points), points[PELVIS]
        query = canonical.normalise(points, pelvis, yaw)[QUERIED] / size
        weights = np.repeat(observation.estimate.confidence[QUERIED], 3)
        count = min(count, len(self._database))
        distances, best = np.empty((1, count), dtype=np.float32), np.empty((1, count), dtype=np.int64)
        nearest.weighted_nearest(
            query.reshape(1, -1).astype(np.float32), weights[None].astype(np.float32), self._columns, distances, best
        )
        return placed_poses(self._database, best[0], np.zeros((count, 4)), pelvis, yaw, size)

    def pull(self, observation: Observation) -> JointTerm | None:
        """See `Query.pull`: answers are first drawn to the joints that were seen."""
        estimate = observation.estimate
        if estimate is None or self._pull == 0.0:
            return None
        targets = linear.rotated(estimate.points, observation.cloud.rotation)
        # The confidence is an inverse variance; a term takes an inverse standard deviation.
        return JointTerm(targets, self._pull * np.sqrt(estimate.confidence), ESTIMATE_SIGMA)


def facing_of_joints(joints: np.ndarray) -> float:
    """Return the facing yaw of joints (20, 3) in a y-up frame, from the lines of shoulders and hips, radians."""
    index = skeleton.REPORTED.index
    lateral = np.zeros(3)
    for name in ("shoulder", "hip"):
        line = joints[index(f"left_{name}")] - joints[index(f"right_{name}")]
        lateral += line / max(math.hypot(*line), 1e-9)
    return float(np.arctan2(-lateral[2], lateral[0]))
