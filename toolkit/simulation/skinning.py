"""How the skin of simulated people follows their joints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from toolkit.body.body import Body
from toolkit.rotations.dual_quaternion import skin_dual


def linear_skinning(body: Body, pose: np.ndarray) -> np.ndarray:
    """Mesh (V, 3) of a pose (P,) by linear blending, as trackers have it."""
    return body.vertex_positions(pose)


def dual_skinning(body: Body, pose: np.ndarray) -> np.ndarray:
    """Mesh (V, 3) of a pose (P,) by dual quaternions (Kavan 2008; Qammaz, 3.1)."""
    placed, out = body.place(pose), np.empty_like(body.vertices)
    skin_dual(body.vertices, body.skin_joints, body.skin_weights, body.joints, placed.rotations, placed.origins, out)
    return out


SKINNINGS: dict[str, Callable[[Body, np.ndarray], np.ndarray]] = {"linear": linear_skinning, "dual": dual_skinning}
"""By the names of `simulate --skinning`."""
