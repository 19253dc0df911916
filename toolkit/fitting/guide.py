"""Evidence beside the depth by time: orientations of joints (`toolkit.inertial.guide`) and pose priors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.fitting.orientation import FrameEvidence
from toolkit.fitting.priors import PoseTerm


class Guide:
    """Evidence for each frame of a recording: none; other guides extend it."""

    def evidence(self, timestamp: float, level_rotation: np.ndarray) -> Sequence[FrameEvidence]:
        """Return the terms for the placed body at `timestamp` seconds; `level_rotation` is R_level_camera, (3, 3)."""
        return ()

    def priors(self, timestamp: float) -> Sequence[PoseTerm]:
        """Return the terms in the pose vector at `timestamp` seconds."""
        return ()
