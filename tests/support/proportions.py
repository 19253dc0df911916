"""Bodies of other proportions than those of the shape space."""

from dataclasses import replace

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import BONE_AXIS, Body


def stretched(body: Body, factors: dict[str, float]) -> Body:
    """Return the body with other bone lengths, both sides alike.

    `factors` are keyed by the joint at the upper end without its side: `{"shoulder": 1.05}` lengthens both upper arms
    by 5 % and moves the joints below. Each bone is stretched along its axis in the rest pose (`BONE_AXIS`), vertices
    follow by their skinning weights, and all positions are linear in the factors.
    """
    stretch = np.ones((len(skeleton.JOINTS), 3))
    for j, name in enumerate(skeleton.JOINT_NAMES):
        key = name.removeprefix("left_").removeprefix("right_")
        if key in factors:
            stretch[j, BONE_AXIS[key]] = factors[key]
    joints = body.joints.copy()
    for j, parent in enumerate(skeleton.PARENTS):
        if parent >= 0:
            joints[j] = joints[parent] + stretch[parent] * (body.joints[j] - body.joints[parent])
    offset = joints - stretch * body.joints
    weights = body.skin_weights[..., None]
    vertices = body.vertices * (weights * stretch[body.skin_joints]).sum(axis=1)
    sites = body.sites * stretch[skeleton.SITE_PARENTS] + offset[skeleton.SITE_PARENTS]
    return replace(
        body, vertices=vertices + (weights * offset[body.skin_joints]).sum(axis=1), joints=joints, sites=sites
    )


def grown_to(body: Body, stature: float) -> Body:
    """Return the body scaled to a stature in metres, with a small child's proportions below 1.25 m."""
    tall, small = 1.25, 0.75  # metres of stature of the shape space's proportions and of the shortest limbs
    young = float(np.clip((tall - stature) / (tall - small), 0.0, 1.0))
    if young > 0:
        # A toddler's legs have 0.8 and the arms 0.9 of an older child's length at the same stature; the sitting height
        # falls from 0.60 to 0.53 of the stature (Fredriks 2005, Arch. Dis. Child. 90, 807).
        legs, arms = 1.0 - 0.2 * young, 1.0 - 0.1 * young
        body = stretched(body, {"hip": legs, "knee": legs, "shoulder": arms, "elbow": arms})
    return body.scaled(stature / body.height)
