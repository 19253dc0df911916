"""A standing body in front of a camera, and the normal equations of a term."""

import numpy as np

from toolkit.body import skeleton
from toolkit.fitting.orientation import FrameEvidence
from toolkit.fitting.placed import NormalSystem, PlacedBody


def pose(**entries: float) -> np.ndarray:
    """Return a pose 2.5 m in front of the camera with some entries changed."""
    found = np.zeros(skeleton.POSE_SIZE)
    found[2] = -2.5
    for name, value in entries.items():
        found[skeleton.POSE_NAMES.index(name)] += value
    return found


def normal(evidence: FrameEvidence, body: PlacedBody) -> NormalSystem:
    """Return the normal equations of the term alone."""
    system = NormalSystem()
    system.reset(body.origins[0])
    evidence.attract(system, body)
    system.assemble(body)
    return system
