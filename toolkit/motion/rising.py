"""Rises from a seat or a squat: their number, start and duration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body.body import Body
from toolkit.body.sole import soles
from toolkit.io.spans import spans
from toolkit.motion.contact import frames_in, smoothed, typical_step

SEAT_TOLERANCE = 0.02
"""Metres within which the height of the pelvis on a seat varies."""


@dataclass(frozen=True)
class Rise:
    """Rise from a low position to standing.

    Attributes
    ----------
    start, end : seconds at 5 and 95 % of the ascent of the pelvis
    lowest, highest : metres of the hips above the feet
    seated : True if the pelvis rested before (sit-to-stand), False at the end of a squat
    """

    start: float
    end: float
    lowest: float
    highest: float
    seated: bool

    @property
    def duration(self) -> float:
        """Duration in seconds."""
        return self.end - self.start


def rises_of(body: Body, poses: np.ndarray, times: np.ndarray, known: np.ndarray) -> tuple[Rise, ...]:
    """Return the rises in poses (T, P) in a y-up frame at `times` (T,), seconds; `known` is bool (T,)."""
    standing = -float(soles(body, np.zeros((1, poses.shape[1])))[0, ..., 1].min())
    found: list[Rise] = []
    smoothing = 0.08  # seconds, standard deviation of the Gaussian over the height of the pelvis
    for span in spans(known):
        ground = soles(body, poses[span])[..., 1].min(axis=(1, 2))
        floor = float(np.percentile(ground, 20))
        height = smoothed(poses[span, 1] - floor, times[span], smoothing)
        found += _rises(height, times[span], standing)
    return tuple(found)


def _rises(height: np.ndarray, times: np.ndarray, standing: float) -> list[Rise]:
    """Return the rises in the height (T,) of the hips above the feet."""
    found = []
    below, above = 0.75 * standing, 0.92 * standing  # hip heights below which a person is down, above which one stands
    low, high = height < below, height > above
    onset = 0.05  # fraction of the ascent at which a rise begins, and of the rest at which it ends
    seat_seconds = 0.30  # seconds that a person sits at least
    # Smallest time on the seat as a fraction of the ascent; at the bottom of a squat, modelled as a cosine, it is
    # 0.5.
    seat_share = 0.60
    for down in spans(_until(low, high)):
        if down.stop >= len(height):
            continue  # still down at the end
        bottom = down.start + int(height[down].argmin())
        up = spans(height[down.stop - 1 :] > below)
        top = int(down.stop - 1 + up[0].start) if up else down.stop
        top = _top(height, max(top, bottom), times)
        lowest, highest = _level(height, bottom, times), float(height[top])
        way = (height[bottom : top + 1] - lowest) / max(highest - lowest, 1e-6)
        begin = bottom + int(np.flatnonzero(way <= onset)[-1]) if (way <= onset).any() else bottom
        end = bottom + int(np.argmax(way >= 1.0 - onset))
        still = height[down] - height[bottom] < SEAT_TOLERANCE
        start, done = _crossing(way, times, bottom, begin, onset), float(times[end])
        longest = max((s.stop - s.start for s in spans(still)), default=0)
        seated = longest >= frames_in(max(seat_seconds, seat_share * (done - start)), times)
        found.append(Rise(start, done, lowest, highest, seated))
    return found


def _until(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return a mask of the frames from a low position until standing."""
    last = np.maximum.accumulate(np.where(low | high, np.arange(len(low)), -1))
    return low[last] & (last >= 0)


def _top(height: np.ndarray, start: int, times: np.ndarray) -> int:
    """Return the frame after `start` at which the hips stop rising."""
    i, reach = start, frames_in(0.2, times)
    while i + 1 < len(height) and height[i : i + reach + 1].max() > height[i] + 1e-3:
        i += 1
    return i


def _level(height: np.ndarray, bottom: int, times: np.ndarray) -> float:
    """Return the height on the seat: the median near the lowest frame, which noise does not lower."""
    near = height[max(0, bottom - frames_in(1.0, times)) : bottom + frames_in(1.0, times)]
    return float(np.median(near[near < height[bottom] + SEAT_TOLERANCE]))


def _crossing(way: np.ndarray, times: np.ndarray, bottom: int, row: int, level: float) -> float:
    """Return the time in seconds at which the ascent crosses a level after `row`, interpolated."""
    k = row - bottom
    if k + 1 >= len(way) or way[k + 1] <= way[k]:
        return float(times[row])
    share = np.clip((level - way[k]) / (way[k + 1] - way[k]), 0.0, 1.0)
    return float(times[row] + share * typical_step(times))
