"""The ways through the gaps of a track: as it is, tracked again, as class or repetitions have it, and straight on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.fitting.priors import SPREAD, GaussianPrior
from toolkit.kernels import linear
from toolkit.retrieval.priors.allocation import Allocation
from toolkit.retrieval.priors.bridge import Bridge
from toolkit.retrieval.priors.expectation import ROOT, GapContext, fill
from toolkit.retrieval.priors.gaps import JOINED, Gap
from toolkit.retrieval.priors.limb_entries import ENTRIES, LIMBS

KEPT, AGAIN, STRAIGHT = "track", "tracked again", "interpolation"
MOST = 3
"""Of the four limbs: with so many hidden at once a frame is bad."""
PRIOR_WEIGHT = 0.003
"""Square metres per square radian and variance: what the angles of a hidden limb pull while the recording is tracked
again; a tenth of what the samples at a seen arm do."""
PRIOR_SPREAD = 0.15
"""Radians, added to the spread of what is expected."""
WIDENED = 20
"""Frames by which a gap is looked at beyond its ends: a limb is mistaken before it is given up."""
STIFFNESS = 0.02
"""Metres that a step of one radian, squared, of one angle counts from one frame to the next."""


@dataclass(frozen=True, eq=False)
class GapWays:
    """The ways through one gap.

    Attributes
    ----------
    gap : looked at, wider than where the limb is hidden
    hidden : bool (D,), frames in which it is
    expected : angles and variance of what is expected
    names : of the ways; `KEPT` comes first, `AGAIN` second
    angles : float64 (C, D, A), radians; NaN for what is not known yet
    """

    gap: Gap
    hidden: np.ndarray
    expected: Bridge
    names: tuple[str, ...]
    angles: np.ndarray

    @property
    def entries(self) -> np.ndarray:
        """Where the limb's angles stand in a pose."""
        return ENTRIES[self.gap.limb]


def widened(gaps: Sequence[Gap], frames: int, by: int = WIDENED) -> list[Gap]:
    """Gaps that begin `by` frames earlier and end as much later, within the track; a limb's that meet are one."""
    found: list[Gap] = []
    for gap in gaps:
        start, stop = max(0, gap.start - by), min(frames, gap.stop + by)
        if found and found[-1].limb == gap.limb and start - found[-1].stop < JOINED:
            found[-1] = found[-1]._replace(stop=stop)
        else:
            found.append(Gap(gap.limb, start, stop))
    return found


def flags_of(gaps: Sequence[Gap], frames: int) -> dict[str, np.ndarray]:
    """Limb -> bool (T,), frames within its gaps."""
    flags = {limb: np.zeros(frames, dtype=np.bool_) for limb in LIMBS}
    for gap in gaps:
        flags[gap.limb][gap.start : gap.stop] = True
    return flags


def bad_frames(hidden: Mapping[str, np.ndarray]) -> np.ndarray:
    """Bool (T,): frames in which most limbs are hidden: where the whole is wrong, no part of it is supported."""
    return np.sum([hidden[limb] for limb in LIMBS], axis=0) >= MOST


def whole_priors(told: GapContext, bad: np.ndarray) -> dict[int, GaussianPrior]:
    """Frame -> the class's whole pose, in bad frames (T,) that bear the label of a class with a motion."""
    precisions: dict[int, np.ndarray] = {}
    found = {}
    for frame in np.flatnonzero(bad & (told.allocation.label >= 0)):
        row = int(told.allocation.label[frame])
        motion = told.classes[row].motion
        if motion is None:
            continue
        if row not in precisions:
            covariance = motion.covariance + SPREAD**2 * np.eye(len(motion.covariance))
            precisions[row] = linear.inverse(covariance)
        mean = np.concatenate([np.zeros(ROOT), motion.mean[told.allocation.column[frame]]])
        found[int(frame)] = GaussianPrior(PRIOR_WEIGHT, mean, precisions[row])
    return found


def ways_through(told: GapContext, gaps: Sequence[Gap]) -> list[GapWays]:
    """All ways through the gaps in which limbs are hidden, but for tracking again."""
    frames = len(told.times)
    wide = widened(gaps, frames)
    around = replace(told, hidden=flags_of(wide, frames))
    unlabelled = replace(around, allocation=Allocation.nothing(frames))
    found = []
    for gap in wide:
        expected, source = fill(around, gap)
        straight, _ = fill(unlabelled, gap)
        rows = slice(gap.start, gap.stop)
        kept = told.poses[rows][:, ENTRIES[gap.limb]]
        names, angles = [KEPT, AGAIN, STRAIGHT], [kept, np.full_like(kept, np.nan), straight.mean]
        if source != STRAIGHT:
            names.append(source)
            angles.append(expected.mean)
        found.append(GapWays(gap, told.hidden[gap.limb][rows], expected, tuple(names), np.stack(angles)))
    return found


def cheapest_path(costs: np.ndarray, angles: np.ndarray, stiffness: float = STIFFNESS) -> np.ndarray:
    """Which way to take in each frame, so that costs and steps between frames are least in sum (dynamic programming).

    Parameters
    ----------
    costs : float64 (C, D), metres, of each of C ways in each of D frames; infinite where a way is not open
    angles : float64 (C, D, A), radians
    stiffness : metres that a step of one radian, squared, costs

    Returns
    -------
    int64 (D,), the first of equals
    """
    total = costs[:, 0].copy()
    came_from = np.zeros(costs.shape, dtype=np.int64)
    for frame in range(1, costs.shape[1]):
        step = angles[:, None, frame - 1] - angles[None, :, frame]
        through = total[:, None] + stiffness * (step**2).sum(axis=2)
        came_from[:, frame] = through.argmin(axis=0)
        total = through.min(axis=0) + costs[:, frame]
    path = np.empty(costs.shape[1], dtype=np.int64)
    path[-1] = total.argmin()
    for frame in range(costs.shape[1] - 1, 0, -1):
        path[frame - 1] = came_from[path[frame], frame]
    return path
