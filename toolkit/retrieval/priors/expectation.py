"""Expected angles of an occluded limb, from the class motion and from the person's repetitions (thesis 6.4.3)."""

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
from toolkit.retrieval.priors.gaps import Gap
from toolkit.retrieval.priors.limb_entries import ENTRIES, LIMBS

ROOT = skeleton.POSE_SIZE - (ANGLES.stop - ANGLES.start)
"""Entries of a pose before its joint angles."""
UNKNOWN_SPREAD = 0.7
"""Standard deviation of an angle without a motion prior, radians."""


class End(NamedTuple):
    """Deviation of the limb from the expected motion at one end of a gap, (A,) radians, and its variance (A,)."""

    offset: np.ndarray
    variance: np.ndarray


class Bridge(NamedTuple):
    """Angles over a gap, float64 (D, A) radians, and their variance (D, A)."""

    mean: np.ndarray
    variance: np.ndarray


class Expected(NamedTuple):
    """Expected angles (D, A) and their standard deviation (D, A), radians; correlation time, seconds; their source."""

    mean: np.ndarray
    spread: np.ndarray
    memory: float
    source: str


@dataclass(frozen=True, eq=False)
class GapContext:
    """A track of T frames with its occluded limbs and its alignment with motion classes.

    Attributes
    ----------
    poses : float64 (T, P)
    times : float64 (T,), seconds
    hidden : limb -> bool (T,), frames in which it is occluded
    allocation : alignment of the T frames with the classes
    classes : motion classes
    """

    poses: np.ndarray
    times: np.ndarray
    hidden: dict[str, np.ndarray]
    allocation: Allocation
    classes: Sequence[MotionClass]


def fill(context: GapContext, gap: Gap) -> tuple[Bridge, str]:
    """Return the angles of a limb over a gap, bridged from end to end, and the name of their source."""
    rows = np.arange(gap.start, gap.stop)
    entries = ENTRIES[gap.limb]
    before, after = gap.start - 1, gap.stop
    around = np.concatenate([[max(before, 0)], rows, [min(after, len(context.times) - 1)]])
    expected = expect(context, gap.limb, around)
    end_noise = 0.1  # radians, standard deviation of the limb's angles at the ends of its gap
    noise = np.full(len(entries), end_noise**2)
    ends: list[End | None] = []
    for frame, place in ((before, 0), (after, -1)):
        inside = 0 <= frame < len(context.times) and not context.hidden[gap.limb][frame]
        ends.append(End(context.poses[frame, entries] - expected.mean[place], noise) if inside else None)
    start, stop = context.times[around[0]], context.times[around[-1]]
    found = bridge(
        expected.mean[1:-1], expected.spread[1:-1], expected.memory, context.times[rows] - start, stop - start, *ends
    )
    limits = skeleton.POSE_LIMITS[entries]
    return Bridge(np.clip(found.mean, limits[:, 0], limits[:, 1]), found.variance), expected.source


def expect(context: GapContext, limb: str, frames: np.ndarray) -> Expected:
    """Return the expected angles of a limb in some frames (D,), without its own angles around them.

    Sources are averaged by inverse variance in each frame. A frame without a source has the mean of the nearest
    frame that has one, with `UNKNOWN_SPREAD`.
    """
    entries = ENTRIES[limb]
    shape = (len(frames), len(entries))
    weights, total, memory, sources = np.zeros(shape), np.zeros(shape), 0.0, []
    for source in (class_motion, repetitions):
        found = source(context, limb, frames)
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
        unknown_memory = 4.0  # seconds, correlation time of the deviations without a motion prior
        return Expected(np.zeros(shape), np.full(shape, UNKNOWN_SPREAD), unknown_memory, "interpolation")
    mean = np.where(weights > 0.0, total / np.maximum(weights, 1e-12), 0.0)
    spread = np.where(weights > 0.0, np.maximum(weights, 1e-12) ** -0.5, UNKNOWN_SPREAD)
    nearest = np.abs(np.arange(len(frames))[:, None] - np.flatnonzero(known)[None]).argmin(axis=1)
    return Expected(mean[np.flatnonzero(known)[nearest]], spread, memory, " and ".join(sources))


