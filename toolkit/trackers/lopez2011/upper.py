"""Upper body model of the particle filter: trunk, head and two arms, no legs."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.placed import balls_of
from toolkit.kernels.fit.aiming import Aim, ArmRig, aim_arms
from toolkit.kernels.fit.particles import Rig
from toolkit.kernels.fit.swivel import ArmBones

TRUNK = ("root", "lumbar", "thorax", "cervical", "left_clavicle", "right_clavicle")
"""Joints of trunk and head."""
UNSEEN: np.ndarray = np.array(
    [i for i, name in enumerate(skeleton.REPORTED) if any(part in name for part in ("hip", "knee", "ankle", "foot"))]
)
"""Indices of the reported joints of the legs."""


@dataclass(frozen=True, eq=False)
class UpperBody:
    """One body without legs, for cameras with a common level frame.

    Attributes
    ----------
    body : whose
    whole, trunk : drawn meshes with and without arms
    arms : left and right
    of_arm : indices of the rig's balls for each arm
    apart : pairs of balls (K, 2) that a pose can bring together
    """

    body: Body
    whole: Rig
    trunk: Rig
    arms: tuple[ArmRig, ArmRig]
    of_arm: tuple[np.ndarray, np.ndarray]
    apart: np.ndarray


class UpperBodies:
    """Cache of upper bodies for one camera.

    Parameters
    ----------
    level_rotation : R_level_camera, float64 (3, 3)
    """

    def __init__(self, level_rotation: np.ndarray) -> None:
        self._from_level = np.ascontiguousarray(level_rotation.T, dtype=np.float64)
        self.of = lru_cache(maxsize=8)(self._of)

    def _of(self, body: Body) -> UpperBody:
        """Return the upper body of `body`."""
        legs = {skeleton.JOINT_NAMES.index(name) for name in skeleton.LEGS}
        trunk = {skeleton.JOINT_NAMES.index(name) for name in TRUNK}
        upper = set(range(len(skeleton.JOINT_NAMES))) - legs
        whole = _rig_of(body, upper, self._from_level)
        balls = balls_of(body)
        rows = np.flatnonzero(~np.isin(balls.joint, sorted(legs)))
        place = np.full(len(balls.joint), -1)
        place[rows] = np.arange(len(rows))
        apart = place[balls.apart]
        arms = [[skeleton.JOINT_NAMES.index(name) for name in arm] for arm in skeleton.ARMS]
        of_arm = tuple(np.flatnonzero(np.isin(whole.ball_joint, arm)) for arm in arms)
        left, right = (arm_of(side, body) for side in skeleton.SIDES)
        return UpperBody(
            body=body,
            whole=whole,
            trunk=_rig_of(body, trunk, self._from_level),
            arms=(left, right),
            of_arm=(of_arm[0], of_arm[1]),
            apart=apart[(apart >= 0).all(axis=1)],
        )


def _rig_of(body: Body, joints: Collection[int], from_level: np.ndarray) -> Rig:
    """Return the drawn part of a body with most skinning weight on `joints`, and the balls of the upper body."""
    drawn = np.isin(body.part, sorted(joints))
    faces = body.faces[drawn[body.faces].all(axis=1)]
    used, compact = np.unique(faces, return_inverse=True)
    balls = balls_of(body)
    upper = ~np.isin(balls.joint, [skeleton.JOINT_NAMES.index(name) for name in skeleton.LEGS])
    return Rig(
        parents=skeleton.PARENTS,
        rest=body.joints,
        dof_joint=skeleton.DOF_JOINT,
        dof_axis=skeleton.DOF_AXIS,
        vertices=np.ascontiguousarray(body.vertices[used]),
        skin_joints=np.ascontiguousarray(body.skin_joints[used]),
        skin_weights=np.ascontiguousarray(body.skin_weights[used]),
        faces=compact.reshape(faces.shape).astype(np.int64),
        ball_joint=balls.joint[upper],
        ball_offset=np.ascontiguousarray(balls.offset[upper]),
        radii=balls.radius[upper],
        from_level=from_level,
    )


def arm_of(side: str, body: Body) -> ArmRig:
    """Return one arm of a body for inverse kinematics."""
    clavicle, shoulder, elbow, wrist = (
        skeleton.JOINT_NAMES.index(name) for name in skeleton.ARMS[skeleton.SIDES.index(side)]
    )
    shoulder_entry = skeleton.POSE_NAMES.index(f"{side}_shoulder_rx")
    elbow_entry = skeleton.POSE_NAMES.index(f"{side}_elbow_ry")
    tip = body.vertices[body.end_effectors[skeleton.END_EFFECTORS.index(f"{side}_hand")]]
    limits = skeleton.POSE_LIMITS
    hand_fraction = 0.85  # position of an extremum on the way from wrist to fingertip
    return ArmRig(
        parents=skeleton.PARENTS,
        rest=body.joints,
        dof_joint=skeleton.DOF_JOINT,
        dof_axis=skeleton.DOF_AXIS,
        clavicle=clavicle,
        shoulder=shoulder,
        elbow=elbow,
        wrist=wrist,
        shoulder_entry=shoulder_entry,
        elbow_entry=elbow_entry,
        bones=ArmBones(
            body.joints[elbow] - body.joints[shoulder],
            np.ascontiguousarray(limits[shoulder_entry : shoulder_entry + 3]),
            np.ascontiguousarray(limits[elbow_entry]),
        ),
        fore=body.joints[wrist] - body.joints[elbow],
        hand=hand_fraction * (tip - body.joints[wrist]),
    )


def aimed_all_round(pose: np.ndarray, arm: ArmRig, target: np.ndarray, swivels: int, aim: Aim) -> np.ndarray:
    """Return poses (n, P) with one arm of a pose (P,) at a target (1, 3), at even swivels within the joint limits."""
    around = np.linspace(-np.pi, np.pi, swivels, endpoint=False)
    poses, scores = np.repeat(pose[None], swivels, axis=0), np.empty(swivels)
    aim_arms(poses, arm, np.ones(swivels, dtype=np.bool_), np.repeat(target, swivels, axis=0), around, aim, scores)
    return poses[np.isfinite(scores)]
