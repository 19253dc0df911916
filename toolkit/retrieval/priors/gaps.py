"""Gaps of a track: runs of frames in which a limb is occluded, detected by the confidence of its joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.io.spans import spans
from toolkit.retrieval.priors.gap_settings import DEFAULT, GapSettings
from toolkit.retrieval.priors.limb_entries import LIMBS


class Gap(NamedTuple):
    """Frames `start` to `stop` - 1, in which `limb` is occluded."""

    limb: str
    start: int
    stop: int


def limb_support(confidence: np.ndarray, smoothing: int) -> dict[str, np.ndarray]:
    """Return the mean confidence (T,) of each limb's outer joints, averaged over `smoothing` frames.

    `confidence` is (T, 20).
    """
    kernel = np.ones(smoothing)
    counts = np.convolve(np.ones(len(confidence)), kernel, mode="same")
    support = {}
    for limb, joints in skeleton.OUTER.items():
        summed = np.convolve(confidence[:, joints].mean(axis=1), kernel, mode="same")
        support[limb] = summed[: len(confidence)] / counts
    return support


def find_gaps(confidence: np.ndarray, present: np.ndarray, settings: GapSettings = DEFAULT) -> list[Gap]:
    """Return the gaps of a track, sorted by limb and start.

    Parameters
    ----------
    confidence : (T, 20), confidence of the track's joints, 0 to 1
    present : bool (T,), frames in which the person is tracked; the others end a gap
    settings : thresholds
    """
    found = []
    if len(confidence) < settings.smoothing_frames:
        return []
    for limb, support in limb_support(confidence, settings.smoothing_frames).items():
        hidden = (support < settings.hidden_confidence) & present
        wide = (support < settings.end_confidence) & present
        merged: list[tuple[int, int]] = []
        for span in (span for span in spans(wide) if hidden[span].any()):
            near = merged and span.start - merged[-1][1] < settings.joined_frames
            if near and present[merged[-1][1] : span.start].all():
                merged[-1] = merged[-1][0], span.stop
            else:
                merged.append((span.start, span.stop))
        found += [Gap(limb, a, b) for a, b in merged if b - a >= settings.shortest_gap]
    return found


def widened(gaps: Sequence[Gap], frames: int, settings: GapSettings = DEFAULT) -> list[Gap]:
    """Return the gaps extended by `widened_frames` on both sides; gaps of a limb that meet are merged."""
    found: list[Gap] = []
    for gap in gaps:
        start, stop = max(0, gap.start - settings.widened_frames), min(frames, gap.stop + settings.widened_frames)
        if found and found[-1].limb == gap.limb and start - found[-1].stop < settings.joined_frames:
            found[-1] = found[-1]._replace(stop=stop)
        else:
            found.append(Gap(gap.limb, start, stop))
    return found


def hidden_flags(gaps: Sequence[Gap], frames: int) -> dict[str, np.ndarray]:
    """Return a bool (T,) mask for each limb: the frames within its gaps."""
    flags = {limb: np.zeros(frames, dtype=np.bool_) for limb in LIMBS}
    for gap in gaps:
        flags[gap.limb][gap.start : gap.stop] = True
    return flags
