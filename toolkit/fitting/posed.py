"""A body placed in front of the camera: skinned, drawn into a small z-buffer, ready for correspondences."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import BELOW, Body
from toolkit.fitting.balls import Balls
from toolkit.kernels import kinematics, linear, pairs, raster, twists
from toolkit.sensing.camera import Camera

QUOTAS: dict[str, int] = {
    "root": 22, "lumbar": 14, "thorax": 26, "cervical": 22,
    "clavicle": 8, "shoulder": 20, "elbow": 20, "wrist": 14,
    "hip": 26, "knee": 24, "ankle": 14,
}  # fmt: skip
"""Chosen vertices per body part: limbs get more than their share of the surface (Baak 2013, 5.4.1)."""


def spread_rows(points: np.ndarray, count: int) -> np.ndarray:
    """Rows of `points` (N, D) that lie as far apart as can be: farthest first, from the one farthest from the mean.

    Returns int64 (min(count, N),), in the order of choice.
    """
    nearest = np.linalg.norm(points - points.mean(axis=0), axis=1) if len(points) else np.empty(0)
    chosen: list[int] = []
    for _ in range(min(count, len(points))):
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen, dtype=np.int64)


def choose_vertices(body: Body) -> np.ndarray:
    """The subset `C_chi` of mesh vertices, spread over every body part by farthest-first choice (Baak 2013, Fig. 5.6a).

    Returns
    -------
    int64 (C,), ascending vertex indices; the end-effector vertices are always among them.
    """
    chosen = set(int(v) for v in body.end_effectors)
    for joint, name in enumerate(skeleton.JOINT_NAMES):
        members = np.flatnonzero(body.part == joint)
        quota = min(QUOTAS[name.split("_")[-1]], len(members))
        chosen.update(members[spread_rows(body.vertices[members], quota)].tolist())
    return np.array(sorted(chosen), dtype=np.int64)


def chosen_around_joints(body: Body, chosen: np.ndarray, count: int = 16) -> np.ndarray:
    """Weights (20, C) that average over the `count` chosen vertices nearest to each reported joint in the rest pose."""
    joints = body.joint_positions(np.zeros(skeleton.POSE_SIZE))
    distances = np.linalg.norm(joints[:, None] - body.vertices[chosen][None], axis=2)
    rows = np.argsort(distances, axis=1, kind="stable")[:, :count]
    weights = np.zeros(distances.shape)
    np.put_along_axis(weights, rows, 1.0 / count, axis=1)
    return weights


class PosedBody:
    """Everything that depends on one pose, in the camera frame, kept in arrays that are reused.

    Attributes
    ----------
    vertices, normals : float64 (V, 3), camera frame, metres
    balls : the body as balls
    rotations, origins, axes : placed joints and rotation axes, camera frame
    depth, triangle : float64 and int32 (h, w), the drawn body; 0 and -1 where it is not
    camera : the camera of that small image
    """

    def __init__(self, body: Body, camera: Camera, level_rotation: np.ndarray) -> None:
        self.camera = camera
        self.intrinsics = np.array(camera.intrinsics, dtype=np.float64)
        self.from_level = np.ascontiguousarray(level_rotation.T, dtype=np.float64)
        joints, dofs = len(skeleton.JOINTS), len(skeleton.DOF_JOINT)
        self._vectors = np.empty((joints, 3))
        self._level = (np.empty((joints, 3, 3)), np.empty((joints, 3)), np.empty((dofs, 3)))
        self.rotations = np.empty((joints, 3, 3))
        self.origins = np.empty((joints, 3))
        self.axes = np.empty((dofs, 3))
        self._inverse_depth = np.empty((camera.height, camera.width))
        self.depth = np.empty((camera.height, camera.width))
        self.triangle = np.empty((camera.height, camera.width), dtype=np.int32)
        self.faces = body.faces.astype(np.int64)
        self.chosen = choose_vertices(body)
        self.around_joints = chosen_around_joints(body, self.chosen)
        self.set_body(body)

    def set_body(self, body: Body) -> None:
        """Exchange the body for another of the same topology; the pose has to be placed again."""
        self.body = body
        self.balls = Balls.of_body(body)
        self.rest_normals = body.normals
        self.vertices = np.empty_like(body.vertices)
        self.normals = np.empty_like(body.vertices)
        self._projected = np.empty_like(body.vertices)
        self.visible = np.empty(len(self.chosen), dtype=np.bool_)

    def place(self, pose: np.ndarray) -> None:
        """Forward kinematics and skinning of `pose` (P,), level frame, into the camera frame."""
        rotations, origins, axes = self._level
        body = self.body
        kinematics.forward_kinematics(
            pose,
            skeleton.PARENTS,
            body.joints,
            skeleton.DOF_JOINT,
            skeleton.DOF_AXIS,
            self._vectors,
            rotations,
            origins,
        )
        kinematics.world_axes(skeleton.PARENTS, self._vectors, rotations, skeleton.DOF_JOINT, skeleton.DOF_AXIS, axes)
        pairs.to_camera(self.from_level, rotations, origins, axes, self.rotations, self.origins, self.axes)
        kinematics.skin(
            body.vertices, body.skin_joints, body.skin_weights, body.joints, self.rotations, self.origins, self.vertices
        )
        pairs.skin_normals(self.rest_normals, body.skin_joints, body.skin_weights, self.rotations, self.normals)

    def draw(self) -> None:
        """Draw the placed body into the small z-buffer."""
        raster.project(self.vertices, self.intrinsics, self._projected)
        raster.rasterise(self._projected, self.faces, self._inverse_depth, self.triangle)
        pairs.depth_from_inverse(self._inverse_depth, self.depth)

    def find_visible(self, facing: float, tolerance: float) -> np.ndarray:
        """Which chosen vertices the camera sees, bool (C,); see `pairs.visible_vertices`. Needs `draw` first."""
        pairs.visible_vertices(
            self.chosen, self.vertices, self.normals, self.depth, self.intrinsics, facing, tolerance, self.visible
        )
        return self.visible

    def end_effectors_level(self) -> np.ndarray:
        """End-effector vertices of the placed pose: float64 (5, 3), level frame."""
        return linear.rotated(self.vertices[self.body.end_effectors], self.from_level)


class NormalSystem:
    """The normal equations `matrix` (P, P), `vector` (P,) of one linearisation."""

    def __init__(self) -> None:
        joints, size = len(skeleton.JOINTS), skeleton.POSE_SIZE
        self.hessian = np.empty((joints, 6, 6))
        self.gradient = np.empty((joints, 6))
        self.matrix = np.empty((size, size))
        self.vector = np.empty(size)
        self.reference = np.empty(3)

    def reset(self, reference: np.ndarray) -> None:
        """Forget all pairs; twists are taken about `reference` (3,), near the body for the conditioning."""
        self.hessian[:] = 0.0
        self.gradient[:] = 0.0
        self.reference[:] = reference

    def assemble(self, posed: PosedBody) -> None:
        """Turn the gathered pairs into `matrix` and `vector`."""
        twists.assemble(
            self.hessian, self.gradient, skeleton.PARENTS, skeleton.DOF_JOINT, posed.axes, posed.origins,
            self.reference, posed.from_level, BELOW, self.matrix, self.vector,
        )  # fmt: skip
