"""Small synthetic motions for the retrieval tests: a standing figure that faces +z (left at +x), or moves at random."""

import numpy as np

from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion
from toolkit.retrieval.features.relational import FEATURES

_SWAP = {"left": "right", "right": "left"}
_MEANINGS = [feature.meaning for feature in FEATURES]
MIRROR = np.array([_MEANINGS.index(" ".join(_SWAP.get(word, word) for word in m.split())) for m in _MEANINGS])
"""int64 (40,): row of each feature's mirror image."""

_SPINE = {
    "root": (0.0, 1.0, 0.0), "belly": (0.0, 1.12, 0.0), "chest": (0.0, 1.26, 0.0), "neck": (0.0, 1.4, 0.0),
    "head": (0.0, 1.55, 0.0), "headtop": (0.0, 1.72, 0.0),
}  # fmt: skip
_SIDE = {
    "clavicle": (0.0, 1.4, 0.0), "shoulder": (0.2, 1.43, 0.0), "elbow": (0.24, 1.15, 0.0), "wrist": (0.26, 0.9, 0.03),
    "fingers": (0.26, 0.72, 0.05), "hip": (0.1, 0.92, 0.0), "knee": (0.1, 0.5, 0.03), "ankle": (0.1, 0.09, 0.0),
    "toes": (0.1, 0.02, 0.2),
}  # fmt: skip


def standing() -> dict[str, np.ndarray]:
    """Return named joints of a person who stands with hanging arms, metres."""
    pose = {name: np.array(place) for name, place in _SPINE.items()}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        pose |= {f"{side}_{joint}": np.array(place) * [sign, 1.0, 1.0] for joint, place in _SIDE.items()}
    return pose


def still(pose: dict[str, np.ndarray], frames: int = 8, rate: float = 120.0) -> Motion:
    """Return a motion that holds one pose."""
    joints = np.stack([pose[name] for name in NAMED_JOINTS])
    return Motion("still", np.repeat(joints[None], frames, axis=0), rate)


def random_motion(seed: int, seconds: float = 2.0, rate: float = 120.0, reach: float = 0.35) -> Motion:
    """Return a motion in which each joint swings about its rest position; equal seeds give equal motions at all
    rates.
    """
    rng = np.random.default_rng(seed)
    joints = np.stack([standing()[name] for name in NAMED_JOINTS])
    time = np.arange(int(round(seconds * rate))) / rate
    amplitude = rng.uniform(0.0, reach / 2, (2, len(joints), 3))
    phase = rng.uniform(0.0, 2 * np.pi, (2, len(joints), 3))
    speed = rng.uniform(0.5, 9.0, (2, len(joints), 3))
    swing = amplitude * np.sin(speed * time[:, None, None, None] + phase)
    yaw = rng.uniform(-2.0, 2.0) * np.sin(2.0 * time)
    axis = np.stack([np.cos(yaw), np.zeros_like(yaw), -np.sin(yaw)], axis=1)
    return Motion(f"random {seed}", joints + swing.sum(axis=1), rate, axis)
