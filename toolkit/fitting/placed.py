"""A body placed in front of the camera: skinned, drawn into a small z-buffer on demand, with its correspondences."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import BELOW, Body
from toolkit.kernels import linear
from toolkit.kernels.fit import pairs, placing, twists
from toolkit.sensing.camera import Camera

QUOTAS: dict[str, int] = {
    "root": 22, "lumbar": 14, "thorax": 26, "cervical": 22,
    "clavicle": 8, "shoulder": 20, "elbow": 20, "wrist": 14,
    "hip": 26, "knee": 24, "ankle": 14,
}  # fmt: skip
"""Number of chosen vertices per body part: limbs get more than their share of the surface (Baak 2013, 5.4.1)."""
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


def spread_rows(points: np.ndarray, count: int) -> np.ndarray:
    """Select rows of `points` (N, D) by farthest-first traversal, each the farthest from the mean and the earlier ones.

    Returns int64 (min(count, N),), in the order of selection.
    """
    chosen = np.empty(min(count, len(points)), dtype=np.int64)
    nearest = ((points - points.mean(axis=0)) ** 2).sum(axis=1) if len(points) else np.empty(0)
    for k in range(len(chosen)):
        chosen[k] = nearest.argmax()
        nearest = np.minimum(nearest, ((points - points[chosen[k]]) ** 2).sum(axis=1))
    return chosen


@lru_cache(maxsize=16)
def choose_vertices(body: Body) -> np.ndarray:
    """Select the subset `C_chi` of mesh vertices by farthest-first traversal of each body part (Baak 2013, Fig. 5.6a).

    The result is cached for each body.

    Returns
    -------
    int64 (C,), ascending vertex indices; the end-effector vertices are always included.
    """
    chosen = set(int(v) for v in body.end_effectors)
    for joint, name in enumerate(skeleton.JOINT_NAMES):
        members = np.flatnonzero(body.part == joint)
        quota = min(QUOTAS[name.split("_")[-1]], len(members))
        chosen.update(members[spread_rows(body.vertices[members], quota)].tolist())
    return np.array(sorted(chosen), dtype=np.int64)


def _chosen_around_joints(body: Body, chosen: np.ndarray) -> np.ndarray:
    """Return weights (20, C) that average over the chosen vertices nearest to each reported joint in the rest pose."""
    joints = body.joint_positions(np.zeros(skeleton.POSE_SIZE))
    distances = np.linalg.norm(joints[:, None] - body.vertices[chosen][None], axis=2)
    around_joint = 16  # number of chosen vertices that define the support of a joint
    rows = np.argsort(distances, axis=1, kind="stable")[:, :around_joint]
    weights = np.zeros(distances.shape)
    np.put_along_axis(weights, rows, 1.0 / around_joint, axis=1)
    return weights


class Drawn(NamedTuple):
    """Part of the small image that contains a placed body.

    Attributes
    ----------
    depth : float64 (h, w), metres, 0 where nothing is
    triangle : int32 (h, w), -1 in the background
    intrinsics : float64 (4,) of that part
    """

    depth: np.ndarray
    triangle: np.ndarray
    intrinsics: np.ndarray


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

    @cached_property
    def apart(self) -> np.ndarray:
        """Return the pairs of balls that can touch, int64 (K, 2): apart at rest, not of neighbouring joints."""
        centres = self._rest + self.offset
        first, second = np.triu_indices(len(self.joint), 1)
        gap = linear.lengths(centres[first] - centres[second]) - self.radius[first] - self.radius[second]
        parents = skeleton.PARENTS[self.joint]
        near = (parents[first] == self.joint[second]) | (parents[second] == self.joint[first])
        return np.stack([first, second], axis=1)[(gap > 0.0) & ~near & (self.joint[first] != self.joint[second])]


@lru_cache(maxsize=16)
def balls_of(body: Body) -> Balls:
    """Return the balls of all joints with a bone, cached for each body."""
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
    return Balls(rows, np.array(offset), np.array(radius), body.joints[rows])


class Placer:
    """Placer of bodies of one topology in front of one camera.

    Parameters
    ----------
    body : any body of that topology; its chosen vertices are used for all
    camera : camera of the small image that bodies are drawn into
    level_rotation : R_level_camera, float64 (3, 3)

    Attributes
    ----------
    chosen : int64 (C,), see `choose_vertices`
    front : bool (C,), vertices that face forward in the rest pose
    around_joints : float64 (20, C), see `_chosen_around_joints`
    """

    def __init__(self, body: Body, camera: Camera, level_rotation: np.ndarray) -> None:
        self.camera = camera
        self.intrinsics = np.array(camera.intrinsics, dtype=np.float64)
        self.from_level = np.ascontiguousarray(level_rotation.T, dtype=np.float64)
        self.faces = np.ascontiguousarray(body.faces, np.int64)
        self.chosen = choose_vertices(body)
        self.front = np.asarray(body.normals[self.chosen, 2] > 0.0)
        self.around_joints = _chosen_around_joints(body, self.chosen)

    def place(self, body: Body, pose: np.ndarray, normals: np.ndarray | None = None) -> PlacedBody:
        """Place `body` in `pose` (P,), level frame.

        `normals` (V, 3) are those of its rest mesh; computing them takes longer than the rest.
        """
        return PlacedBody(self, body, pose, body.normals if normals is None else normals)


class PlacedBody:
    """One body in one pose, camera frame, metres; immutable.

    Attributes
    ----------
    body, placer : the placed body, and its camera
    vertices, normals : float64 (V, 3)
    rotations, origins, axes : placed joints float64 (18, 3, 3), (18, 3) and rotation axes (40, 3)
    """

    def __init__(self, placer: Placer, body: Body, pose: np.ndarray, normals: np.ndarray) -> None:
        self.placer, self.body = placer, body
        joints, dofs = len(skeleton.JOINTS), len(skeleton.DOF_JOINT)
        self.rotations, self.origins, self.axes = np.empty((joints, 3, 3)), np.empty((joints, 3)), np.empty((dofs, 3))
        self.vertices, self.normals = np.empty_like(body.vertices), np.empty_like(body.vertices)
        placing.place(
            pose, skeleton.PARENTS, body.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS, placer.from_level,
            body.vertices, normals, body.skin_joints, body.skin_weights,
            self.rotations, self.origins, self.axes, self.vertices, self.normals,
        )  # fmt: skip

    @cached_property
    def drawn(self) -> Drawn:
        """Return the depth image of the body alone."""
        placer = self.placer
        return Drawn(*placing.draw(self.vertices, placer.faces, placer.intrinsics, *placer.camera.shape))

    @cached_property
    def chosen_points(self) -> np.ndarray:
        """Return the chosen vertices: float64 (C, 3)."""
        return self.vertices.take(self.placer.chosen, axis=0)

    def visible(self, facing: float, tolerance: float, seen: np.ndarray, intrinsics: np.ndarray) -> np.ndarray:
        """Return which chosen vertices would be measured, bool (C,), given the `seen` image of a `Scene`.

        See `pairs.visible_vertices`.
        """
        out = np.empty(len(self.placer.chosen), dtype=np.bool_)
        pairs.visible_vertices(
            self.placer.chosen, self.vertices, self.normals, self.drawn.depth, self.drawn.intrinsics,
            seen, intrinsics, facing, tolerance, out,
        )  # fmt: skip
        return out


class NormalSystem:
    """Normal equations `matrix` (P, P), `vector` (P,) of one linearisation."""

    def __init__(self) -> None:
        joints, size = len(skeleton.JOINTS), skeleton.POSE_SIZE
        self.hessian = np.empty((joints, 6, 6))
        self.gradient = np.empty((joints, 6))
        self.matrix = np.empty((size, size))
        self.vector = np.empty(size)
        self.reference = np.empty(3)

    def reset(self, reference: np.ndarray) -> None:
        """Remove all pairs; twists are taken about `reference` (3,), near the body for good conditioning."""
        self.hessian[:] = 0.0
        self.gradient[:] = 0.0
        self.reference[:] = reference

    def assemble(self, placed: PlacedBody) -> None:
        """Assemble the pairs into `matrix` and `vector`."""
        twists.assemble(
            self.hessian, self.gradient, skeleton.PARENTS, skeleton.DOF_JOINT, placed.axes, placed.origins,
            self.reference, placed.placer.from_level, BELOW, self.matrix, self.vector,
        )  # fmt: skip
