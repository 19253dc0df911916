"""What is expected of a hidden limb: the class's motion given the limbs that are seen, and the person's repetitions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from toolkit.body import skeleton
from toolkit.kernels import linear
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.class_motion import ANGLES
from toolkit.retrieval.priors.allocation import Allocation
from toolkit.retrieval.priors.bridge import Bridge, End, bridge
from toolkit.retrieval.priors.gaps import Gap
from toolkit.retrieval.priors.limb_entries import ENTRIES, LIMBS

ROOT = skeleton.POSE_SIZE - (ANGLES.stop - ANGLES.start)
"""Entries of a pose before its joint angles."""


SEEN_NOISE = 0.12
"""Radians, standard deviation of the angles of limbs that are seen."""
END_NOISE = 0.1
"""And of a hidden limb's at the ends of its gap, where it is seen badly."""
REPETITION_SPREAD, REPETITION_MEMORY = 0.15, 0.5
"""Radians by which a person's repetitions differ where a class says nothing, and seconds that such differences last."""
WANDER, WANDER_MEMORY = 0.7, 4.0
"""Radians, spread of a limb of which no motion is known, after so many seconds."""


class Expected(NamedTuple):
    """Angles (D, A) that are expected, their spread (D, A), how long deviations last, and who says so."""

    mean: np.ndarray
    spread: np.ndarray
    memory: float
    source: str


@dataclass(frozen=True, eq=False)
class GapContext:
    """A track as its gaps are filled.

    Attributes
    ----------
    poses : float64 (T, P)
    times : float64 (T,), seconds
    hidden : limb -> bool (T,)
    allocation : of the T frames
    classes : that the allocation is of
    """

    poses: np.ndarray
    times: np.ndarray
    hidden: dict[str, np.ndarray]
    allocation: Allocation
    classes: Sequence[MotionClass]


def fill(told: GapContext, gap: Gap) -> tuple[Bridge, str]:
    """The angles of a limb over a gap, bridged from end to end, and what they come from."""
    rows = np.arange(gap.start, gap.stop)
    entries = ENTRIES[gap.limb]
    before, after = gap.start - 1, gap.stop
    around = np.concatenate([[max(before, 0)], rows, [min(after, len(told.times) - 1)]])
    expected = expect(told, gap.limb, around)
    noise = np.full(len(entries), END_NOISE**2)
    ends: list[End | None] = []
    for frame, place in ((before, 0), (after, -1)):
        inside = 0 <= frame < len(told.times) and not told.hidden[gap.limb][frame]
        ends.append(End(told.poses[frame, entries] - expected.mean[place], noise) if inside else None)
    start, stop = told.times[around[0]], told.times[around[-1]]
    found = bridge(
        expected.mean[1:-1], expected.spread[1:-1], expected.memory, told.times[rows] - start, stop - start, *ends
    )
    limits = skeleton.POSE_LIMITS[entries]
    return Bridge(np.clip(found.mean, limits[:, 0], limits[:, 1]), found.variance), expected.source


def expect(told: GapContext, limb: str, frames: np.ndarray) -> Expected:
    """What is expected of a limb in some frames (D,), before its own angles around them are looked at.

    Sources are joined by inverse variance frame by frame; frames without any hold the mean of the others, and wander.
    """
    entries = ENTRIES[limb]
    shape = (len(frames), len(entries))
    weights, total, memory, sources = np.zeros(shape), np.zeros(shape), 0.0, []
    for source in (class_motion, repetitions):
        found = source(told, limb, frames)
        if found is None:
            continue
        known = np.isfinite(found.mean)
        weight = np.where(known, found.spread**-2, 0.0)
        weights += weight
        total += np.where(known, weight * np.nan_to_num(found.mean), 0.0)
        memory = max(memory, found.memory)
        sources.append(found.source)
    known = weights[:, 0] > 0.0
    if not known.any():
        held = np.zeros(shape)
        return Expected(held, np.full(shape, WANDER), WANDER_MEMORY, "interpolation")
    mean = np.where(weights > 0.0, total / np.maximum(weights, 1e-12), 0.0)
    spread = np.where(weights > 0.0, np.maximum(weights, 1e-12) ** -0.5, WANDER)
    nearest = np.abs(np.arange(len(frames))[:, None] - np.flatnonzero(known)[None]).argmin(axis=1)
    return Expected(mean[np.flatnonzero(known)[nearest]], spread, memory, " and ".join(sources))


