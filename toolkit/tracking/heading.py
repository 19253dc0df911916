"""Expected heading of a person from neighbouring frames; it separates front from back where one frame's depth does
not.

In real rooms a body seen from behind explains the depth nearly as well as one that faces the camera. But people walk
forwards; and of many frames there are some in which the joint network is sure of both shoulders.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from toolkit.body import skeleton
from toolkit.database import canonical
from toolkit.kernels import linear
from toolkit.landmarks.joint_network import JointEstimate
from toolkit.sensing.joints2d import LiftedJoints
from toolkit.tracks import TRACKED

AROUND = 0.75
"""Time constant of the weight of an estimated facing, seconds."""
HEADING_UNCERTAINTY = 0.5
"""Sum of certain facings around a frame at which the heading has half of its full weight."""
MAX_HEADING_PENALTY = 0.25
"""Maximum relative penalty on the cost of a pose that disagrees with the expected heading. It is relative because
differences of distance are not informative where no pose explains the frame well.
"""
LINES = [
    (skeleton.REPORTED.index(f"left_{name}"), skeleton.REPORTED.index(f"right_{name}")) for name in ("shoulder", "hip")
]
"""Joints from side to side of the trunk."""
PLACED = [skeleton.REPORTED.index(name) for name in ("neck", "pelvis")]
"""Joints whose mean is the place of a person."""


def directions_walked(rows: np.ndarray, timestamps: np.ndarray, level_rotation: np.ndarray) -> np.ndarray:
    """Return the directions in which a person walks, from the track.

    Parameters
    ----------
    rows : (T,) of the track, with its columns `joints`, metres, camera frame, and `state`
    timestamps : float64 (T,), seconds
    level_rotation : R_level_camera, float64 (3, 3)

    Returns
    -------
    float64 (T, 2): x and z in the level frame; the length is the certainty that they walk, 0 to 1
    """
    known = np.flatnonzero(rows["state"] == TRACKED)
    walked = np.zeros((len(timestamps), 2))
    places = linear.rotated(rows["joints"][known][:, PLACED].mean(axis=1), level_rotation.T)[:, [0, 2]]
    times = timestamps[known]
    # Seconds before and after a moment over which the path is measured: a person who bends, sits down or rises
    # does not move far in twice that time.
    window = 0.75
    stands, walks = 0.4, 0.8  # m/s: no weight below the first value, full weight above the second
    longest = 1.2  # maximum time to the nearest frame on either side, seconds
    for k, moment in enumerate(times):
        first, last = np.searchsorted(times, [moment - window, moment + window])
        first, last = min(first, max(k - 1, 0)), max(last - 1, min(k + 1, len(times) - 1))
        if max(moment - times[first], times[last] - moment) > longest or first == last:
            continue
        velocity = (places[last] - places[first]) / (times[last] - times[first])
        speed = float(np.hypot(*velocity))
        walked[known[k]] = velocity / max(speed, 1e-9) * np.clip((speed - stands) / (walks - stands), 0.0, 1.0)
    return walked


def estimated_facing(estimate: JointEstimate | None) -> np.ndarray:
    """Return the facing by the estimates of shoulders and hips: float64 (2,), x and z in the level frame; its length is
    the probability that one of the shoulders and one of the hips is correct, zero without estimates.
    """
    if estimate is None:
        return np.zeros(2)
    wrong = 1.0 - estimate.reliability
    return _facing(estimate.points, [1.0 - wrong[left] * wrong[right] for left, right in LINES])


def sighted_facing(joints: LiftedJoints | None) -> np.ndarray:
    """Return the facing by image joints in space, level frame, as `estimated_facing`; zero without shoulders and hips.

    The face is visible in colour, so that a detector confuses front and back less often than depth does.
    """
    if joints is None:
        return np.zeros(2)
    return _facing(joints.points, [float(joints.confidence[i]) * float(joints.confidence[j]) for i, j in LINES])


def _facing(points: np.ndarray, sure: Sequence[float]) -> np.ndarray:
    """Return the sum of the directions (2,) perpendicular to `LINES` between joints (20, 3), by certainty; NaN is
    left out.
    """
    facing = np.zeros(2)
    for (left, right), certainty in zip(LINES, sure, strict=True):
        across = points[left] - points[right]
        if np.isfinite(across).all():
            facing += certainty * np.array([-across[2], across[0]]) / max(math.hypot(across[0], across[2]), 1e-9)
    return facing


def directions_faced(moments: np.ndarray, facings: np.ndarray, timestamps: np.ndarray) -> np.ndarray:
    """Return the facing directions of a person, from the estimates in some frames.

    Parameters
    ----------
    moments, facings : float64 (N,), seconds, rising, and (N, 2), see `estimated_facing`
    timestamps : float64 (T,), seconds, of all frames

    Returns
    -------
    float64 (T, 2): x and z in the level frame, as long as it is sure that they face there, 0 to 1
    """
    faced = np.zeros((len(timestamps), 2))
    for frame, moment in enumerate(timestamps):
        near = slice(*np.searchsorted(moments, [moment - 4.0 * AROUND, moment + 4.0 * AROUND]))
        weights = np.exp(-np.abs(moments[near] - moment) / AROUND)
        together = (weights[:, None] * facings[near]).sum(axis=0)
        faced[frame] = together / (HEADING_UNCERTAINTY + math.hypot(*together))
    return faced


def heading(walked: np.ndarray, faced: np.ndarray) -> np.ndarray:
    """Return the combined heading: float64 (T, 2), x and z in the level frame; the length is the certainty, 0 to 1."""
    together = walked + faced
    return together / np.maximum(np.hypot(together[:, :1], together[:, 1:]), 1.0)


def heading_disagreement(heads: np.ndarray, pose: np.ndarray) -> float:
    """Return the disagreement of a heading (2,), see `heading`, with a pose (P,), level frame: -1 to 1."""
    if not heads.any():
        return 0.0
    yaw = float(canonical.body_facing(pose))
    return -float(heads[0] * np.sin(yaw) + heads[1] * np.cos(yaw))


def weighed(cost: float, pose: np.ndarray, heads: np.ndarray) -> float:
    """Return the cost of a pose (P,), metres, raised by up to `MAX_HEADING_PENALTY` if its heading disagrees."""
    return cost * (1.0 + MAX_HEADING_PENALTY * heading_disagreement(heads, pose))
