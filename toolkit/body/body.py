"""Skinned body mesh on the kinematic chain (Baak 2013, 5.3.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated

import numpy as np

from toolkit.body import skeleton
from toolkit.io.archives import Column
from toolkit.io.errors import BodyError
from toolkit.io.typed_values import Range
from toolkit.kernels import kinematics

BONE_AXIS: dict[str, int] = {
    "root": 0, "lumbar": 1, "thorax": 1, "cervical": 1, "clavicle": 0, "shoulder": 0, "elbow": 0, "wrist": 0,
    "hip": 1, "knee": 1, "ankle": 2,
}  # fmt: skip
"""Axis (0 = x, 1 = y, 2 = z) of the bone below each joint in the rest pose; below the root it is the hips' width."""


@dataclass(frozen=True)
class PlacedJoints:
    """Joints of a pose: rotation vectors (J, 3), rotations (J, 3, 3) and origins (J, 3), metres."""

    vectors: np.ndarray
    rotations: np.ndarray
    origins: np.ndarray


@dataclass(frozen=True, eq=False)
class Body:
    """Closed mesh in the T-pose with its skinning, in the body frame (metres, y up, facing +z), root at the origin.

    Attributes
    ----------
    name : name in reports
    vertices : float64 (V, 3), rest positions
    faces : int32 (F, 3), counter-clockwise seen from outside
    skin_joints, skin_weights : int64 and float64 (V, S), S at most 4; weights of a row sum to 1
    joints : float64 (18, 3), rest positions of the articulated joints, root at the origin
    sites : float64 (5, 3), rest positions of `skeleton.SITES`
    end_effectors : int64 (5,), mesh vertices at the tips, ordered as `skeleton.END_EFFECTORS`
    shape : float64 (K,), coefficients of its shape space (empty for a body of another source)
    scale : uniform factor already contained in the positions
    offsets : float64 (V,), metres before scaling, displacements of the vertices along the normals; None for none
    """

    CHECKPOINT = ("name", "shape", "scale", "offsets")
    name: str
    vertices: np.ndarray
    faces: np.ndarray
    skin_joints: np.ndarray
    skin_weights: np.ndarray
    joints: np.ndarray
    sites: np.ndarray
    end_effectors: np.ndarray
    shape: Annotated[np.ndarray, Column("f", ("coefficients",), -100, 100)]
    scale: Annotated[float, Range(0.01, 100)] = 1.0
    offsets: Annotated[np.ndarray, Column("f", ("vertices",), -0.1, 0.1)] | None = None

    def __post_init__(self) -> None:
        if self.joints.shape != (len(skeleton.JOINTS), 3) or self.sites.shape != (len(skeleton.SITES), 3):
            raise BodyError(
                f"body {self.name!r} has joints {self.joints.shape} and sites {self.sites.shape}; "
                f"expected ({len(skeleton.JOINTS)}, 3) and ({len(skeleton.SITES)}, 3)"
            )
        if not (np.abs(self.skin_weights.sum(axis=1) - 1.0) <= 2e-5).all():
            raise BodyError(f"skinning weights of body {self.name!r} do not sum to 1; normalise them per vertex")

    @classmethod
    def of_checkpoint(cls, name: str, shape: np.ndarray, scale: float, offsets: np.ndarray | None) -> Body:
        """Return a body of the shape space, see `toolkit.io.checkpoint`; raises BodyError for other values."""
        from toolkit.body.shape import ShapeSpace

        return ShapeSpace.load().body(shape, scale=scale, name=name, offsets=offsets)

    @cached_property
    def part(self) -> np.ndarray:
        """Joint with the largest weight at each vertex, int64 (V,)."""
        return self.skin_joints[np.arange(len(self.vertices)), self.skin_weights.argmax(axis=1)]

    @cached_property
    def normals(self) -> np.ndarray:
        """Outward unit normals of the rest mesh, float64 (V, 3), area-weighted over the faces at a vertex."""
        return vertex_normals(self.vertices, self.faces)

    @cached_property
    def height(self) -> float:
        """Extent of the mesh along y in the rest pose, metres."""
        return float(np.ptp(self.vertices[:, 1]))

    def scaled(self, factor: float) -> Body:
        """Return the body, uniformly scaled by `factor` (> 0)."""
        if not factor > 0:
            raise BodyError(f"a body cannot be scaled by {factor}; use a positive factor")
        return replace(
            self,
            vertices=self.vertices * factor,
            joints=self.joints * factor,
            sites=self.sites * factor,
            scale=self.scale * factor,
        )

    def place(self, pose: np.ndarray) -> PlacedJoints:
        """Compute the forward kinematics of one pose (P,)."""
        pose = np.array(skeleton.check_pose(pose))  # one memory layout, so that numba compiles one kernel
        count = len(skeleton.JOINTS)
        placed = PlacedJoints(np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 3)))
        kinematics.forward_kinematics(
            pose, skeleton.PARENTS, self.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS,
            placed.vectors, placed.rotations, placed.origins,
        )  # fmt: skip
        return placed

    def vertex_positions(self, pose: np.ndarray) -> np.ndarray:
        """Return the skinned mesh (`M_chi`) of one pose: float64 (V, 3), metres, in the frame of the pose's root."""
        placed = self.place(pose)
        out = np.empty_like(self.vertices)
        kinematics.skin(
            self.vertices, self.skin_joints, self.skin_weights, self.joints, placed.rotations, placed.origins, out
        )
        return out

    def joint_positions(self, poses: np.ndarray) -> np.ndarray:
        """Return the 20 reported joints (`P_chi`) of poses (..., P): float64 (..., 20, 3), metres."""
        return self.key_points(poses)[0]

    def end_effector_positions(self, poses: np.ndarray) -> np.ndarray:
        """Return the five end-effector vertices (`E_chi^5`) of poses (..., P): float64 (..., 5, 3), metres."""
        return self.key_points(poses)[1]

    @cached_property
    def _carried(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sites and end effectors: rest positions (10, 3), skinning joints (10, S) and weights (10, S)."""
        tips = self.end_effectors
        joints = np.zeros((len(self.sites), self.skin_joints.shape[1]), dtype=np.int64)
        joints[:, 0] = skeleton.SITE_PARENTS
        weights = np.zeros(joints.shape)
        weights[:, 0] = 1.0
        return (
            np.concatenate([self.sites, self.vertices[tips]]),
            np.concatenate([joints, self.skin_joints[tips]]),
            np.concatenate([weights, self.skin_weights[tips]]),
        )

    def key_points(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the results of `joint_positions` and `end_effector_positions`."""
        poses = skeleton.check_pose(poses)
        flat = np.ascontiguousarray(poses.reshape(-1, skeleton.POSE_SIZE))
        joints = np.empty((len(flat), len(skeleton.JOINTS), 3))
        moved = np.empty((len(flat), len(self._carried[0]), 3))
        reported = np.empty((len(flat), len(skeleton.REPORTED), 3))
        kinematics.key_points(
            flat, skeleton.PARENTS, self.joints, skeleton.DOF_JOINT, skeleton.DOF_AXIS, *self._carried,
            skeleton.REPORTED_FROM_POINTS, joints, moved, reported,
        )  # fmt: skip
        lead = poses.shape[:-1]
        return reported.reshape(*lead, -1, 3), moved[:, len(self.sites) :].reshape(*lead, -1, 3)


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the outward unit normals (V, 3) of a mesh, area-weighted over the faces at a vertex."""
    first, second, third = (vertices[faces[:, corner]].T for corner in range(3))
    a, b = second - first, third - first
    areas = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    at = faces.T.ravel()
    normals = np.stack([np.bincount(at, np.tile(area, 3), len(vertices)) for area in areas], axis=1)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def _below() -> np.ndarray:
    below = np.eye(len(skeleton.JOINTS), dtype=np.bool_)
    for j, parent in enumerate(skeleton.PARENTS):
        if parent >= 0:
            below[:, j] |= below[:, parent]
    return below


BELOW: np.ndarray = _below()
"""Bool (18, 18): `BELOW[i, j]` is True if joint j is joint i or one of its descendants."""
