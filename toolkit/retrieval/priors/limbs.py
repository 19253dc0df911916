"""The four limbs: where their angles stand in a pose, which joints tell whether they are seen, which features look."""

from __future__ import annotations

import numpy as np

from toolkit import skeleton
from toolkit.retrieval.features.relational import FEATURES

LIMBS: tuple[str, ...] = ("left_arm", "right_arm", "left_leg", "right_leg")
_CHAINS = {"arm": ("clavicle", "shoulder", "elbow", "wrist"), "leg": ("hip", "knee", "ankle")}
_OUTER = {"arm": ("elbow", "wrist", "hand"), "leg": ("knee", "ankle", "foot")}


def _entries(limb: str) -> np.ndarray:
    side, part = limb.split("_")
    wanted = tuple(f"{side}_{joint}_r" for joint in _CHAINS[part])
    return np.array([i for i, name in enumerate(skeleton.POSE_NAMES) if name.startswith(wanted)], dtype=np.int64)


def _outer(limb: str) -> np.ndarray:
    side, part = limb.split("_")
    return np.array([skeleton.REPORTED.index(f"{side}_{joint}") for joint in _OUTER[part]], dtype=np.int64)


ENTRIES: dict[str, np.ndarray] = {limb: _entries(limb) for limb in LIMBS}
"""Where the angles of each limb stand in a pose, int64."""
OUTER: dict[str, np.ndarray] = {limb: _outer(limb) for limb in LIMBS}
"""The three outer joints of each limb, rows of `skeleton.REPORTED`."""

_BOTH = {
    "hands far apart, sideways": "arm",
    "hands approaching each other": "arm",
    "feet far apart, sideways": "leg",
    "feet crossed over": "leg",
    "feet moving towards each other, sideways": "leg",
    "feet moving apart, sideways": "leg",
    "root behind frontal plane": "leg",
}
_WORDS = {"arm": ("hand", "elbow", "humerus"), "leg": ("foot", "knee", "femur")}


def _limbs_of(meaning: str) -> tuple[str, ...]:
    if "foot behind" in meaning or meaning in _BOTH:
        part = _BOTH.get(meaning, "leg")
        return (f"left_{part}", f"right_{part}")
    side, _, rest = meaning.partition(" ")
    for part, words in _WORDS.items():
        if side in ("left", "right") and rest.startswith(words):
            return (f"{side}_{part}",)
    return ()


LIMBS_OF_FEATURE: tuple[tuple[str, ...], ...] = tuple(_limbs_of(feature.meaning) for feature in FEATURES)
"""For each feature the limbs that it looks at; none for those of the trunk and of the whole body."""

ROWS_OF_LIMB: dict[str, int] = {
    limb: sum(1 << row for row, limbs in enumerate(LIMBS_OF_FEATURE) if limb in limbs) for limb in LIMBS
}
"""For each limb the features that look at it, as bits of a column word."""