def class_motion(told: GapContext, limb: str, frames: np.ndarray) -> Expected | None:
    """The class's mean motion, moved by what the limbs that are seen say about this one; NaN without a label."""
    entries = ENTRIES[limb]
    mean = np.full((len(frames), len(entries)), np.nan)
    spread, memory = np.full(mean.shape, WANDER), 0.0
    gains: dict[tuple[int, bytes], tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    for place, frame in enumerate(frames):
        row = int(told.allocation.label[frame])
        motion = told.classes[row].motion if row >= 0 else None
        if motion is None:
            continue
        column = int(told.allocation.column[frame])
        hidden = np.array([told.hidden[other][frame] or other == limb for other in LIMBS])
        key = (row, hidden.tobytes())
        if key not in gains:
            gains[key] = _gain(motion.covariance, entries - ROOT, hidden)
        seen, gain, kept = gains[key]
        away = told.poses[frame, ROOT + seen] - motion.mean[column, seen]
        mean[place] = motion.mean[column, entries - ROOT] + linear.times(gain, away)
        spread[place] = motion.spread[column, entries - ROOT] * kept
        memory = max(memory, motion.memory)
    return Expected(mean, spread, memory, "class") if np.isfinite(mean).any() else None


def _gain(covariance: np.ndarray, wanted: np.ndarray, hidden: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles that are seen (S,), gain (A, S) of the wanted ones on them, and the share of the spread that is left."""
    taken = np.concatenate([ENTRIES[limb] - ROOT for limb, gone in zip(LIMBS, hidden, strict=True) if gone])
    seen = np.setdiff1d(np.arange(len(covariance)), taken)
    among = linear.inverse(covariance[np.ix_(seen, seen)] + SEEN_NOISE**2 * np.eye(len(seen)))
    across = np.ascontiguousarray(covariance[np.ix_(wanted, seen)])
    gain = np.stack([linear.times(among, row) for row in across])
    own = np.diag(covariance)[wanted]
    left = np.clip(1.0 - (gain * across).sum(axis=1) / np.maximum(own, 1e-9), 0.05, 1.0)
    return seen, gain, np.sqrt(left)


def repetitions(told: GapContext, limb: str, frames: np.ndarray) -> Expected | None:
    """The person's own other stretches of the same label in which this limb was seen (thesis 6.4.1, 6.4.3)."""
    allocation, entries = told.allocation, ENTRIES[limb]
    mean = np.full((len(frames), len(entries)), np.nan)
    spread = np.full(mean.shape, REPETITION_SPREAD)
    seen = ~told.hidden[limb] & (allocation.label >= 0)
    for place, frame in enumerate(frames):
        same = (
            seen
            & (allocation.label == allocation.label[frame])
            & (allocation.stretch != allocation.stretch[frame])
            & (np.abs(allocation.column - allocation.column[frame]) <= 1)
        )
        if allocation.label[frame] < 0 or not same.any():
            continue
        own = told.poses[same][:, entries]
        stretches = len(np.unique(allocation.stretch[same]))
        mean[place] = own.mean(axis=0)
        spread[place] = np.sqrt(REPETITION_SPREAD**2 / stretches + own.var(axis=0) / len(own))
    if not np.isfinite(mean).any():
        return None
    return Expected(mean, spread, REPETITION_MEMORY, "repetitions")
