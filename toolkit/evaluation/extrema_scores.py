"""Detection rate of the five end effectors by the first five geodesic extrema (Baak 2013, 5.5.1)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from toolkit.body import skeleton
from toolkit.landmarks.graph import grid_graph
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.cloud import Cloud

TIPS = np.array([skeleton.REPORTED.index(name) for name in skeleton.END_EFFECTORS])
"""Indices of the five end effectors among the reported joints."""


def _bones() -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of each bone (B, 2), and the end effector of its limb (B,), -1 for the trunk."""
    arm, leg = ("shoulder", "elbow", "wrist", "hand"), ("hip", "knee", "ankle", "foot")
    limbs = [[f"{side}_{name}" for name in limb] for limb in (arm, leg) for side in ("left", "right")]
    limbs.append(["neck", "head"])  # in the order of the end effectors
    bones = [bone for limb in limbs for bone in pairwise(limb)]
    owners = [i for i, limb in enumerate(limbs) for _ in limb[1:]]
    trunk = [("pelvis", "neck"), ("left_hip", "right_hip"), ("left_shoulder", "right_shoulder")]
    trunk += [("left_shoulder", "left_hip"), ("right_shoulder", "right_hip")]
    rows = [[skeleton.REPORTED.index(end) for end in bone] for bone in bones + trunk]
    return np.array(rows), np.array(owners + [-1] * len(trunk))


BONES, OWNERS = _bones()


def all_found(extrema: np.ndarray, ends: np.ndarray) -> bool:
    """Return True if each of five end effectors (5, 3) has its own extremum (n, 3) within 0.2 m."""
    from scipy.optimize import linear_sum_assignment

    if len(extrema) < len(ends):
        return False
    found = 0.2  # maximum distance of an extremum that detects an end effector, metres
    missed = np.linalg.norm(ends[:, None] - extrema[None], axis=-1) >= found
    rows, columns = linear_sum_assignment(missed)
    return not missed[rows, columns].any()


def limbs_of_points(points: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Return the end effector of the limb with the nearest bone for each point (N, 3), -1 for the trunk: int64 (N,)."""
    start, along = joints[BONES[:, 0]], joints[BONES[:, 1]] - joints[BONES[:, 0]]
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(np.einsum("nbc,bc->nb", points[:, None] - start[None], along) / length, 0.0, 1.0)
    nearest = start[None] + share[..., None] * along[None]
    return OWNERS[np.linalg.norm(points[:, None] - nearest, axis=-1).argmin(axis=1)]


def all_free(cloud: Cloud, joints: np.ndarray, settings: LandmarkSettings) -> bool:
    """Return whether all other body parts are over 0.25 m from each end effector along the graph of the cloud.

    A neck is shorter, so the head only has to be free of the other limbs.

    Parameters
    ----------
    cloud : cloud of the person
    joints : (20, 3), true joints, level frame, metres
    """
    from scipy.sparse.csgraph import dijkstra

    nodes = np.linalg.norm(cloud.points[None] - joints[TIPS][:, None], axis=-1).argmin(axis=1)
    free = 0.25  # minimum geodesic distance of a free end effector to all other body parts, metres
    reached = dijkstra(grid_graph(cloud, settings).matrix(), directed=False, indices=nodes, limit=free) <= free
    owners = limbs_of_points(cloud.points.astype(np.float64), joints)
    foreign = [(owners != i) & ((owners >= 0) | (tip != "head")) for i, tip in enumerate(skeleton.END_EFFECTORS)]
    return not any((reached[i] & foreign[i]).any() for i in range(len(nodes)))
