"""What becomes of the error of hidden joints: by gap, and by the reason why it is left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from toolkit.evaluation.joints import joint_errors
from toolkit.kernels import linear
from toolkit.retrieval.priors.limbs import ENTRIES, LIMBS, OUTER
from toolkit.stabilising.loop import Round
from toolkit.stabilising.source import Source
from toolkit.stabilising.ways import KEPT
from toolkit.track import Track

CLEARLY = 0.005
"""Metres, of a limb's joints on average, that count as a difference."""
NO_GAP, NOTHING_BETTER, REJECTED, POOR, WON = (
    "outside the gaps", "no way is better", "a better way was rejected", "another way was better", "the best way taken"
)  # fmt: skip


class GapCause(NamedTuple):
    """A gap's hidden joints: their number over frames, mean error in mm before, as chosen, and of the best way; why."""

    limb: str
    start: int
    stop: int
    joints: int
    before: float
    chosen: float
    best: float
    best_way: str
    cause: str


def gap_causes(source: Source, before: Track, found: Round, truth: np.ndarray, seen: np.ndarray) -> list[GapCause]:
    """Every gap of a round in which a joint was truly hidden; `truth` (T, 20, 3), `seen` bool (T, 20)."""
    causes = []
    for gap in found.gaps:
        frames, outer = np.arange(gap.start, gap.stop), OUTER[gap.limb]
        hidden = ~seen[frames][:, outer]
        if not hidden.any():
            continue
        errors = np.stack([
            _errors(source, before.pose[frames], gap.limb, angles, truth[frames])[:, outer] for angles in gap.angles
        ])  # fmt: skip
        means = np.array([own[hidden].mean() for own in errors])
        chosen = float(errors[gap.path, np.arange(len(frames))][hidden].mean())
        kept, best = float(means[gap.names.index(KEPT)]), int(np.nanargmin(means))
        if kept - means[best] < CLEARLY:
            cause = NOTHING_BETTER
        elif chosen - means[best] < CLEARLY:
            cause = WON
        else:
            cause = REJECTED if kept - chosen < CLEARLY else POOR
        causes.append(GapCause(gap.limb, gap.start, gap.stop, int(hidden.sum()), 1000 * kept, 1000 * chosen,
                               1000 * float(means[best]), gap.names[best], cause))  # fmt: skip
    return causes


def shares(causes: Sequence[GapCause], before: Track, truth: np.ndarray, seen: np.ndarray) -> dict[str, list[float]]:
    """Cause -> share of the error of all hidden joints before, and how many mm of their mean the best way would win."""
    errors = 1000 * joint_errors(before.joints, truth)
    limbs = np.zeros(seen.shape, dtype=bool)
    limbs[:, np.concatenate([OUTER[limb] for limb in LIMBS])] = True
    everything, count = float(errors[~seen & limbs].sum()), int((~seen & limbs).sum())
    found = {}
    for cause in (NOTHING_BETTER, REJECTED, POOR, WON):
        own = [c for c in causes if c.cause == cause]
        inside = sum(c.joints * c.before for c in own)
        left = sum(c.joints * (c.chosen - c.best) for c in own)
        found[cause] = [inside / max(everything, 1e-9), left / max(count, 1)]
    rest = 1.0 - sum(share for share, _ in found.values())
    return {NO_GAP: [rest, 0.0], **found}


def _errors(source: Source, poses: np.ndarray, limb: str, angles: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Errors (D, 20), metres, of poses (D, P) with a limb's angles (D, A) exchanged."""
    moved = poses.copy()
    moved[:, ENTRIES[limb]] = np.nan_to_num(angles)
    return joint_errors(linear.rotated(source.body.joint_positions(moved), source.info.R_level_camera), truth)
