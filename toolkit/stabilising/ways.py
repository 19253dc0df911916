"""The ways through the gaps of a track: as it is, tracked again, as class or repetitions have it, and straight on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.retrieval.priors.allocation import Allocation
from toolkit.retrieval.priors.bridge import Bridge
from toolkit.retrieval.priors.expectation import Told, fill
from toolkit.retrieval.priors.gaps import Gap
from toolkit.retrieval.priors.limbs import ENTRIES, LIMBS
from toolkit.stabilising.settings import StabiliseSettings

KEPT, AGAIN, STRAIGHT = "track", "tracked again", "interpolation"


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


def widened(gaps: Sequence[Gap], frames: int, by: int, joined: int) -> list[Gap]:
    """Gaps that begin `by` frames earlier and end as much later, within the track; a limb's that meet are one."""
    found: list[Gap] = []
    for gap in gaps:
        start, stop = max(0, gap.start - by), min(frames, gap.stop + by)
        if found and found[-1].limb == gap.limb and start - found[-1].stop < joined:
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


def ways_through(told: Told, gaps: Sequence[Gap], settings: StabiliseSettings) -> list[GapWays]:
    """All ways through all gaps, but for tracking again.

    Parameters
    ----------
    told : the track, and where its limbs are hidden
    gaps : where they are hidden
    """
    frames = len(told.times)
    wide = widened(gaps, frames, settings.widened, settings.gaps.joined)
    around = replace(told, hidden=flags_of(wide, frames))
    unlabelled = replace(around, allocation=Allocation.nothing(frames))
    found = []
    for gap in wide:
        expected, source = fill(around, gap, settings.expectation)
        straight, _ = fill(unlabelled, gap, settings.expectation)
        rows = slice(gap.start, gap.stop)
        kept = told.poses[rows][:, ENTRIES[gap.limb]]
        names, angles = [KEPT, AGAIN, STRAIGHT], [kept, np.full_like(kept, np.nan), straight.mean]
        if source != STRAIGHT:
            names.append(source)
            angles.append(expected.mean)
        found.append(GapWays(gap, told.hidden[gap.limb][rows], expected, tuple(names), np.stack(angles)))
    return found
