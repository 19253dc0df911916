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
from toolkit.tracks.runs import Person

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
        relative = relative_rotations(rotations, joint.parent, joint.child, left=joint.joint.startswith("left_"))
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


def relative_rotations(rotations: dict[str, np.ndarray], parent: str, child: str, *, left: bool) -> np.ndarray:
    """Return the rotations (T, 3, 3) of a segment in its parent ("": the ground), mirrored for the left side."""
    relative = rotations[child] if not parent else rotations[parent].transpose(0, 2, 1) @ rotations[child]
    return SAGITTAL @ relative @ SAGITTAL if left else relative


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
    from scipy.spatial.transform import Rotation

    rows, out = np.flatnonzero(known), np.full((len(rotations), 3), np.nan)
    locked = np.zeros(len(rotations), dtype=bool)
    if not len(rows):
        return out, locked
    turned = rotations[rows]
    if sequence == "ZXY":
        first, locking, axis = np.arctan2(-turned[:, 0, 1], turned[:, 1, 1]), turned[:, 2, 1], 2
    else:
        first, locking, axis = np.arctan2(-turned[:, 0, 1], -turned[:, 2, 1]), turned[:, 1, 1], 1
    near = np.abs(locking) > np.cos(GIMBAL_LOCK)
    locked[rows] = near
    first = np.zeros(len(rows)) if near.all() else np.interp(rows, rows[~near], np.unwrap(first[~near]))
    # What is left is the second angle about X and the third about Y.
    rest = Rotation.from_rotvec(-first[:, None] * np.eye(3)[axis]).as_matrix() @ turned
    second = np.arctan2(rest[:, 2, 1], rest[:, 1, 1])
    third = np.unwrap(np.arctan2(rest[:, 0, 2], rest[:, 0, 0]))
    out[rows] = np.column_stack([first, second, third])
    return out, locked


def coordinates(person: Person, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Compute the coordinates of OpenSim's generic full-body model (Rajagopal 2016).

    `rows` (N,) are frames of the person. The result is name -> float64 (N,), degrees or metres.
    """
    poses = person.track.pose[rows]
    turned, known = segment_rotations(person.body, poses), np.ones(len(rows), dtype=bool)

    def angles(parent: str, child: str, *, left: bool = False) -> np.ndarray:
        relative = relative_rotations(turned, parent, child, left=left)
        return np.degrees(sequence_angles(relative, "ZXY", known)[0])

    pelvis = angles("", "root")
    hips = poses[:, skeleton.ROOT_POSITION] @ ISB_AXES
    generic_stature = 1.70  # metres, of that model (Rajagopal 2016)
    # Metres, ISB axes: from the origin of the generic model's pelvis (between its spines) to the middle of its hips.
    pelvis_to_hips = np.array([-0.0563, -0.0786, 0.0])
    place = hips - turned["root"] @ pelvis_to_hips * person.body.height / generic_stature
    found = dict(zip(("pelvis_tilt", "pelvis_list", "pelvis_rotation"), pelvis.T, strict=True))
    found |= dict(zip(("pelvis_tx", "pelvis_ty", "pelvis_tz"), place.T, strict=True))
    for side in ("right", "left"):
        s, left = side[0], side == "left"
        hip, shoulder = angles("root", f"{side}_hip", left=left), angles("thorax", f"{side}_shoulder", left=left)
        ankle = angles(f"{side}_knee", f"{side}_ankle", left=left)
        found |= dict(zip((f"hip_flexion_{s}", f"hip_adduction_{s}", f"hip_rotation_{s}"), hip.T, strict=True))
        found[f"knee_angle_{s}"] = -angles(f"{side}_hip", f"{side}_knee", left=left)[:, 0]
        found |= dict(zip((f"ankle_angle_{s}", f"subtalar_angle_{s}"), ankle[:, :2].T, strict=True))
        found |= dict(zip((f"arm_flex_{s}", f"arm_add_{s}", f"arm_rot_{s}"), shoulder.T, strict=True))
        found[f"elbow_flex_{s}"] = angles(f"{side}_shoulder", f"{side}_elbow", left=left)[:, 0]
    found |= dict(
        zip(("lumbar_extension", "lumbar_bending", "lumbar_rotation"), angles("root", "thorax").T, strict=True)
    )
    return found
