"""Strides by loops over frames, from heels, balls, ankles and pelvis: the reference for `biomechanics.gait`.

Zeni 2008: a foot touches down where its heel is farthest ahead of the pelvis and lifts off where its ball is farthest
behind. The person is known and walks in all frames, and frames are equally long apart.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np


class PlainStride(NamedTuple):
    """Touch-down, toe-off and next touch-down, seconds; length, width and step, metres (NaN if unknown)."""

    side: int
    start: float
    lift: float
    end: float
    length: float
    width: float
    step: float


def plain_strides(soles: np.ndarray, ankles: np.ndarray, pelvis: np.ndarray, rate: float) -> list[PlainStride]:
    """Return strides by side and start, from soles (T, 2, 2, 3), ankles (T, 2, 3) and pelvis (T, 3), y up."""
    count, step = len(pelvis), 1.0 / rate
    course = [0.0] * count, [0.0] * count
    for axis, own in zip((0, 2), course, strict=True):
        for t in range(count):
            before, after = max(t - 1, 0), min(t + 1, count - 1)
            own[t] = (pelvis[after, axis] - pelvis[before, axis]) / ((after - before) * step)
    heading = [blurred(own, 0.35 * rate) for own in course]
    path = [blurred(list(pelvis[:, axis]), 0.05 * rate) for axis in (0, 2)]
    touches: list[list[float]] = []
    lifts: list[list[float]] = []
    for side in range(2):
        ahead = []
        for point in range(2):
            place = [blurred(list(soles[:, side, point, axis]), 0.05 * rate) for axis in (0, 2)]
            ahead.append([
                sum((place[k][t] - path[k][t]) * heading[k][t] for k in range(2))
                / math.hypot(heading[0][t], heading[1][t])
                for t in range(count)
            ])  # fmt: skip
        touches.append(summits(ahead[0], 0.08, round(0.36 * rate), rate))
        lifts.append(summits([-value for value in ahead[1]], 0.08, round(0.36 * rate), rate))
    stands = [[blurred(list(ankles[:, side, axis]), 0.05 * rate) for axis in (0, 2)] for side in range(2)]

    def stand(side: int, touch: float) -> tuple[float, float]:
        rows = [t for t in range(count) if touch + 0.08 <= t / rate <= touch + 0.25]
        if not rows:
            rows = [min(range(count), key=lambda t: abs(t / rate - touch))]
        x, z = (sorted(stands[side][k][t] for t in rows) for k in range(2))
        return middle(x), middle(z)

    found = []
    for side in range(2):
        for start, end in zip(touches[side], touches[side][1:], strict=False):
            lift = next((time for time in lifts[side] if start < time < end), None)
            if lift is None or not 0.6 <= end - start <= 2.5 or not 0.35 <= (lift - start) / (end - start) <= 0.85:
                continue
            (x, z), (u, v) = stand(side, start), stand(side, end)
            length = math.hypot(u - x, v - z)
            width = along = math.nan
            other = next((time for time in touches[1 - side] if start < time < end), None)
            if other is not None:
                p, q = stand(1 - side, other)
                width = abs((u - x) * (q - z) - (v - z) * (p - x)) / length
                along = length - ((p - x) * (u - x) + (q - z) * (v - z)) / length
            found.append(PlainStride(side, start, lift, end, length, width, along))
    return found


def middle(ordered: list[float]) -> float:
    """Return the median of numbers in order."""
    half = len(ordered) // 2
    return ordered[half] if len(ordered) % 2 else 0.5 * (ordered[half - 1] + ordered[half])


def blurred(values: list[float], deviation: float) -> list[float]:
    """Return values filtered by a Gaussian of a standard deviation in frames, cut at four deviations, ends mirrored."""
    count, reach = len(values), int(4.0 * deviation + 0.5)
    weights = {k: math.exp(-0.5 * (k / deviation) ** 2) for k in range(-reach, reach + 1)}
    total = sum(weights.values())
    out = []
    for t in range(count):
        value = 0.0
        for k, weight in weights.items():
            i = (t + k) % (2 * count)
            value += weight * values[i if i < count else 2 * count - 1 - i]
        out.append(value / total)
    return out


def summits(values: list[float], prominence: float, apart: int, rate: float) -> list[float]:
    """Return seconds of the maxima of at least a prominence; of those nearer than `apart` frames the higher."""
    count = len(values)
    inner = [t for t in range(1, count - 1) if values[t - 1] < values[t] > values[t + 1]]
    kept: list[int] = []
    for t in sorted(inner, key=lambda t: -values[t]):
        if all(abs(t - other) >= apart for other in kept):
            kept.append(t)
    found = []
    for t in sorted(kept):
        left = [values[i] for i in range(t) if all(values[j] <= values[t] for j in range(i, t))]
        right = [values[i] for i in range(t + 1, count) if all(values[j] <= values[t] for j in range(t + 1, i + 1))]
        if values[t] - max(min(left), min(right)) >= prominence:
            a, b, c = values[t - 1 : t + 2]
            found.append((t + 0.5 * (a - c) / (a - 2.0 * b + c)) / rate)
    return found
