"""What a tracker says about one frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from toolkit.skeleton import REPORTED

TRACKED, LOST, EMPTY = 0, 1, 2
"""States of a frame: followed; a person is there but not explained; no person is there."""
STATE_NAMES = ("tracked", "lost", "empty")


@dataclass(frozen=True, eq=False)
class FrameResult:
    """What a tracker says about one frame.

    Attributes
    ----------
    pose : float64 (P,), level frame (see `docs/architecture.md`), named by `skeleton.POSE_NAMES`
    joints : float32 (20, 3), camera frame, metres at true scale, always finite
    confidence : float32 (20,), in [0, 1]: probability that the joint is within 5 cm, 0 where nothing is known
    state : `TRACKED`, `LOST` or `EMPTY`
    source : index into the tracker's `source_names`, the hypothesis that won
    stage_ms : float32 (S,), milliseconds per stage of the tracker's `stage_names`, disjoint
    observed : bool (20,), False for a joint that was guessed, because nothing was measured where it has to be
    """

    pose: np.ndarray
    joints: np.ndarray
    confidence: np.ndarray
    state: int
    source: int
    stage_ms: np.ndarray
    observed: np.ndarray = field(default_factory=lambda: np.ones(len(REPORTED), dtype=np.bool_))
