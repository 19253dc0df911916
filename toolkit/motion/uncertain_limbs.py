"""Stretches of a track in which a limb is uncertain, for the summary of `track` and the report page."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.io.spans import spans
from toolkit.tracks import EMPTY, Track

NAMED = 6
"""Maximum number of stretches in a text, the longest ones."""


class UncertainStretch(NamedTuple):
    """Seconds since the first frame from `start` to `end`, in which a limb of `skeleton.OUTER` is uncertain."""

    limb: str
    start: float
    end: float

    @property
    def text(self) -> str:
        """Return the stretch in words."""
        return f"{self.limb.replace('_', ' ')} {self.start:.1f}-{self.end:.1f} s"


def uncertain_stretches(track: Track) -> list[UncertainStretch]:
    """Return the stretches in which the mean confidence of a limb's outer joints is below 0.5, by start."""
    there, times = track.state != EMPTY, track.timestamps - track.timestamps[0]
    steps = np.diff(times, append=times[-1] + (np.median(np.diff(times)) if len(times) > 1 else 0.0))
    found = []
    uncertain = 0.5  # mean confidence below which a limb is more likely wrong than right
    pause = 0.3  # seconds: stretches of one limb with shorter pauses between them are joined
    for limb, joints in skeleton.OUTER.items():
        low = spans(there & (track.confidence[:, joints].mean(axis=1) < uncertain))
        breaks = [0, *(k for k, (a, b) in enumerate(pairwise(low), 1) if times[b.start] - times[a.stop] >= pause)]
        for first, after in pairwise([*breaks, len(low)]):
            if first < after:
                last = low[after - 1].stop - 1
                found.append(UncertainStretch(limb, float(times[low[first].start]), float(times[last] + steps[last])))
    shortest = 0.2  # seconds, after short pauses were joined
    long = [stretch for stretch in found if stretch.end - stretch.start >= shortest or len(times) == 1]
    return sorted(long, key=lambda stretch: stretch.start)


def uncertain_text(track: Track) -> str:
    """Return the longest uncertain stretches of a track in one line; "none" without any."""
    stretches = uncertain_stretches(track)
    longest = sorted(stretches, key=lambda stretch: stretch.start - stretch.end)[:NAMED]
    named = [stretch.text for stretch in stretches if stretch in longest]
    rest = len(stretches) - len(named)
    return ", ".join([*named, *([f"{rest} shorter ones"] if rest else [])]) or "none"
