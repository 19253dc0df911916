"""Joint angles of the International Society of Biomechanics (Wu 2002: hip, knee, ankle; Wu 2005: trunk, shoulder,
elbow).

Every segment has the axes X forwards, Y up, Z to the subject's right in the neutral pose (standing, arms hanging, palms
to the thighs). The angles are Cardan or Euler angles of the distal segment's rotation relative to the proximal one. The
left side is mirrored first, so that both sides have the same signs (Wu 2005, 2.3). Angles are in degrees.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body

ISB_AXES: np.ndarray = np.column_stack([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""X, Y, Z of the ISB as columns in the body frame (left, up, front)."""
SAGITTAL: np.ndarray = np.diag([1.0, 1.0, -1.0])
"""Mirror at the sagittal plane, ISB axes."""
GIMBAL_LOCK = np.radians(8.0)
"""Radians from a sequence's singular pose within which the first and the third angle are not separable."""


class JointAngles(NamedTuple):
    """Rotation sequence of one joint.

    Attributes
    ----------
    joint : prefix of the column names
    parent, child : segments, by the joints of the skeleton that rotate them; parent "" is the ground
    sequence : axes of the rotations, "ZXY" or "YXY"
    motions : names of the angles; "" for one that the kinematic chain does not have
    signs : +1 or -1, factors from a right-handed rotation of the right side to the named motion
    """

    joint: str
    parent: str
    child: str
    sequence: str
    motions: tuple[str, str, str]
    signs: tuple[float, float, float] = (1.0, 1.0, 1.0)


def _limbs(side: str) -> tuple[JointAngles, ...]:
    return (
        JointAngles(
            f"{side}_hip", "root", f"{side}_hip", "ZXY", ("flexion", "adduction", "internal_rotation"),
        ),
        JointAngles(f"{side}_knee", f"{side}_hip", f"{side}_knee", "ZXY", ("flexion", "", ""), (-1.0, 1.0, 1.0)),
        JointAngles(
            f"{side}_ankle", f"{side}_knee", f"{side}_ankle", "ZXY",
            ("dorsiflexion", "inversion", "internal_rotation"),
        ),
        JointAngles(
            f"{side}_shoulder", "thorax", f"{side}_shoulder", "YXY",
            ("plane_of_elevation", "elevation", "internal_rotation"), (1.0, -1.0, 1.0),
        ),
        JointAngles(f"{side}_elbow", f"{side}_shoulder", f"{side}_elbow", "ZXY", ("flexion", "", "")),
    )  # fmt: skip


TRUNK = ("flexion", "lateral_bending_right", "rotation_left")
JOINTS: tuple[JointAngles, ...] = (
    JointAngles("pelvis", "", "root", "ZXY", ("backward_tilt", "right_obliquity", "rotation_left")),
    JointAngles("trunk", "root", "thorax", "ZXY", TRUNK, (-1.0, 1.0, 1.0)),
    JointAngles("thorax", "", "thorax", "ZXY", TRUNK, (-1.0, 1.0, 1.0)),
    *_limbs("left"),
    *_limbs("right"),
)
"""Joints with angles. Pelvis and thorax rotate in the ground frame (X towards the camera), the trunk is the thorax in
the pelvis."""

COLUMNS: tuple[str, ...] = tuple(
    f"{joint.joint}_{motion}_{joint.sequence}_deg" for joint in JOINTS for motion in joint.motions if motion
)
"""Names of the angles, each with its rotation sequence."""


class Angles(NamedTuple):
    """Angles of T frames.

    Attributes
    ----------
    degrees : float64 (T, len(COLUMNS)), continuous over time, NaN in frames without a person
    locked : bool (T, len(JOINTS)), frames near a singular pose, in which only the sum of the first and third angle is
        known; the first is then interpolated between neighbouring frames
    """

    degrees: np.ndarray
    locked: np.ndarray

    def of(self, name: str) -> np.ndarray:
        """Return one angle (T,) by its column name, with or without sequence and unit."""
        matches = [i for i, column in enumerate(COLUMNS) if column == name or column.rsplit("_", 2)[0] == name]
        return self.degrees[:, matches[0]]


