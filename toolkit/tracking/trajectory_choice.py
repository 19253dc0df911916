"""Trajectories of one person: their steps, and the selection between two of them.

A trajectory is a row of the track for each frame, found by following the person forwards or backwards in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from toolkit.tracks import FrameResult

SWITCH_COST = 1.0
"""Cost of a switch between two trajectories per metre between them: ten frames in which the better one is 3 cm nearer
to the measurements outweigh a jump of 30 cm.
"""


class Direction(Enum):
    """Direction of time in which a person is followed; the value is the step to the next frame."""

    FORWARD = 1
    BACKWARD = -1


@dataclass(frozen=True, eq=False)
class Step:
    """One frame of a trajectory.

    Attributes
    ----------
    result : row of the track
    cost : metres, distance of the pose from the frame
    direction : in which the person was followed to this frame
    continues : the pose continues that of the frame followed before
    rival_cost : metres, of the first pass's pose in this frame; infinite without one
    """

    result: FrameResult
    cost: float
    direction: Direction = Direction.FORWARD
    continues: bool = True
    rival_cost: float = math.inf


def apart(one: FrameResult, other: FrameResult) -> float:
    """Return the mean distance of two rows' joints, metres."""
    return float(np.linalg.norm(one.joints - other.joints, axis=1).mean())


def better_parts(
    first: np.ndarray, second: np.ndarray, gaps: np.ndarray, ends: tuple[bool, bool] = (False, False)
) -> np.ndarray:
    """Return the frames of the second of two trajectories on the cheapest path through both (Viterbi 1967).

    Parameters
    ----------
    first, second : float64 (T,), metres, cost of each frame on either trajectory
    gaps : float64 (T,), metres, between the trajectories in each frame, for the cost of a switch
    ends : True if the path may begin and end on the second trajectory, else it does on the first one

    Returns
    -------
    bool (T,)
    """
    costs = np.stack([first, second], axis=1)
    best, came = np.array([0.0, 0.0 if ends[0] else np.inf]), np.zeros((len(costs), 2), dtype=np.int64)
    for t, cost in enumerate(costs):
        switched = best[::-1] + SWITCH_COST * gaps[t]
        came[t] = np.where(switched < best, [1, 0], [0, 1])
        best = np.minimum(best, switched) + cost
    if not ends[1]:
        best[1] += SWITCH_COST * gaps[-1]
    taken, chosen = int(np.argmin(best)), np.zeros(len(costs), dtype=np.bool_)
    for t in range(len(costs) - 1, -1, -1):
        chosen[t] = taken == 1
        taken = int(came[t, taken])
    return chosen
