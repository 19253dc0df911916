"""The 32 joints of the Azure Kinect body tracking SDK (k4abt) on the project's body.

Names, order, parents and bones are those of `k4abttypes.h` and of the bone list of the SDK's offline processor. Each
joint has a right-handed frame; `REST_FRAMES` has its axes in a T-pose (`docs/from_k4abt.md` shows them). The axes of
the right limbs are the mirrored axes of the left ones, all three reversed, so that equal angles on both sides are a
mirrored movement. The SDK's Unity sample and K4AdotNet use the same frames.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body

_ARM = ("CLAVICLE", "SHOULDER", "ELBOW", "WRIST", "HAND", "HANDTIP", "THUMB")
_LEG = ("HIP", "KNEE", "ANKLE", "FOOT")

NAMES: tuple[str, ...] = (
    "PELVIS", "SPINE_NAVEL", "SPINE_CHEST", "NECK",
    *(f"{part}_{side}" for side in ("LEFT", "RIGHT") for part in _ARM),
    *(f"{part}_{side}" for side in ("LEFT", "RIGHT") for part in _LEG),
    "HEAD", "NOSE", "EYE_LEFT", "EAR_LEFT", "EYE_RIGHT", "EAR_RIGHT",
)  # fmt: skip
"""Joint names in the SDK's order."""
OLD_NAMES = {"SPINE_NAVAL": "SPINE_NAVEL"}
"""Spelling of joint names before version 1.0.1."""


def _side_bones(side: str) -> tuple[tuple[str, str], ...]:
    pairs = (
        ("SPINE_CHEST", "CLAVICLE_"), ("CLAVICLE_", "SHOULDER_"), ("SHOULDER_", "ELBOW_"), ("ELBOW_", "WRIST_"),
        ("WRIST_", "HAND_"), ("HAND_", "HANDTIP_"), ("WRIST_", "THUMB_"), ("PELVIS", "HIP_"), ("HIP_", "KNEE_"),
        ("KNEE_", "ANKLE_"), ("ANKLE_", "FOOT_"), ("NOSE", "EYE_"), ("EYE_", "EAR_"),
    )  # fmt: skip
    return tuple((a + side if a.endswith("_") else a, b + side) for a, b in pairs)


BONES: tuple[tuple[str, str], ...] = (
    ("SPINE_CHEST", "SPINE_NAVEL"), ("SPINE_NAVEL", "PELVIS"), ("SPINE_CHEST", "NECK"), ("NECK", "HEAD"),
    ("HEAD", "NOSE"), *_side_bones("LEFT"), *_side_bones("RIGHT"),
)  # fmt: skip
"""Bone list of the SDK's offline processor, in its order."""

LEFT, UP, FRONT = np.eye(3)
"""Axes of the body frame."""


