"""Sit-to-stand and squats: how often a person rises, and how long it takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.body.body import Body
from toolkit.body.sole import soles
from toolkit.io.spans import spans
from toolkit.motion.contact import frames_in, smoothed, typical_step

LOW, HIGH = 0.75, 0.92
"""Shares of the height of the standing hips below which a person is down, and above which they stand."""
SMOOTHING = 0.08
"""Seconds, standard deviation of the Gaussian over the height of the pelvis."""
ONSET, DONE = 0.05, 0.95
"""Shares of the way up at which a rise begins and ends."""
RESTING, REST, SHARE = 0.02, 0.30, 0.60
"""Metres within which the pelvis stays on a seat, for so many seconds and for such a share of the way up; at the bottom
of a squat it turns at once (of a cosine it is half as long as the way up)."""


@dataclass(frozen=True)
class Rise:
    """From down to standing.

    Attributes
    ----------
    start, end : seconds at which the pelvis has 5 and 95 % of its way up behind it
    lowest, highest : metres of the hips over the feet
    seated : whether the pelvis rested before; else it is the end of a squat
    """

    start: float
    end: float
    lowest: float
    highest: float
    seated: bool

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.end - self.start


def rises_of(body: Body, poses: np.ndarray, times: np.ndarray, known: np.ndarray) -> tuple[Rise, ...]:
    """The rises in poses (T, P) in a y-up frame at `times` (T,), seconds; `known` is bool (T,)."""
    standing = -float(soles(body, np.zeros((1, poses.shape[1])))[0, ..., 1].min())
    found: list[Rise] = []
    for span in spans(known):
        ground = soles(body, poses[span])[..., 1].min(axis=(1, 2))
        floor = float(np.percentile(ground, 20))
        height = smoothed(poses[span, 1] - floor, times[span], SMOOTHING)
        found += _rises(height, times[span], standing)
    return tuple(found)


def _rises(height: np.ndarray, times: np.ndarray, standing: float) -> list[Rise]:
    """Rises in the height (T,) of the hips over the feet."""
    found = []
    low, high = height < LOW * standing, height > HIGH * standing
    for down in spans(_until(low, high)):
        if down.stop >= len(height):
            continue  # still down at the end
        bottom = down.start + int(height[down].argmin())
        up = spans(height[down.stop - 1 :] > LOW * standing)
        top = int(down.stop - 1 + up[0].start) if up else down.stop
        top = _top(height, max(top, bottom), times)
        lowest, highest = _level(height, bottom, times), float(height[top])
        way = (height[bottom : top + 1] - lowest) / max(highest - lowest, 1e-6)
        begin = bottom + int(np.flatnonzero(way <= ONSET)[-1]) if (way <= ONSET).any() else bottom
        end = bottom + int(np.argmax(way >= DONE))
        still = height[down] - height[bottom] < RESTING
        start, done = _crossing(way, times, bottom, begin, ONSET), float(times[end])
        longest = max((s.stop - s.start for s in spans(still)), default=0)
        seated = longest >= frames_in(max(REST, SHARE * (done - start)), times)
        found.append(Rise(start, done, lowest, highest, seated))
    return found


def _until(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Frames from where a person is low to where they stand."""
    down, out = False, np.zeros(len(low), dtype=bool)
    for i, (below, above) in enumerate(zip(low, high, strict=True)):
        down = below or (down and not above)
        out[i] = down
    return out


def _top(height: np.ndarray, start: int, times: np.ndarray) -> int:
    """The frame after `start` from which on the hips rise no more."""
    i, reach = start, frames_in(0.2, times)
    while i + 1 < len(height) and height[i : i + reach + 1].max() > height[i] + 1e-3:
        i += 1
    return i


def _level(height: np.ndarray, bottom: int, times: np.ndarray) -> float:
    """Height on the seat: the median within 4 cm of the lowest place, so that noise does not lower it."""
    near = height[max(0, bottom - frames_in(1.0, times)) : bottom + frames_in(1.0, times)]
    return float(np.median(near[near < height[bottom] + RESTING]))


def _crossing(way: np.ndarray, times: np.ndarray, bottom: int, row: int, level: float) -> float:
    """Seconds, between the frames, at which the way crosses a level after `row`."""
    k = row - bottom
    if k + 1 >= len(way) or way[k + 1] <= way[k]:
        return float(times[row])
    share = np.clip((level - way[k]) / (way[k + 1] - way[k]), 0.0, 1.0)
    return float(times[row] + share * typical_step(times))
