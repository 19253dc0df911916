"""Limbs of the body: their angles in a pose, their outer joints, their relational features."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.retrieval.features.relational import FEATURES

LIMBS: tuple[str, ...] = tuple(skeleton.OUTER)
_CHAINS = {"arm": ("clavicle", "shoulder", "elbow", "wrist"), "leg": ("hip", "knee", "ankle")}


def _entries(limb: str) -> np.ndarray:
    side, part = limb.split("_")
    wanted = tuple(f"{side}_{joint}_r" for joint in _CHAINS[part])
    return np.array([i for i, name in enumerate(skeleton.POSE_NAMES) if name.startswith(wanted)], dtype=np.int64)


ENTRIES: dict[str, np.ndarray] = {limb: _entries(limb) for limb in LIMBS}
"""Indices of the angles of each limb in a pose, int64."""

_POINTS = {"arm": ("elbow", "wrist", "fingers"), "leg": ("knee", "ankle", "toes")}
_POINTS_OF = {limb: {f"{limb[:-4]}_{point}" for point in _POINTS[limb[-3:]]} for limb in LIMBS}
_MEASURED = [{limb for limb in LIMBS if _POINTS_OF[limb] & set(feature.points)} for feature in FEATURES]
"""Limbs that each feature measures."""

ROWS_OF_LIMB: dict[str, int] = {
    limb: sum(1 << row for row, limbs in enumerate(_MEASURED) if limb in limbs and len(limbs) < len(LIMBS))
    for limb in LIMBS
}
"""Features that measure each limb, as bits of a column word; without those of all four limbs."""
