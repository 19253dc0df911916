"""A standing body in front of a camera, and the normal equations of a term."""

from functools import partial

from tests.poses import pose_at
from toolkit.fitting.orientation import FrameEvidence
from toolkit.fitting.placed import NormalSystem, PlacedBody

pose = partial(pose_at, (0.0, 0.0, -2.5))


def normal(evidence: FrameEvidence, body: PlacedBody) -> NormalSystem:
    """Return the normal equations of the term alone."""
    system = NormalSystem()
    system.reset(body.origins[0])
    evidence.attract(system, body)
    system.assemble(body)
    return system
