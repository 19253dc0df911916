"""Held objects, which move with the hands and are not part of the person."""

import numpy as np

from toolkit.body import skeleton
from toolkit.simulation.mesh import Mesh, box, joined, moved

HOLDINGS: dict[str, tuple[float, float, float]] = {
    "box": (0.0, 0.28, 0.3), "tablet": (0.0, 0.2, 0.015), "bag": (0.3, 0.36, 0.14),
}  # fmt: skip
"""Width, height and depth in metres of held objects; an object in both hands is as wide as their distance."""
_LEFT, _RIGHT = (skeleton.REPORTED.index(f"{side}_hand") for side in ("left", "right"))


def held_mesh(kind: str, joints: np.ndarray) -> Mesh:
    """Return an object of `HOLDINGS` in the hands of joints (20, 3), metres, y up.

    A box or tablet is between both hands, a bag below the left one.
    """
    _, high, deep = HOLDINGS[kind]
    left, right = joints[_LEFT], joints[_RIGHT]
    straps = 0.14  # metres from the hand to the top of a bag
    if kind == "bag":
        wide = HOLDINGS[kind][0]
        bag = box((-0.5 * deep, -straps - high, -0.5 * wide), (0.5 * deep, -straps, 0.5 * wide))
        strap = box((-0.02, -straps, -0.5 * wide + 0.05), (0.02, 0.0, 0.5 * wide - 0.05))
        return moved(joined([bag, strap]), left[0], left[1], left[2], _facing(joints))
    middle, across = 0.5 * (left + right), left - right
    wide = max(float(np.hypot(across[0], across[2])), 0.2)
    thing = box((-0.5 * wide, -0.5 * high, -0.5 * deep), (0.5 * wide, 0.5 * high, 0.5 * deep))
    return moved(thing, middle[0], middle[1], middle[2], float(np.arctan2(-across[2], across[0])))


def _facing(joints: np.ndarray) -> float:
    """Return the yaw about +y from +z of the hips of joints (20, 3), radians."""
    across = joints[skeleton.REPORTED.index("left_hip")] - joints[skeleton.REPORTED.index("right_hip")]
    return float(np.arctan2(-across[2], across[0]))
