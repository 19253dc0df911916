"""Kinematic chain: joints, their free axes and limits, and the names of the pose vector.

Every joint frame is aligned with the body frame in the rest pose (a T-pose: y up, facing +z, the subject's left at +x).
A joint's rotation is `exp(w)` with exponential coordinates `w` along the joint's free axes: a hinge has one, a wrist
two (a pure swing), a ball joint three (Baak 2013, 5.3.2; thesis 6.2.1).
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import BodyError


@dataclass(frozen=True)
class Joint:
    """Articulated joint with its parent, its free axes in the rest pose and their limits in radians."""

    name: str
    parent: str | None
    limits: dict[str, tuple[float, float]]


def _side(side: str) -> tuple[Joint, ...]:
    """Return arm and leg of one side. In the T-pose an arm points along +x (left) or -x (right)."""
    s = 1.0 if side == "left" else -1.0

    def span(low: float, high: float) -> tuple[float, float]:
        return (low, high) if s > 0 else (-high, -low)

    flexion = 2.6  # rad: elbow and knee flexion, Qammaz, Table 1, rounded up to 150 degrees
    return (
        Joint(f"{side}_clavicle", "thorax", {"y": span(-0.5, 0.3), "z": span(-0.25, 0.7)}),
        Joint(f"{side}_shoulder", f"{side}_clavicle", {"x": (-2.2, 2.2), "y": span(-2.4, 1.2), "z": span(-2.0, 1.6)}),
        Joint(f"{side}_elbow", f"{side}_shoulder", {"y": span(-flexion, 0.05)}),
        Joint(f"{side}_wrist", f"{side}_elbow", {"y": span(-0.9, 0.9), "z": span(-1.3, 1.3)}),
        Joint(f"{side}_hip", "root", {"x": (-2.4, 0.9), "y": (-1.0, 1.0), "z": span(-0.7, 1.2)}),
        Joint(f"{side}_knee", f"{side}_hip", {"x": (-0.05, flexion)}),
        Joint(f"{side}_ankle", f"{side}_knee", {"x": (-0.8, 1.0), "z": (-0.6, 0.6)}),
    )


JOINTS: tuple[Joint, ...] = (
    Joint("root", None, {}),
    Joint("lumbar", "root", {"x": (-0.5, 1.0), "y": (-0.6, 0.6), "z": (-0.5, 0.5)}),
    Joint("thorax", "lumbar", {"x": (-0.4, 0.7), "y": (-0.6, 0.6), "z": (-0.5, 0.5)}),
    Joint("cervical", "thorax", {"x": (-0.9, 1.0), "y": (-1.2, 1.2), "z": (-0.7, 0.7)}),
    *_side("left"),
    *_side("right"),
)
"""The 18 articulated joints, parents before children; only the root is unconstrained."""

JOINT_NAMES: tuple[str, ...] = tuple(joint.name for joint in JOINTS)
SIDES = ("left", "right")
LEGS = tuple(f"{side}_{name}" for side in SIDES for name in ("hip", "knee", "ankle"))
ARMS = tuple(tuple(f"{side}_{name}" for name in ("clavicle", "shoulder", "elbow", "wrist")) for side in SIDES)
"""Joints of the left and the right arm."""
PARENTS: np.ndarray = np.array([JOINT_NAMES.index(j.parent) if j.parent else -1 for j in JOINTS], dtype=np.int64)

ROOT_POSITION = slice(0, 3)
"""Entries of a pose vector with the root's position (metres)."""
ROOT_ROTATION = slice(3, 6)
"""Entries of a pose vector with the root's orientation (exponential coordinates, radians)."""

POSE_NAMES: tuple[str, ...] = (
    *(f"root_t{axis}" for axis in "xyz"),
    *(f"root_r{axis}" for axis in "xyz"),
    *(f"{joint.name}_r{axis}" for joint in JOINTS for axis in joint.limits),
)
"""Names of the P = 43 entries of a pose vector (`chi` in Baak 2013)."""
POSE_SIZE = len(POSE_NAMES)

DOF_JOINT: np.ndarray = np.array(
    [0, 0, 0] + [i for i, joint in enumerate(JOINTS) for _ in joint.limits], dtype=np.int64
)
"""Joint of each rotational entry `pose[3:]`, int64 (40,)."""
DOF_AXIS: np.ndarray = np.array([0, 1, 2] + ["xyz".index(a) for joint in JOINTS for a in joint.limits], dtype=np.int64)
"""Axis (0, 1, 2) of each rotational entry `pose[3:]`, int64 (40,)."""

ARM_ENTRIES: tuple[np.ndarray, ...] = tuple(
    3 + np.flatnonzero(np.isin(DOF_JOINT, [JOINT_NAMES.index(name) for name in arm])) for arm in ARMS
)
"""Entries of a pose vector with the angles of the left and the right arm, int64 (D,) each."""
POSE_LIMITS: np.ndarray = np.array(
    [(-np.inf, np.inf)] * 6 + [joint.limits[a] for joint in JOINTS for a in joint.limits], dtype=np.float64
)
"""Lowest and highest admissible value of every pose entry, float64 (P, 2), radians; the root is unlimited."""