def class_motion(context: GapContext, limb: str, frames: np.ndarray) -> Expected | None:
    """Return the class's motion conditioned on the visible limbs; NaN in frames without a label, None without any."""
    entries = ENTRIES[limb]
    mean = np.full((len(frames), len(entries)), np.nan)
    spread, memory = np.full(mean.shape, UNKNOWN_SPREAD), 0.0
    gains: dict[tuple[int, bytes], tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    for place, frame in enumerate(frames):
        row = int(context.allocation.label[frame])
        motion = context.classes[row].motion if row >= 0 else None
        if motion is None:
            continue
        column = int(context.allocation.column[frame])
        hidden = np.array([context.hidden[other][frame] or other == limb for other in LIMBS])
        key = (row, hidden.tobytes())
        if key not in gains:
            gains[key] = _gain(motion.covariance, entries - ROOT, hidden)
        visible, gain, remaining = gains[key]
        deviation = context.poses[frame, ROOT + visible] - motion.mean[column, visible]
        mean[place] = motion.mean[column, entries - ROOT] + linear.times(gain, deviation)
        spread[place] = motion.spread[column, entries - ROOT] * remaining
        memory = max(memory, motion.memory)
    return Expected(mean, spread, memory, "class") if np.isfinite(mean).any() else None


def _gain(covariance: np.ndarray, wanted: np.ndarray, hidden: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the visible angles (S,), the gain (A, S) of the wanted ones on them, and the remaining spread factor."""
    taken = np.concatenate([ENTRIES[limb] - ROOT for limb, gone in zip(LIMBS, hidden, strict=True) if gone])
    visible = np.setdiff1d(np.arange(len(covariance)), taken)
    noise = 0.12  # radians, standard deviation of the angles of visible limbs
    among = linear.inverse(covariance[np.ix_(visible, visible)] + noise**2 * np.eye(len(visible)))
    across = np.ascontiguousarray(covariance[np.ix_(wanted, visible)])
    gain = np.stack([linear.times(among, row) for row in across])
    own = np.diag(covariance)[wanted]
    remaining = np.clip(1.0 - (gain * across).sum(axis=1) / np.maximum(own, 1e-9), 0.05, 1.0)
    return visible, gain, np.sqrt(remaining)


def repetitions(context: GapContext, limb: str, frames: np.ndarray) -> Expected | None:
    """Return the person's mean angles in other segments of the same label with a visible limb (thesis 6.4.1, 6.4.3)."""
    allocation, entries = context.allocation, ENTRIES[limb]
    between = 0.15  # radians, standard deviation between repetitions of one motion by one person
    mean = np.full((len(frames), len(entries)), np.nan)
    spread = np.full(mean.shape, between)
    visible = ~context.hidden[limb] & (allocation.label >= 0)
    for place, frame in enumerate(frames):
        same = (
            visible
            & (allocation.label == allocation.label[frame])
            & (allocation.stretch != allocation.stretch[frame])
            & (np.abs(allocation.column - allocation.column[frame]) <= 1)
        )
        if allocation.label[frame] < 0 or not same.any():
            continue
        own = context.poses[same][:, entries]
        segments = len(np.unique(allocation.stretch[same]))
        mean[place] = own.mean(axis=0)
        spread[place] = np.sqrt(between**2 / segments + own.var(axis=0) / len(own))
    if not np.isfinite(mean).any():
        return None
    memory = 0.5  # seconds, correlation time of these deviations
    return Expected(mean, spread, memory, "repetitions")


def bridge(
    expected: np.ndarray, spread: np.ndarray, memory: float, seconds: np.ndarray, length: float,
    start: End | None, end: End | None,
) -> Bridge:  # fmt: skip
    """Return the angles of a limb in the frames of a gap, between the expected motion and both ends of the gap.

    Deviations from the expected motion are an Ornstein-Uhlenbeck process: short gaps follow their ends, long gaps
    follow the class. With both ends the mean is `mu + [sinh((D - u) / l) o_a + sinh(u / l) o_b] / sinh(D / l)` and the
    variance `2 s^2 sinh(u / l) sinh((D - u) / l) / sinh(D / l)`, plus that of the ends; an open end drops its term.

    Parameters
    ----------
    expected, spread : (D, A), mean and standard deviation of the expected motion, radians
    memory : `l`, correlation time, seconds
    seconds : (D,), `u`, from the last frame before the gap to each of its frames
    length : `D`, seconds from the last frame before the gap to the first one after it
    start, end : deviations there; None for an open end
    """
    u = np.asarray(seconds, dtype=np.float64)[:, None]
    if start is not None and end is not None:
        near, far = _shares(u, length, memory)
        free = 1.0 - near**2 - far**2 - 2.0 * near * far * np.exp(-length / memory)
    else:
        near = np.exp(-u / memory) if start is not None else np.zeros_like(u)
        far = np.exp(-(length - u) / memory) if end is not None else np.zeros_like(u)
        free = 1.0 - near**2 - far**2
    mean, variance = expected.astype(np.float64), spread**2 * np.clip(free, 0.0, 1.0)
    for share, known in ((near, start), (far, end)):
        if known is not None:
            mean = mean + share * known.offset
            variance = variance + share**2 * known.variance
    return Bridge(mean, variance)


def _shares(u: np.ndarray, length: float, memory: float) -> tuple[np.ndarray, np.ndarray]:
    """Return `sinh((D - u) / l) / sinh(D / l)` and `sinh(u / l) / sinh(D / l)` without overflow."""
    total = -np.expm1(-2.0 * length / memory)
    near = np.exp(-u / memory) * -np.expm1(-2.0 * (length - u) / memory) / total
    far = np.exp(-(length - u) / memory) * -np.expm1(-2.0 * u / memory) / total
    return near, far
