"""Keypoints of detectors, and the reported joints that they define (Qammaz, 2.2)."""

from __future__ import annotations

from typing import Any

import numpy as np

from toolkit.body import skeleton

Points = dict[str, tuple[int, ...]]
"""Reported joint -> keypoints of a detector; the joint is their mean."""


def _both(ears: tuple[int, int], **pairs: tuple[Any, Any]) -> Points:
    """Return the keypoints of the left and the right side by joint; a tuple where several define one.

    The head is between the ears. Pelvis, spine and neck are derived from other joints.
    """
    points: Points = {"head": ears}
    for name, pair in pairs.items():
        for side, point in zip(("left", "right"), pair, strict=True):
            points[f"{side}_{name}"] = point if isinstance(point, tuple) else (point,)
    return points


POSE_MODEL = _both(
    (7, 8), shoulder=(11, 12), elbow=(13, 14), wrist=(15, 16), hand=((17, 19), (18, 20)), hip=(23, 24), knee=(25, 26),
    ankle=(27, 28), foot=(31, 32),
)  # fmt: skip
"""The 33 points of MediaPipe's pose landmark model (see `people/image_joints/pose_model.py`)."""
BODY_25 = _both(
    (18, 17), shoulder=(5, 2), elbow=(6, 3), wrist=(7, 4), hip=(12, 9), knee=(13, 10), ankle=(14, 11), foot=(19, 22)
)
"""OpenPose's own format; feet are the big toes."""
COCO_18 = _both((17, 16), shoulder=(5, 2), elbow=(6, 3), wrist=(7, 4), hip=(11, 8), knee=(12, 9), ankle=(13, 10))
"""OpenPose's format with a neck."""
COCO_17 = _both((3, 4), shoulder=(5, 6), elbow=(7, 8), wrist=(9, 10), hip=(11, 12), knee=(13, 14), ankle=(15, 16))
"""The points of the COCO data set."""


def reported_rows(found: np.ndarray, points: Points) -> np.ndarray:
    """Convert keypoints (K, 3), u, v, confidence (0 = unknown), to joints float32 (20, 3), NaN if unknown.

    Only known keypoints count: one ear is visible from the side.
    """
    rows = np.full((len(skeleton.REPORTED), 3), np.nan, dtype=np.float32)
    for name, sources in points.items():
        chosen = found[list(sources)]
        chosen = chosen[chosen[:, 2] > 0]
        if len(chosen):
            rows[skeleton.REPORTED.index(name)] = chosen.sum(axis=0) / len(chosen)
    return rows
