"""Candidate trajectories of an occluded limb through its gap, and the cheapest path through them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.retrieval.priors.allocation import Allocation
from toolkit.retrieval.priors.expectation import Bridge, GapContext, fill
from toolkit.retrieval.priors.gaps import Gap, hidden_flags, widened
from toolkit.retrieval.priors.limb_entries import ENTRIES

KEPT, RETRACKED, INTERPOLATED = "track", "tracked again", "interpolation"
PRIOR_SPREAD = 0.15
"""Added to the standard deviation of a prior, radians."""


@dataclass(frozen=True, eq=False)
class GapCandidates:
    """Candidate trajectories through one gap of D frames.

    Attributes
    ----------
    gap : widened gap
    hidden : bool (D,), frames in which the limb is occluded
    expected : expected angles and their variance
    names : names of the C candidates; `KEPT` is first, `RETRACKED` second
    angles : float64 (C, D, A), radians; NaN where not computed yet
    """

    gap: Gap
    hidden: np.ndarray
    expected: Bridge
    names: tuple[str, ...]
    angles: np.ndarray

    @property
    def entries(self) -> np.ndarray:
        """Indices of the limb's angles in a pose, int64 (A,)."""
        return ENTRIES[self.gap.limb]


def gap_candidates(context: GapContext, gaps: Sequence[Gap]) -> list[GapCandidates]:
    """Return the candidates of each gap; the angles of `RETRACKED` are NaN."""
    frames = len(context.times)
    wide = widened(gaps, frames)
    around = replace(context, hidden=hidden_flags(wide, frames))
    unlabelled = replace(around, allocation=Allocation.nothing(frames))
    found = []
    for gap in wide:
        expected, source = fill(around, gap)
        straight, _ = fill(unlabelled, gap)
        rows = slice(gap.start, gap.stop)
        kept = context.poses[rows][:, ENTRIES[gap.limb]]
        names, angles = [KEPT, RETRACKED, INTERPOLATED], [kept, np.full_like(kept, np.nan), straight.mean]
        if source != INTERPOLATED:
            names.append(source)
            angles.append(expected.mean)
        found.append(GapCandidates(gap, context.hidden[gap.limb][rows], expected, tuple(names), np.stack(angles)))
    return found


def cheapest_path(costs: np.ndarray, angles: np.ndarray, smoothness_cost: float = 0.02) -> np.ndarray:
    """Return the candidate of each frame that minimises the sum of costs and steps (dynamic programming).

    Parameters
    ----------
    costs : float64 (C, D), metres, of C candidates in D frames; infinite where a candidate is excluded
    angles : float64 (C, D, A), radians
    smoothness_cost : metres for a squared step of one radian between frames

    Returns
    -------
    int64 (D,); the first of equal candidates
    """
    total = costs[:, 0].copy()
    came_from = np.zeros(costs.shape, dtype=np.int64)
    for frame in range(1, costs.shape[1]):
        step = angles[:, None, frame - 1] - angles[None, :, frame]
        through = total[:, None] + smoothness_cost * (step**2).sum(axis=2)
        came_from[:, frame] = through.argmin(axis=0)
        total = through.min(axis=0) + costs[:, frame]
    path = np.empty(costs.shape[1], dtype=np.int64)
    path[-1] = total.argmin()
    for frame in range(costs.shape[1] - 1, 0, -1):
        path[frame - 1] = came_from[path[frame], frame]
    return path
