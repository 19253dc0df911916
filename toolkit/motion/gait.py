"""Gait: strides of a person who walks, from where heels are before and toes are behind the pelvis.

A foot touches down where its heel is farthest ahead of the pelvis, and lifts off where it is farthest behind (Zeni
2008, Gait & Posture 27): that needs neither a force plate nor a floor, and noise of the heights does not matter.
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
WALKING = 0.35
"""Metres a second: a pelvis that is faster for a second walks."""
PACE = 0.35
"""Seconds, standard deviation of the Gaussian over the path of the pelvis: a step sways, several do not."""
SMOOTHING = 0.05
"""The same over the places of heels and balls before events are looked for."""
SHORTEST, LONGEST = 0.6, 2.5
"""Seconds of a stride."""
REACH = 0.08
"""Metres that a foot swings ahead of the pelvis at least."""
STANCE = (0.35, 0.85)
"""Shares of a stride that a foot may carry."""


@dataclass(frozen=True)
class Stride:
    """From one touch-down of a foot to its next.

    Attributes
    ----------
    side : "left" or "right"
    start, lift, end : seconds of touch-down, toe-off and the next touch-down
    length : metres along the ground that the foot was put forward
    width : metres sideways from the other foot's placement in between, NaN where there is none
    step : metres along the ground from the other foot's placement in between to the new one, NaN where there is none
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
        """Seconds."""
        return self.end - self.start

    @property
    def stance(self) -> float:
        """Share of the stride in which the foot carries."""
        return (self.lift - self.start) / self.duration


@dataclass(frozen=True)
class Gait:
    """What strides come to; NaN where there is none.

    Attributes
    ----------
    strides : in order of their start
    walking : seconds in which the person walks
    note : why there is no stride
    """

    strides: tuple[Stride, ...] = ()
    walking: float = 0.0
    note: str = field(default="", compare=False)

    def mean(self, name: str, side: str | None = None) -> float:
        """Mean of an attribute of the strides of one side or both."""
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
        """All figures by name, with their units."""
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
    """The strides in poses (T, P) in a y-up frame at `times` (T,), seconds; `known` is bool (T,)."""
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
    """Why there is no stride, from the times of the stretches in which the person is known."""
    if stretches and max(float(own[-1] - own[0]) for own in stretches) < SHORTEST:
        return "too short for a stride"
    return "no whole stride was walked" if walking else "the person does not walk"


def _bouts(poses: np.ndarray, times: np.ndarray) -> list[slice]:
    """Stretches in which the pelvis travels."""
    if len(times) < 4:
        return []
    moving = np.linalg.norm(_course(poses[:, [0, 2]], times), axis=1) > WALKING
    return [span for span in spans(moving) if span.stop - span.start >= frames_in(SHORTEST, times)]


def _course(path: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Velocity of the pelvis along the ground (T, 2), metres a second, without its swaying."""
    return smoothed(np.gradient(path, typical_step(times), axis=0), times, PACE)


def _strides(body: Body, poses: np.ndarray, times: np.ndarray) -> list[Stride]:
    pelvis = poses[:, ROOT_POSITION]
    flat = smoothed(soles(body, poses)[..., [0, 2]], times, SMOOTHING)
    ankles = smoothed(body.joint_positions(poses)[:, ANKLES][..., [0, 2]], times, SMOOTHING)
    path = smoothed(pelvis[:, [0, 2]], times, SMOOTHING)
    ahead = _course(pelvis[:, [0, 2]], times)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    touches, lifts = [], []
    for side in range(2):
        heel = ((flat[:, side, 0] - path) * ahead).sum(axis=1)
        ball = ((flat[:, side, 1] - path) * ahead).sum(axis=1)
        touches.append(_peaks(heel, times))
        lifts.append(_peaks(-ball, times))
    found = []
    for side in range(2):
        for start, end in zip(touches[side][:-1], touches[side][1:], strict=True):
            between = [t for t in lifts[side] if start < t < end]
            if not between or not SHORTEST <= end - start <= LONGEST:
                continue
            stride = _measured(side, (start, between[0], end), touches[1 - side], ankles, times)
            if STANCE[0] <= stride.stance <= STANCE[1]:
                found.append(stride)
    return found


def _measured(
    side: int, events: tuple[float, float, float], others: list[float], ankles: np.ndarray, times: np.ndarray
) -> Stride:
    """One stride with its lengths, from the places of the ankles (T, 2, 2) while the feet stand: they are better known
    than heels, which go astray with the foot's inversion.
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


STAND = (0.08, 0.25)
"""Seconds after a touch-down in which the foot is flat and stands: its place is the median of these frames."""


def _stand(ankle: np.ndarray, times: np.ndarray, touch: float) -> np.ndarray:
    """Where an ankle (T, 2) stands after its foot touched down."""
    rows = (times >= touch + STAND[0]) & (times <= touch + STAND[1])
    if not rows.any():
        return np.asarray(ankle[int(np.abs(times - touch).argmin())])
    return np.asarray(np.median(ankle[rows], axis=0))


def _peaks(values: np.ndarray, times: np.ndarray) -> list[float]:
    """Times of the maxima of values (T,), at least `REACH` prominent, between the frames by a parabola."""
    from scipy.signal import find_peaks

    apart = max(1, frames_in(0.6 * SHORTEST, times))
    rows, _ = find_peaks(values, prominence=REACH, distance=apart)
    found = []
    for i in rows:
        a, b, c = values[i - 1], values[i], values[i + 1]
        shift = 0.5 * (a - c) / (a - 2.0 * b + c) if a - 2.0 * b + c < 0 else 0.0
        found.append(float(times[i] + shift * typical_step(times)))
    return found