def _frame(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.column_stack([x, y, np.cross(x, y)])


_LEFT_FRAMES = {
    "trunk": _frame(UP, FRONT), "arm": _frame(LEFT, FRONT), "hand": _frame(LEFT, UP), "leg": _frame(UP, FRONT),
    "foot": _frame(FRONT, -UP),
}  # fmt: skip
_PARTS: dict[str, tuple[str, str, str]] = {
    "PELVIS": ("trunk", "root", "pelvis"), "SPINE_NAVEL": ("trunk", "lumbar", "spine"),
    "SPINE_CHEST": ("trunk", "thorax", "spine"), "NECK": ("trunk", "cervical", "neck"),
    "CLAVICLE": ("arm", "clavicle", "shoulder"), "SHOULDER": ("arm", "shoulder", "shoulder"),
    "ELBOW": ("arm", "elbow", "elbow"), "WRIST": ("hand", "wrist", "wrist"), "HAND": ("hand", "wrist", "hand"),
    "HANDTIP": ("hand", "wrist", "hand"), "THUMB": ("arm", "wrist", "hand"), "HIP": ("leg", "hip", "hip"),
    "KNEE": ("leg", "knee", "knee"), "ANKLE": ("leg", "ankle", "ankle"), "FOOT": ("foot", "ankle", "foot"),
}  # fmt: skip
"""Kind of the rest frame, joint with the same rotation, and closest reported joint of each SDK joint; the other joints
belong to the head."""


def _on_body(name: str) -> tuple[np.ndarray, int, int]:
    """Return the rest frame (3, 3), the row in `skeleton.JOINTS` and that in `skeleton.REPORTED` of an SDK joint."""
    part, _, side = name.rpartition("_")
    if name in _PARTS or part not in _PARTS:
        kind, joint, closest = _PARTS.get(name, ("trunk", "cervical", "head"))
        return _LEFT_FRAMES[kind], skeleton.JOINT_NAMES.index(joint), skeleton.REPORTED.index(closest)
    kind, joint, closest = _PARTS[part]
    mirror = np.diag([-1.0, 1.0, 1.0])  # reflection of the subject's left to the right
    frame = _LEFT_FRAMES[kind] if side == "LEFT" else -mirror @ _LEFT_FRAMES[kind]
    carrier = skeleton.JOINT_NAMES.index(f"{side.lower()}_{joint}")
    return frame, carrier, skeleton.REPORTED.index(f"{side.lower()}_{closest}")


_FRAMES, _CARRIERS, _WITNESSES = zip(*map(_on_body, NAMES), strict=True)
REST_FRAMES: np.ndarray = np.array(_FRAMES)
"""float64 (32, 3, 3): columns are the axes x, y, z of each joint in a T-pose, in the body frame (left, up, front)."""
CARRIERS: np.ndarray = np.array(_CARRIERS)
"""Joint of `skeleton.JOINT_NAMES` whose rotation each SDK joint has, int64 (32,)."""
WITNESS: np.ndarray = np.array(_WITNESSES)
"""Reported joint whose confidence each SDK joint has, int64 (32,)."""


def rest_points(body: Body) -> np.ndarray:
    """Return the positions of the 32 joints on a body in the T-pose: float64 (32, 3), body frame, metres."""
    points = {name.upper(): place for name, place in zip(skeleton.JOINT_NAMES, body.joints, strict=True)}
    points |= {name.upper(): place for (name, _), place in zip(skeleton.SITES, body.sites, strict=True)}
    tips = dict(zip(skeleton.END_EFFECTORS, body.vertices[body.end_effectors], strict=True))
    # Metres from the tip of the nose up to the eyes, sideways to each eye, and back, at the neutral stature (metres).
    eye_rise, eye_apart, eye_depth, neutral_stature = 0.035, 0.032, 0.025, 1.71
    skull, size = points["HEAD"], body.height / neutral_stature
    face = body.vertices[body.part == skeleton.JOINT_NAMES.index("cervical")]
    nose, half = face[face[:, 2].argmax()], 0.5 * np.ptp(face[:, 0])
    # Position of the SDK's HEAD, at the base of the skull, between the base of the neck (0) and the skull's centre
    # (1).
    k4abt_head_fraction = 0.5
    found = {
        "PELVIS": points["ROOT"], "SPINE_NAVEL": points["LUMBAR"], "SPINE_CHEST": points["THORAX"],
        "NECK": points["CERVICAL"], "HEAD": points["CERVICAL"] + k4abt_head_fraction * (skull - points["CERVICAL"]),
        "NOSE": np.array([skull[0], *nose[1:]]),
    }  # fmt: skip
    for side, sign in (("LEFT", 1.0), ("RIGHT", -1.0)):
        palm = body.vertices[body.part == skeleton.JOINT_NAMES.index(f"{side.lower()}_wrist")]
        found |= {f"{part}_{side}": points[f"{side}_{part}"] for part in _ARM[:5]}
        found |= {f"{part}_{side}": points[f"{side}_{part}"] for part in _LEG}
        found |= {
            f"HANDTIP_{side}": tips[f"{side.lower()}_hand"],
            f"THUMB_{side}": palm[palm[:, 2].argmax()],
            f"EYE_{side}": found["NOSE"] + size * np.array([sign * eye_apart, eye_rise, -eye_depth]),
            f"EAR_{side}": skull + [sign * half, 0.0, 0.0],  # their midpoint is the skull's centre
        }
    return np.array([found[name] for name in NAMES])


class Placed(NamedTuple):
    """The 32 joints of T frames: positions float64 (T, 32, 3), metres, and frames float64 (T, 32, 3, 3)."""

    positions: np.ndarray
    frames: np.ndarray


def place(body: Body, poses: np.ndarray) -> Placed:
    """Return the joints and their frames in poses (T, P), in the frame of the poses."""
    rest = rest_points(body) - body.joints[CARRIERS]
    positions, frames = np.empty((len(poses), len(NAMES), 3)), np.empty((len(poses), len(NAMES), 3, 3))
    for t, pose in enumerate(poses):
        placed = body.place(pose)
        turns = placed.rotations[CARRIERS]
        positions[t] = placed.origins[CARRIERS] + np.einsum("jab,jb->ja", turns, rest)
        frames[t] = turns @ REST_FRAMES
    return Placed(positions, frames)


def reported(positions: np.ndarray) -> np.ndarray:
    """Return the 20 reported joints of SDK positions (..., 32, 3): float64 (..., 20, 3), in the same unit.

    The head is the midpoint of both ears; pelvis, neck and spine are derived from hips and shoulders (`trunk_of`).
    """
    at = {name: positions[..., i, :] for i, name in enumerate(NAMES)}
    found = {
        f"{side.lower()}_{part.lower()}": at[f"{part}_{side}"]
        for side in ("LEFT", "RIGHT")
        for part in ("SHOULDER", "ELBOW", "WRIST", "HAND", "HIP", "KNEE", "ANKLE", "FOOT")
    }
    hips, shoulders = (
        np.stack([found[f"left_{part}"], found[f"right_{part}"]], axis=-2) for part in ("hip", "shoulder")
    )
    found["pelvis"], found["spine"], found["neck"] = skeleton.trunk_of(hips, shoulders)
    found["head"] = 0.5 * (at["EAR_LEFT"] + at["EAR_RIGHT"])
    return np.stack([found[name] for name in skeleton.REPORTED], axis=-2)
