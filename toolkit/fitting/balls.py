"""Ball model of the body along its bones, for fast comparison with a depth image and with itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.kernels import linear

_ALONG: dict[str, tuple[float, ...]] = {
    "root": (0.3,), "lumbar": (0.0, 0.6), "thorax": (0.1, 0.6), "cervical": (0.5,),
    "shoulder": (0.0, 0.35, 0.7), "elbow": (0.0, 0.35, 0.7), "wrist": (0.0, 0.6, 1.1),
    "hip": (0.1, 0.4, 0.7), "knee": (0.0, 0.35, 0.7), "ankle": (0.0, 0.5),
}  # fmt: skip
"""Positions of each joint's balls along its bone; 1.1 is at the fingers."""


def _end(joint: int) -> tuple[bool, int] | None:
    """Return whether the bone of a joint ends at a site, and the index of that site or joint; None without a bone."""
    sites = np.flatnonzero(skeleton.SITE_PARENTS == joint)
    if len(sites):
        return True, int(sites[0])
    below = np.flatnonzero(skeleton.PARENTS == joint)
    return (False, int(below[0])) if len(below) else None


_BONES = [
    (joint, *end, along)
    for joint, name in enumerate(skeleton.JOINT_NAMES)
    if (end := _end(joint)) and (along := _ALONG.get(name.split("_")[-1]))
]
"""Joint, whether its bone ends at a site, index of that site or joint, and positions of the balls."""


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls of one body in its rest pose.

    Attributes
    ----------
    joint : int64 (B,), joint that carries each ball
    offset : float64 (B, 3), from that joint, metres
    radius : float64 (B,), metres: median distance of the joint's skin from the bone
    """

    joint: np.ndarray
    offset: np.ndarray
    radius: np.ndarray
    _rest: np.ndarray

    @classmethod
    def of_body(cls, body: Body) -> Balls:
        """Return the balls of all joints with a bone."""
        joint, offset, radius = [], [], []
        for j, to_site, end, along in _BONES:
            bone = (body.sites if to_site else body.joints)[end] - body.joints[j]
            axis = bone / math.hypot(*bone)
            skin = body.vertices[body.part == j] - body.joints[j]
            around = np.median(linear.lengths(np.cross(skin, axis)))
            for share in along:
                joint.append(j)
                offset.append(share * bone)
                radius.append(around)
        rows = np.array(joint, dtype=np.int64)
        return cls(rows, np.array(offset), np.array(radius), body.joints[rows])

    @cached_property
    def apart(self) -> np.ndarray:
        """Return the pairs of balls that can touch, int64 (K, 2): apart at rest, not of neighbouring joints."""
        centres = self._rest + self.offset
        first, second = np.triu_indices(len(self.joint), 1)
        gap = linear.lengths(centres[first] - centres[second]) - self.radius[first] - self.radius[second]
        parents = skeleton.PARENTS[self.joint]
        near = (parents[first] == self.joint[second]) | (parents[second] == self.joint[first])
        return np.stack([first, second], axis=1)[(gap > 0.0) & ~near & (self.joint[first] != self.joint[second])]