def joint_angles(body: Body, poses: np.ndarray, known: np.ndarray) -> Angles:
    """Return the angles of poses (T, P) in a y-up frame; `known` is bool (T,)."""
    rotations = segment_rotations(body, poses)
    degrees, locked = np.full((len(poses), len(COLUMNS)), np.nan), np.zeros((len(poses), len(JOINTS)), dtype=bool)
    first = 0
    for number, joint in enumerate(JOINTS):
        child = rotations[joint.child]
        relative = child if not joint.parent else rotations[joint.parent].transpose(0, 2, 1) @ child
        if joint.joint.startswith("left_"):
            relative = SAGITTAL @ relative @ SAGITTAL
        angles, singular = sequence_angles(relative, joint.sequence, known)
        named = [i for i, motion in enumerate(joint.motions) if motion]
        degrees[:, first : first + len(named)] = np.degrees(angles * joint.signs)[:, named]
        locked[:, number] = singular
        first += len(named)
    return Angles(degrees, locked)


def segment_rotations(body: Body, poses: np.ndarray) -> dict[str, np.ndarray]:
    """Return the ISB axes of every segment: joint of the skeleton -> float64 (T, 3, 3), columns X, Y, Z."""
    placed = np.array([body.place(pose).rotations for pose in poses]).reshape(-1, len(skeleton.JOINTS), 3, 3)
    found = {}
    for j, name in enumerate(skeleton.JOINT_NAMES):
        found[name] = ISB_AXES.T @ placed[:, j] @ _hanging(name) @ ISB_AXES
    return found


def _hanging(joint: str) -> np.ndarray:
    """Return the rotation (3, 3) from the neutral pose with hanging arms to the T-pose of the skeleton."""
    if not joint.endswith(("shoulder", "elbow", "wrist")):
        return np.eye(3)
    s = 1.0 if joint.startswith("left_") else -1.0
    return np.array([[0.0, -s, 0.0], [s, 0.0, 0.0], [0.0, 0.0, 1.0]])


def sequence_angles(rotations: np.ndarray, sequence: str, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles float64 (T, 3), radians, of rotations (T, 3, 3) = first @ second @ third, and a locked mask.

    Of the two equivalent triples, the one with the second angle in its usual range is returned (-90 to 90 degrees for
    ZXY, -180 to 0 for YXY). The other angles are continuous over the known frames; the rest is NaN.
    """
    rows, out = np.flatnonzero(known), np.full((len(rotations), 3), np.nan)
    locked = np.zeros(len(rotations), dtype=bool)
    if not len(rows):
        return out, locked
    turned = rotations[rows]
    first, near = (_first_of_zxy if sequence == "ZXY" else _first_of_yxy)(turned)
    locked[rows] = near
    first = _held(first, near, rows)
    axis = 2 if sequence == "ZXY" else 1
    rest = _about(axis, -first) @ turned  # = second about X, third about Y
    second = np.arctan2(rest[:, 2, 1], rest[:, 1, 1])
    third = np.unwrap(np.arctan2(rest[:, 0, 2], rest[:, 0, 0]))
    out[rows] = np.column_stack([first, second, third])
    return out, locked


def _first_of_zxy(turned: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.arctan2(-turned[:, 0, 1], turned[:, 1, 1]), np.abs(turned[:, 2, 1]) > np.cos(GIMBAL_LOCK)


def _first_of_yxy(turned: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.arctan2(-turned[:, 0, 1], -turned[:, 2, 1]), np.abs(turned[:, 1, 1]) > np.cos(GIMBAL_LOCK)


def _held(angle: np.ndarray, near: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the angle without jumps, interpolated in time where it is locked."""
    if near.all():
        return np.zeros(len(angle))
    sure = np.flatnonzero(~near)
    return np.interp(rows, rows[sure], np.unwrap(angle[sure]))


def _about(axis: int, angle: np.ndarray) -> np.ndarray:
    """Return the rotations (T, 3, 3) about one coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.zeros((len(angle), 3, 3))
    out[:, axis, axis] = 1.0
    out[:, i, i] = out[:, j, j] = np.cos(angle)
    out[:, i, j], out[:, j, i] = -np.sin(angle), np.sin(angle)
    return out
