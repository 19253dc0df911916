"""Gait: strides of a walking person, from the positions of heels and toes relative to the pelvis.

A foot touches down where its heel is farthest ahead of the pelvis, and lifts off where its ball is farthest behind
(Zeni 2008, Gait & Posture 27). The method needs no force plate and no floor, and does not depend on the noise of
heights.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from toolkit.body.body import Body
from toolkit.body.skeleton import ROOT_POSITION
from toolkit.body.sole import soles
from toolkit.io.spans import spans
from toolkit.motion.contact import ANKLES, frames_in, smoothed, typical_step

SIDES = ("left", "right")


SHORTEST_STRIDE = 0.6
"""Shortest duration of a stride, seconds."""


@dataclass(frozen=True)
class Stride:
    """Stride from one touch-down of a foot to its next.

    Attributes
    ----------
    side : "left" or "right"
    start, lift, end : seconds of touch-down, toe-off and the next touch-down
    length : metres along the ground between the two placements of the foot
    width : metres sideways from the other foot's placement in between, NaN if it has none
    step : metres along the ground from the other foot's placement in between to the new one, NaN if it has none
    """

    side: str
    start: float
    lift: float
    end: float
    length: float
    width: float
    step: float

    @property
    def duration(self) -> float:
        """Duration in seconds."""
        return self.end - self.start

    @property
    def stance(self) -> float:
        """Fraction of the stride with foot contact."""
        return (self.lift - self.start) / self.duration


@dataclass(frozen=True)
class Gait:
    """Gait figures of the strides of one person; NaN if there are none.

    Attributes
    ----------
    strides : strides, sorted by start
    walking : seconds of walking
    note : reason if there is no stride
    """

    strides: tuple[Stride, ...] = ()
    walking: float = 0.0
    note: str = field(default="", compare=False)

    def mean(self, name: str, side: str | None = None) -> float:
        """Return the mean of an attribute over the strides of one side or both."""
        values = [getattr(stride, name) for stride in self.strides if side in (None, stride.side)]
        values = [value for value in values if np.isfinite(value)]
        return float(np.mean(values)) if values else float("nan")

    @property
    def cadence(self) -> float:
        """Steps a minute."""
        return 120.0 / self.mean("duration")

    @property
    def speed(self) -> float:
        """Metres a second."""
        return self.mean("length") / self.mean("duration")

    def figures(self) -> dict[str, float]:
        """Return all figures by name, with their units."""
        found = {
            "strides": float(len(self.strides)), "walking_s": self.walking, "stride_length_m": self.mean("length"),
            "cadence_steps_per_min": self.cadence, "speed_m_per_s": self.speed, "step_width_m": self.mean("width"),
            "stance_share": self.mean("stance"), "stride_time_s": self.mean("duration"),
        }  # fmt: skip
        for side in SIDES:
            found[f"step_length_{side}_m"] = self.mean("step", side)
            found[f"stance_share_{side}"] = self.mean("stance", side)
        return found


def walk_of(body: Body, poses: np.ndarray, times: np.ndarray, known: np.ndarray) -> Gait:
    """Return the gait of poses (T, P) in a y-up frame at `times` (T,), seconds; `known` is bool (T,)."""
    strides: list[Stride] = []
    walking = 0.0
    for span in spans(known):
        for part in _bouts(poses[span], times[span]):
            rows = slice(span.start + part.start, span.start + part.stop)
            walking += float(times[rows][-1] - times[rows][0])
            strides += _strides(body, poses[rows], times[rows])
    note = "" if strides else _why_none(walking, [times[span] for span in spans(known)])
    return Gait(tuple(sorted(strides, key=lambda stride: stride.start)), walking, note)


def _why_none(walking: float, stretches: list[np.ndarray]) -> str:
    """Return the reason for a missing stride, from the times of the runs with a tracked person."""
    if stretches and max(float(own[-1] - own[0]) for own in stretches) < SHORTEST_STRIDE:
        return "too short for a stride"
    return "no whole stride was walked" if walking else "the person does not walk"


def _bouts(poses: np.ndarray, times: np.ndarray) -> list[slice]:
    """Return the runs of frames in which the pelvis travels."""
    if len(times) < 4:
        return []
    walking_speed = 0.35  # metres a second, smallest speed of the pelvis of a walking person
    moving = np.linalg.norm(_course(poses[:, [0, 2]], times), axis=1) > walking_speed
    return [span for span in spans(moving) if span.stop - span.start >= frames_in(SHORTEST_STRIDE, times)]


def _course(path: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the velocity of the pelvis along the ground (T, 2), metres a second, without its sway."""
    # Seconds, standard deviation of the Gaussian over the velocity of the pelvis; it averages several steps, because
    # the pelvis sways with each.
    course_smoothing = 0.35
    return smoothed(np.gradient(path, typical_step(times), axis=0), times, course_smoothing)


