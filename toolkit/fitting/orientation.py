"""Evidence from measured joint orientations (inertial sensors)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.fitting.placed import NormalSystem, PlacedBody


class FrameEvidence(Protocol):
    """Evidence of a frame besides its depth; called between `system.reset` and `system.assemble`."""

    def attract(self, system: NormalSystem, placed: PlacedBody) -> None:
        """Add the quadratic of this evidence for the placed body."""

    def cost(self, placed: PlacedBody) -> float:
        """Return the cost of a placed body's disagreement in metres, at least 0."""


DISAGREEMENT = 0.1
"""Cost added to a pose that contradicts all sensors, metres."""


@dataclass(frozen=True, eq=False)
class OrientationTerm:
    """One joint's measured orientation.

    Attributes
    ----------
    joint : index in `skeleton.JOINTS`
    rotation : float64 (3, 3), rest frame to camera frame, as the sensor has it
    axis : 0, 1 or 2, the bone axis whose direction is compared; -1 for the whole orientation. Depth does not determine
        the twist of a forearm
    disagreement : metres, the share of this sensor in `DISAGREEMENT`
    weight : metres squared per radian squared, equal to the leverage of a limb's own correspondences; a tenth more with
        wrong sensors does more harm than ten times as much helps
    sigma : scale of the Geman-McClure weight, radians
    """

    joint: int
    rotation: np.ndarray
    axis: int
    disagreement: float
    weight: float = 0.3
    sigma: float = math.radians(30.0)

    def attract(self, system: NormalSystem, placed: PlacedBody) -> None:
        """See `FrameEvidence.attract`: a residual `r` about the joint costs `w |r + omega|^2`."""
        turn = self.turn(placed)
        angle = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
        weight = self.weight / (1.0 + (angle / self.sigma) ** 2) ** 2
        hessian, gradient = system.hessian[self.joint], system.gradient[self.joint]
        bone = placed.rotations[self.joint][:, self.axis] if self.axis >= 0 else np.zeros(3)
        for a in range(3):
            gradient[a] += weight * turn[a]
            for b in range(a, 3):
                hessian[a, b] += weight * (float(a == b) - bone[a] * bone[b])

    def cost(self, placed: PlacedBody) -> float:
        """See `FrameEvidence.cost`: Geman-McClure cost of the disagreement."""
        turn = self.turn(placed)
        square = (turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2) / self.sigma**2
        return self.disagreement * square / (1.0 + square)

    def turn(self, placed: PlacedBody) -> np.ndarray:
        """Return the rotation vector (3,) from the measured to the placed orientation, camera frame.

        Its negative is the rotation that corrects the placed joint.
        """
        placed_rotation = placed.rotations[self.joint]
        if self.axis >= 0:
            ours, theirs = placed_rotation[:, self.axis], self.rotation[:, self.axis]
            across = np.array(
                [
                    theirs[1] * ours[2] - theirs[2] * ours[1],
                    theirs[2] * ours[0] - theirs[0] * ours[2],
                    theirs[0] * ours[1] - theirs[1] * ours[0],
                ]
            )
            cosine = float((ours * theirs).sum())
        else:
            # R_placed R_measured', element by element: a sum in a fixed order
            turn = (placed_rotation[:, None, :] * self.rotation[None, :, :]).sum(axis=2)
            across = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
            cosine = 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
        sine = math.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
        angle = math.atan2(sine, cosine)
        if sine < 1e-9:  # equal or opposite: any axis is valid
            return np.array([angle, 0.0, 0.0])
        return across * (angle / sine)
