"""Limbs of the body: their angles in a pose, their outer joints, their relational features."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.retrieval.features.relational import FEATURES, Feature

LIMBS: tuple[str, ...] = tuple(skeleton.OUTER)
_CHAINS = {"arm": ("clavicle", "shoulder", "elbow", "wrist"), "leg": ("hip", "knee", "ankle")}


def _entries(limb: str) -> np.ndarray:
    side, part = limb.split("_")
    wanted = tuple(f"{side}_{joint}_r" for joint in _CHAINS[part])
    return np.array([i for i, name in enumerate(skeleton.POSE_NAMES) if name.startswith(wanted)], dtype=np.int64)


ENTRIES: dict[str, np.ndarray] = {limb: _entries(limb) for limb in LIMBS}
"""Indices of the angles of each limb in a pose, int64."""

_LIMB_OF = {
    f"{limb.split('_')[0]}_{joint}": limb
    for limb in LIMBS
    for joint in (("elbow", "wrist", "fingers") if limb.endswith("arm") else ("knee", "ankle", "toes"))
}
"""Limb of each named joint of the features on a limb."""


def _limbs_of(feature: Feature) -> tuple[str, ...]:
    """Return the limbs that a feature measures; none for the trunk and for features of all four limbs."""
    found = {_LIMB_OF[point] for point in feature.points if point in _LIMB_OF}
    return () if len(found) == len(LIMBS) else tuple(limb for limb in LIMBS if limb in found)


LIMBS_OF_FEATURE: tuple[tuple[str, ...], ...] = tuple(map(_limbs_of, FEATURES))
"""Limbs that each feature measures; none for those of the trunk and of the whole body."""

ROWS_OF_LIMB: dict[str, int] = {
    limb: sum(1 << row for row, limbs in enumerate(LIMBS_OF_FEATURE) if limb in limbs) for limb in LIMBS
}
"""Features that measure each limb, as bits of a column word."""
