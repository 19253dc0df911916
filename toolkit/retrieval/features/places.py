"""Limb positions as graded columns, which the relational features do not contain.

Positions of elbows, wrists, knees and ankles relative to the root, rotated so that the hips lie along x, in body
lengths. A search by example compares them besides the grades (`search.example`). Not part of the thesis.
"""

from __future__ import annotations

import numpy as np

from toolkit.retrieval.features.grades import FULL
from toolkit.retrieval.features.lengths import BodyLengths
from toolkit.retrieval.features.motion import NAMED_JOINTS, SIDES, Motion

PLACED: tuple[str, ...] = tuple(f"{side}_{joint}" for side in SIDES for joint in ("elbow", "wrist", "knee", "ankle"))
"""Joints with three rows (x, y, z) each."""
ROWS = 3 * len(PLACED)
SPREADS: np.ndarray = np.array([35, 50, 41, 58, 35, 50, 41, 58], dtype=np.float64)
"""float64 (8,): root mean square distance of each limb's position from its mean in the mocap of `grades.SPREADS`, equal
for left and right, in steps. `training/motion_scales.py` prints them."""

_CHOSEN = np.array([NAMED_JOINTS.index(name) for name in PLACED])
_LEFT, _RIGHT, _ROOT = (NAMED_JOINTS.index(name) for name in ("left_hip", "right_hip", "root"))


def hip_aligned_joints(motion: Motion, columns: np.ndarray) -> np.ndarray:
    """Return the joints (T, J, 3) in some frames (T,), metres: root at the origin, hips along x."""
    joints = motion.joints[columns]
    across = joints[:, _LEFT] - joints[:, _RIGHT]
    yaw = np.arctan2(-across[:, 2], across[:, 0])
    cosine, sine = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y, z = np.moveaxis(joints - joints[:, [_ROOT]], -1, 0)
    return np.stack([cosine * x - sine * z, y, sine * x + cosine * z], axis=-1)


def places_of(motion: Motion, columns: np.ndarray) -> np.ndarray:
    """Return the limb positions in some frames (T,) of a motion, int8 (24, T), in steps."""
    size = BodyLengths.of(motion).body
    steps_per_body = 200.0  # quantisation steps per body length; an outstretched arm, 0.6 body lengths, is below `FULL`
    turned = hip_aligned_joints(motion, columns)[:, _CHOSEN] * (steps_per_body / (size or 1.0))
    return np.ascontiguousarray(np.clip(np.rint(turned), -FULL, FULL).astype(np.int8).reshape(len(columns), ROWS).T)


def spread(places: np.ndarray) -> np.ndarray:
    """Return the root mean square distance of each limb from its mean position, float64 (8,), of positions (24, T)."""
    return np.asarray(np.sqrt(places.var(axis=1, dtype=np.float64).reshape(-1, 3).sum(axis=1)))


def importance(places: np.ndarray) -> np.ndarray:
    """Return the weight of each row in a comparison with an example's positions (24, T): float64 (24,), sum 1.

    As `grades.importance`, by limbs: limbs that the example moves count more than idle ones.
    """
    # Weight of a limb that an example does not move, relative to 1 for the usual motion; close to 0, because the pose
    # of an idle arm varies between people.
    idle_limb_weight = 0.01
    weights = np.repeat(idle_limb_weight + spread(places) / SPREADS, 3)
    return np.asarray(weights / weights.sum())
