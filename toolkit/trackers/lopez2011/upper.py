"""Upper body model of the particle filter: trunk, head and two arms, no legs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.fitting.placed import balls_of
from toolkit.fitting.terms import SOFT
from toolkit.kernels import linear
from toolkit.kernels.fit.aiming import Aim, ArmRig, aim_arms
from toolkit.kernels.fit.particles import Contacts
from toolkit.kernels.fit.swarm import Figure
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
    body : the whole body
    from_level : R_camera_level, float64 (3, 3)
    figure : drawn model: the mesh of trunk and head, and the balls of both arms
    contacts : balls of the upper body that must not overlap
    arms : left and right
    """

    body: Body
    from_level: np.ndarray
    figure: Figure
    contacts: Contacts
    arms: tuple[ArmRig, ArmRig]

    def camera_joints(self, pose: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the reported joints `rows` (K,) of a pose (P,): float64 (K, 3), camera frame, metres."""
        return linear.rotated(self.body.joint_positions(pose)[rows], self.from_level.T)

    def arm_joints(self, side: int, pose: np.ndarray) -> np.ndarray:
        """Return shoulder, elbow, wrist and hand of one arm of a pose (P,): float64 (4, 3), camera frame, metres."""
        names = [f"{skeleton.SIDES[side]}_{name}" for name in ("shoulder", "elbow", "wrist", "hand")]
        return self.camera_joints(pose, np.array([skeleton.REPORTED.index(name) for name in names]))


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
        legs, trunk = ([skeleton.JOINT_NAMES.index(name) for name in names] for names in (skeleton.LEGS, TRUNK))
        drawn = np.isin(body.part, trunk)
        used, faces = np.unique(body.faces[drawn[body.faces].all(axis=1)], return_inverse=True)
        balls = balls_of(body)
        arm = ~np.isin(balls.joint, legs + trunk)
        left, right = (arm_of(side, body) for side in skeleton.SIDES)
        figure = Figure(
            skeleton.PARENTS, skeleton.DOF_JOINT, skeleton.DOF_AXIS, body.joints,
            balls.joint[arm], balls.offset[arm], balls.radius[arm],
            body.vertices[used], body.skin_joints[used], body.skin_weights[used],
            faces.reshape(-1, 3).astype(np.int64),
        )  # fmt: skip
        pairs = balls.apart[~np.isin(balls.joint[balls.apart], legs).any(axis=1)]
        overlap_weight = 10.0  # weight of squared overlaps in units of the ball radii (`lambda_3`)
        contacts = Contacts(balls.joint, balls.offset, balls.radius, pairs, SOFT, overlap_weight)
        return UpperBody(body, self._from_level, figure, contacts, (left, right))


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
