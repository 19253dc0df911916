"""Feet that rest on the floor: points of the sole on its plane, and where the foot came to rest (thesis, Eq. 6.7)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit import skeleton
from toolkit.body.body import Body
from toolkit.fitting.priors import ResidualTerm
from toolkit.kernels import kinematics, linear

FEET: dict[str, str] = {"left_leg": "left_ankle", "right_leg": "right_ankle"}
"""Leg -> the joint that carries its foot."""


class Sole(NamedTuple):
    """Points under a foot: the row of the joint that carries them, and float64 (2, 3) from there, heel and ball."""

    joint: int
    points: np.ndarray

    @classmethod
    def of(cls, body: Body, leg: str) -> Sole:
        """Heel and ball of a foot in the rest pose, in which it stands on the floor."""
        joint = skeleton.JOINT_NAMES.index(FEET[leg])
        foot = body.vertices[body.part == joint]
        ball = body.sites[skeleton.SITES.index((leg.replace("leg", "foot"), FEET[leg]))]
        heel = np.array([body.joints[joint, 0], 0.0, foot[:, 2].min()])
        points = np.stack([heel, ball])
        points[:, 1] = foot[:, 1].min()
        return cls(joint, points - body.joints[joint])

    def at(self, body: Body, pose: np.ndarray) -> np.ndarray:
        """The points in a pose (P,), float64 (2, 3), metres, in the pose's frame."""
        count = len(skeleton.JOINTS)
        vectors, rotations, origins = np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 3))
        kinematics.forward_kinematics(
            pose, skeleton.PARENTS, body.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS, vectors, rotations, origins
        )
        return origins[self.joint] + linear.rotated(self.points, rotations[self.joint].T)


def floor_term(
    body: Body, leg: str, entries: np.ndarray, height: float, rest: np.ndarray | None, weight: float, sigma: float
) -> ResidualTerm:
    """The sole of a foot on the floor: both points pulled down or up to it, and to where they came to rest.

    Parameters
    ----------
    body : whose foot it is
    leg, entries : `left_leg` or `right_leg`, and where the angles stand in a pose that may give way
    height : metres, y of the floor under the foot, level frame
    rest : float64 (2, 3), where heel and ball rest, of which x and z count; None where that is not known
    weight, sigma : see `ResidualTerm`
    """
    sole = Sole.of(body, leg)

    def residuals(pose: np.ndarray) -> np.ndarray:
        points = sole.at(body, pose)
        above = points[:, 1] - height
        return above if rest is None else np.concatenate([above, (points - rest)[:, [0, 2]].ravel()])

    return ResidualTerm(weight, sigma, entries, residuals)
