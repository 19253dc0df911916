"""A standing body before a camera, and what evidence says of it."""

from __future__ import annotations

import numpy as np

from toolkit.body import skeleton
from toolkit.fitting.orientation import FrameEvidence
from toolkit.fitting.placed import NormalSystem, PlacedBody


def pose(**entries: float) -> np.ndarray:
    """Standing 2.5 m before the camera, some entries changed by so much."""
    found = np.zeros(skeleton.POSE_SIZE)
    found[2] = -2.5
    for name, value in entries.items():
        found[skeleton.POSE_NAMES.index(name)] += value
    return found


def normal(evidence: FrameEvidence, body: PlacedBody) -> NormalSystem:
    """The normal equations of the evidence alone."""
    system = NormalSystem()
    system.reset(body.origins[0])
    evidence.attract(system, body)
    system.assemble(body)
    return system
