"""Gaps: stretches of a track in which a limb is hidden, by the confidence of its joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from toolkit.errors import SettingsError
from toolkit.retrieval.annotation.annotator import runs
from toolkit.retrieval.priors.limbs import LIMBS, OUTER


class Gap(NamedTuple):
    """Frames `start` to `stop` - 1, in which `limb` is hidden."""

    limb: str
    start: int
    stop: int


@dataclass(frozen=True)
class GapSettings:
    """When a limb counts as hidden.

    Attributes
    ----------
    hidden : mean confidence of a limb's three outer joints below which it is hidden. On the tuning split of the
        sequences 0.78 finds 72 % of the hidden frames and is right in 74 %
    ends : a gap goes on on both sides while the confidence is below this, for a limb is seen badly before it is hidden
    smoothing : frames over which the confidence is averaged
    joined : gaps nearer than so many frames are one
    shortest : frames; shorter gaps are left alone
    """

    hidden: float = 0.78
    ends: float = 0.8
    smoothing: int = 5
    joined: int = 3
    shortest: int = 4

    def __post_init__(self) -> None:
        if not 0.0 <= self.hidden <= self.ends <= 1.0 or self.smoothing < 1 or self.shortest < 1:
            raise SettingsError(
                f"gaps need 0 <= hidden <= ends <= 1 and smoothing and shortest of at least 1 frame, not "
                f"{self.hidden}, {self.ends}, {self.smoothing}, {self.shortest}"
            )


def limb_support(confidence: np.ndarray, smoothing: int) -> dict[str, np.ndarray]:
    """Mean confidence (T,) of each limb's outer joints, averaged over `smoothing` frames; `confidence` is (T, 20)."""
    kernel = np.ones(smoothing)
    known = np.convolve(np.ones(len(confidence)), kernel, mode="same")
    return {
        limb: np.convolve(confidence[:, OUTER[limb]].mean(axis=1), kernel, mode="same")[: len(confidence)] / known
        for limb in LIMBS
    }


def find_gaps(confidence: np.ndarray, present: np.ndarray, settings: GapSettings | None = None) -> list[Gap]:
    """Where which limb is hidden, sorted by limb and start.

    Parameters
    ----------
    confidence : (T, 20), as a track has it
    present : bool (T,), frames in which a person is there; others end a gap
    """
    settings = settings or GapSettings()
    found = []
    if len(confidence) < settings.smoothing:
        return []
    for limb, support in limb_support(confidence, settings.smoothing).items():
        hidden, wide = (support < settings.hidden) & present, (support < settings.ends) & present
        chosen = [(a, b) for a, b in runs(wide) if hidden[a:b].any()]
        merged: list[tuple[int, int]] = []
        for start, stop in chosen:
            if merged and start - merged[-1][1] < settings.joined and present[merged[-1][1] : start].all():
                merged[-1] = merged[-1][0], stop
            else:
                merged.append((start, stop))
        found += [Gap(limb, a, b) for a, b in merged if b - a >= settings.shortest]
    return found
