"""Who a person is and how they stand, read off true joints: for trackers that are told where to begin."""

from __future__ import annotations

import numpy as np

from toolkit import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import CLOTHES, ShapeSpace

STIFF = 0.01
"""Metres that a joint may be off rather than that an angle moves by a radian, or a shape by a standard deviation."""


def fitted_to_joints(joints: np.ndarray) -> tuple[Body, np.ndarray]:
    """Body of the shape space and pose (P,) whose joints are nearest to `joints` (20, 3), metres, level frame."""
    from scipy.optimize import least_squares

    space = ShapeSpace.load()
    size = space.size - len(CLOTHES)
    middle = skeleton.REPORTED.index("pelvis")
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[skeleton.ROOT_POSITION] = joints[middle]
    pose[skeleton.ROOT_ROTATION] = [0.0, _facing(joints), 0.0]
    shape = np.zeros(size)
    low, high = skeleton.POSE_LIMITS.T

    def off(unknown: np.ndarray) -> np.ndarray:
        body = space.body(unknown[:size])
        missed = (body.joint_positions(unknown[size:]) - joints).reshape(-1)
        return np.concatenate([missed, STIFF * unknown[:size], STIFF * unknown[size + 6 :]])

    start = np.concatenate([shape, np.clip(pose, low + 1e-6, high - 1e-6)])
    bounds = (np.concatenate([np.full(size, -4.0), low]), np.concatenate([np.full(size, 4.0), high]))
    found = least_squares(off, start, bounds=bounds).x
    return space.body(found[:size]), found[size:]


def _facing(joints: np.ndarray) -> float:
    """Yaw about +y from +z of the shoulders' line, radians."""
    left, right = (joints[skeleton.REPORTED.index(f"{side}_shoulder")] for side in ("left", "right"))
    across = left - right
    return float(np.arctan2(-across[2], across[0]))