def _strides(body: Body, poses: np.ndarray, times: np.ndarray) -> list[Stride]:
    pelvis = poses[:, ROOT_POSITION]
    smoothing = 0.05  # seconds, standard deviation of the Gaussian over heels and balls before events are detected
    flat = smoothed(soles(body, poses)[..., [0, 2]], times, smoothing)
    ankles = smoothed(body.joint_positions(poses)[:, ANKLES][..., [0, 2]], times, smoothing)
    path = smoothed(pelvis[:, [0, 2]], times, smoothing)
    ahead = _course(pelvis[:, [0, 2]], times)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    touches, lifts = [], []
    for side in range(2):
        heel = ((flat[:, side, 0] - path) * ahead).sum(axis=1)
        ball = ((flat[:, side, 1] - path) * ahead).sum(axis=1)
        touches.append(_peaks(heel, times))
        lifts.append(_peaks(-ball, times))
    found = []
    longest_stride = 2.5  # longest duration of a stride, seconds
    stance_range = (0.35, 0.85)  # plausible fractions of a stride with foot contact
    for side in range(2):
        for start, end in zip(touches[side][:-1], touches[side][1:], strict=True):
            between = [t for t in lifts[side] if start < t < end]
            if not between or not SHORTEST_STRIDE <= end - start <= longest_stride:
                continue
            stride = _measured(side, (start, between[0], end), touches[1 - side], ankles, times)
            if stance_range[0] <= stride.stance <= stance_range[1]:
                found.append(stride)
    return found


def _measured(
    side: int, events: tuple[float, float, float], others: list[float], ankles: np.ndarray, times: np.ndarray
) -> Stride:
    """Return one stride with its lengths, from the standing positions of the ankles (T, 2, 2).

    Ankles are more accurate than heels, whose error grows with the foot's inversion.
    """
    start, lift, end = events
    first, last = _stand(ankles[:, side], times, start), _stand(ankles[:, side], times, end)
    along = last - first
    length = float(np.linalg.norm(along))
    middle = [t for t in others if start < t < end]
    width = step = float("nan")
    if middle and length > 0:
        other = _stand(ankles[:, 1 - side], times, middle[0]) - first
        forward = along / length
        width = float(abs(forward[0] * other[1] - forward[1] * other[0]))
        step = float(length - other @ forward)
    return Stride(SIDES[side], start, lift, end, length, width, step)


def _stand(ankle: np.ndarray, times: np.ndarray, touch: float) -> np.ndarray:
    """Return the standing position of an ankle (T, 2) after its foot touched down."""
    # Seconds after a touch-down between which the foot is flat; its place is the median of these frames.
    stand = (0.08, 0.25)
    rows = (times >= touch + stand[0]) & (times <= touch + stand[1])
    if not rows.any():
        return np.asarray(ankle[int(np.abs(times - touch).argmin())])
    return np.asarray(np.median(ankle[rows], axis=0))


def _peaks(values: np.ndarray, times: np.ndarray) -> list[float]:
    """Return the times of the maxima of values (T,) with the prominence `swing`, refined by a parabola."""
    from scipy.signal import find_peaks

    apart = max(1, frames_in(0.6 * SHORTEST_STRIDE, times))
    swing = 0.08  # metres, smallest distance that a foot swings ahead of the pelvis
    rows, _ = find_peaks(values, prominence=swing, distance=apart)
    found = []
    for i in rows:
        a, b, c = values[i - 1], values[i], values[i + 1]
        shift = 0.5 * (a - c) / (a - 2.0 * b + c) if a - 2.0 * b + c < 0 else 0.0
        found.append(float(times[i] + shift * typical_step(times)))
    return found