SITES: tuple[tuple[str, str], ...] = (
    ("head", "cervical"),
    ("left_hand", "left_wrist"),
    ("right_hand", "right_wrist"),
    ("left_foot", "left_ankle"),
    ("right_foot", "right_ankle"),
)
"""Reported points that are not joint centres, with the joint that moves them."""
SITE_PARENTS: np.ndarray = np.array([JOINT_NAMES.index(parent) for _, parent in SITES], dtype=np.int64)

REPORTED: tuple[str, ...] = (
    "pelvis", "spine", "neck", "head",
    "left_shoulder", "left_elbow", "left_wrist", "left_hand",
    "right_shoulder", "right_elbow", "right_wrist", "right_hand",
    "left_hip", "left_knee", "left_ankle", "left_foot",
    "right_hip", "right_knee", "right_ankle", "right_foot",
)  # fmt: skip
"""The 20 joints that every tracker reports, in the order of the track file."""

BONES: tuple[tuple[str, str], ...] = (
    ("pelvis", "spine"), ("spine", "neck"), ("neck", "head"),
    *((a.format(s), b.format(s)) for s in ("left", "right") for a, b in (
        ("neck", "{}_shoulder"), ("{}_shoulder", "{}_elbow"), ("{}_elbow", "{}_wrist"), ("{}_wrist", "{}_hand"),
        ("pelvis", "{}_hip"), ("{}_hip", "{}_knee"), ("{}_knee", "{}_ankle"), ("{}_ankle", "{}_foot"),
    )),
)  # fmt: skip
"""Pairs of reported joints that a drawn skeleton connects."""
BONE_ROWS: np.ndarray = np.array([[REPORTED.index(a), REPORTED.index(b)] for a, b in BONES])
"""Int (19, 2): the bones as rows of a track's joints."""

OTHER_SIDE: tuple[int, ...] = tuple(
    REPORTED.index({"left": "right_", "right": "left_"}.get(side, side) + rest)
    for side, _, rest in (name.partition("_") for name in REPORTED)
)
"""For each reported joint the row of the same joint on the other side."""

OUTER: dict[str, np.ndarray] = {
    f"{side}_{limb}": np.array([REPORTED.index(f"{side}_{joint}") for joint in joints])
    for limb, joints in (("arm", ("elbow", "wrist", "hand")), ("leg", ("knee", "ankle", "foot")))
    for side in ("left", "right")
}
"""Rows of the three outer joints of each limb in `REPORTED`: left_arm, right_arm, left_leg, right_leg."""

END_EFFECTORS: tuple[str, ...] = ("left_hand", "right_hand", "left_foot", "right_foot", "head")
"""Order of the five end effectors in every 15-dimensional feature (`E^5` in Baak 2013, 5.3.3)."""


def trunk_of(hips: np.ndarray, shoulders: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return pelvis, spine and neck, each (..., 3), from both hips and both shoulders, (..., 2, 3)."""
    pelvis, neck = hips.mean(axis=-2), shoulders.mean(axis=-2)
    return pelvis, pelvis + 0.4 * (neck - pelvis), neck


def _reported_matrix() -> np.ndarray:
    sources = (*JOINT_NAMES, *(name for name, _ in SITES))
    matrix = np.zeros((len(REPORTED), len(sources)))

    def rows(*names: str) -> np.ndarray:
        return np.eye(len(sources))[[sources.index(name) for name in names]]

    trunk = trunk_of(rows("left_hip", "right_hip"), rows("left_shoulder", "right_shoulder"))
    derived = dict(zip(("pelvis", "spine", "neck"), trunk, strict=True))
    for i, name in enumerate(REPORTED):
        matrix[i] = derived[name] if name in derived else rows(name)[0]
    return matrix


REPORTED_FROM_POINTS: np.ndarray = _reported_matrix()
"""Float64 (20, 23): the reported joints as weighted means of the 18 joint centres and the 5 sites."""


def fingerprint() -> str:
    """Return sixteen hexadecimal digits that identify the joint tree and its parametrisation (not the shape)."""
    text = repr([(j.name, j.parent, tuple(j.limits)) for j in JOINTS]) + repr(SITES) + repr(POSE_NAMES)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def check_pose(pose: np.ndarray) -> np.ndarray:
    """Return poses as float64 (..., P).

    Raises
    ------
    BodyError
        The last axis has another length than P, or a value is not finite.
    """
    array = np.asarray(pose, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != POSE_SIZE:
        raise BodyError(f"a pose has {POSE_SIZE} entries, this one has shape {array.shape}; use skeleton.POSE_NAMES")
    if not np.isfinite(array).all():
        raise BodyError("a pose entry is not finite; check the file that it was read from")
    return array
