"""Contact points of the feet: heel and ball of each sole."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.kernels import linear

FEET: dict[str, str] = {"left_leg": "left_ankle", "right_leg": "right_ankle"}
"""Joint that moves the foot of each leg."""


class Sole(NamedTuple):
    """Row of the joint that moves a foot, and its points float64 (2, 3) relative to it: heel and ball, metres."""

    joint: int
    points: np.ndarray

    @classmethod
    def of(cls, body: Body, leg: str) -> Sole:
        """Return heel and ball of a foot in the rest pose, in which it stands on the floor."""
        joint = skeleton.JOINT_NAMES.index(FEET[leg])
        foot = body.vertices[body.part == joint]
        ball = body.sites[skeleton.SITES.index((leg.replace("leg", "foot"), FEET[leg]))]
        heel = np.array([body.joints[joint, 0], 0.0, foot[:, 2].min()])
        points = np.stack([heel, ball])
        points[:, 1] = foot[:, 1].min()
        return cls(joint, points - body.joints[joint])

    def at(self, body: Body, pose: np.ndarray) -> np.ndarray:
        """Return the points of a pose (P,), float64 (2, 3), metres, in the frame of the pose."""
        placed = body.place(pose)
        return placed.origins[self.joint] + linear.rotated(self.points, placed.rotations[self.joint].T)


def soles(body: Body, poses: np.ndarray) -> np.ndarray:
    """Return heel and ball of the left and the right foot in poses (T, P): float64 (T, 2, 2, 3), metres."""
    both = [Sole.of(body, leg) for leg in FEET]
    out = np.empty((len(poses), 2, 2, 3))
    for t, pose in enumerate(poses):
        for side, sole in enumerate(both):
            out[t, side] = sole.at(body, pose)
    return out
