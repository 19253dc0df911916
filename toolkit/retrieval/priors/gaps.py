"""Gaps: stretches of a track in which a limb is hidden, by the confidence of its joints."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from toolkit.io.spans import spans
from toolkit.retrieval.priors.limb_entries import LIMBS, OUTER


class Gap(NamedTuple):
    """Frames `start` to `stop` - 1, in which `limb` is hidden."""

    limb: str
    start: int
    stop: int


HIDDEN = 0.78
"""Mean confidence of a limb's three outer joints below which it is hidden. On the tuning split of the sequences 0.78
finds 72 % of the hidden frames and is right in 74 %."""
ENDS = 0.8
"""A gap goes on on both sides while the confidence is below this, for a limb is seen badly before it is hidden."""
SMOOTHING = 5
"""Frames over which the confidence is averaged."""
JOINED = 3
"""Gaps nearer than so many frames are one."""
SHORTEST = 4
"""Frames; shorter gaps are left alone."""


def limb_support(confidence: np.ndarray, smoothing: int) -> dict[str, np.ndarray]:
    """Mean confidence (T,) of each limb's outer joints, averaged over `smoothing` frames; `confidence` is (T, 20)."""
    kernel = np.ones(smoothing)
    known = np.convolve(np.ones(len(confidence)), kernel, mode="same")
    return {
        limb: np.convolve(confidence[:, OUTER[limb]].mean(axis=1), kernel, mode="same")[: len(confidence)] / known
        for limb in LIMBS
    }


def find_gaps(confidence: np.ndarray, present: np.ndarray) -> list[Gap]:
    """Where which limb is hidden, sorted by limb and start.

    Parameters
    ----------
    confidence : (T, 20), as a track has it
    present : bool (T,), frames in which a person is there; others end a gap
    """
    found = []
    if len(confidence) < SMOOTHING:
        return []
    for limb, support in limb_support(confidence, SMOOTHING).items():
        hidden, wide = (support < HIDDEN) & present, (support < ENDS) & present
        chosen = [span for span in spans(wide) if hidden[span].any()]
        merged: list[tuple[int, int]] = []
        for span in chosen:
            if merged and span.start - merged[-1][1] < JOINED and present[merged[-1][1] : span.start].all():
                merged[-1] = merged[-1][0], span.stop
            else:
                merged.append((span.start, span.stop))
        found += [Gap(limb, a, b) for a, b in merged if b - a >= SHORTEST]
    return found
