"""Figures 7.12 to 7.14 of the thesis with simulated sensors: thresholds, raw signals, wrong offsets."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.metrics import roc_auc_score

from benchmarks._record import drawn
from toolkit.body.rotations import quaternions as quat
from toolkit.evaluation.orientations import THRESHOLDS
from toolkit.inertial.calibrate import CalibrationSequence
from toolkit.inertial.calibration import Calibration
from toolkit.inertial.stream import GRAVITY
from toolkit.retrieval.annotation.measures import Scores

SWEPT = {"precision": "black", "recall": "tab:red", "f": "tab:green"}
"""Figures over thresholds, and their colours."""
TRUTHS = {"off by 45 degrees": "-", "injected": "--"}
"""Definition of an error, in place of the thesis's annotators -> line style."""
SIGNALS = ("orientation", "rate of turn", "acceleration")


def frame_counts(full: np.ndarray, wrong: np.ndarray, threshold: float) -> Scores:
    """Return the scores of frames of a curve (T,) above a threshold, degrees, against the wrong ones, bool (T,)."""
    known, found = np.isfinite(full), np.nan_to_num(full) > threshold
    both = int((wrong & found & known).sum())
    return Scores(both, int((found & known).sum()), both, int((wrong & known).sum()))


def over_thresholds(full: np.ndarray, truths: Mapping[str, np.ndarray]) -> dict[str, dict[str, list[float]]]:
    """Return precision, recall and F of a curve (T,), degrees, against wrong frames, bool (T,), at each threshold."""
    found = {}
    for truth, wrong in truths.items():
        scores = [frame_counts(full, wrong, float(threshold)) for threshold in THRESHOLDS]
        found[truth] = {key: [getattr(score, key) for score in scores] for key in SWEPT}
    return found


def plot_thresholds(kinds: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Plot Fig. 7.12: precision, recall and F over thresholds, one panel per kind of limb."""
    with drawn(path, (4.0 * len(kinds), 3.4), 1, len(kinds)) as panels:
        for panel, (kind, truths) in zip(panels, kinds.items(), strict=True):
            for truth, line in TRUTHS.items():
                for key, colour in SWEPT.items():
                    panel.plot(THRESHOLDS, truths[truth][key], line, color=colour, label=f"{key}, {truth}")
            panel.set(title=kind, xlabel="threshold, degrees", ylim=(0, 1.02))
            panel.grid(alpha=0.3)
        panels[0].legend(fontsize=6)


def signals_of(
    take: CalibrationSequence, calibration: Calibration, limb: str
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return rates of turn, rad/s, and accelerations, m/s2, in the limb's frame: of sensor and track, (T, 3) each.

    The track's are differences of its frames; the sensor's, NaN where it measured nothing, are brought into the limb's
    frame by its mounting `q_L`.
    """
    stream = take.sensors.named(limb)
    assert stream.gyro is not None and stream.acceleration is not None  # simulated
    moments = take.clock.sensor_times(take.motion.times)

    def measured(values: np.ndarray) -> np.ndarray:
        own = stream.times[stream.valid]
        columns = [np.interp(moments, own, column, np.nan, np.nan) for column in values[stream.valid].T]
        return quat.rotate(calibration.mounting(limb), np.stack(columns, axis=1))

    times, orientation = take.motion.times, take.motion.orientation(limb)
    turned = quat.angular_velocity(orientation, times)
    path = take.motion.middle(limb)
    pulled = np.gradient(np.gradient(path, times, axis=0), times, axis=0) + [0.0, GRAVITY, 0.0]
    return {
        "rate of turn": (measured(stream.gyro), np.concatenate([turned, turned[-1:]])),
        "acceleration": (measured(stream.acceleration), quat.rotate(quat.conjugate(orientation), pulled)),
    }


def told_apart(values: np.ndarray, wrong: np.ndarray) -> float | None:
    """Return the probability that a wrong frame has a larger value than a correct one (ties count half), or None."""
    values, wrong = values[np.isfinite(values)], wrong[np.isfinite(values)]
    return float(roc_auc_score(wrong, values)) if wrong.any() and not wrong.all() else None


def plot_signals(
    times: np.ndarray, signals: Mapping[str, tuple[np.ndarray, np.ndarray]], wrong: np.ndarray, path: Path
) -> None:
    """Plot Fig. 7.13: three components of each signal of sensor (red) and track (black), wrong frames shaded."""
    with drawn(path, (11, 9), 3 * len(signals), sharex=True) as panels:
        for row, (name, (sensor, track)) in enumerate(signals.items()):
            for axis, panel in enumerate(panels[3 * row : 3 * row + 3]):
                panel.plot(times, sensor[:, axis], color="tab:red", lw=0.9)
                panel.plot(times, track[:, axis], color="black", lw=0.9)
                panel.fill_between(times, *panel.get_ylim(), where=wrong, color="0.85", lw=0, zorder=0)
                panel.set_ylabel(f"{name}, {'xyz'[axis]}", fontsize=7)
        panels[-1].set_xlabel("time, s")


def example_of_offsets() -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return Fig. 7.14: distances (640,), degrees, with correct, one wrong and two wrong offsets; and correct frames.

    640 orientations, of which those of frames 50 to 200 and 400 to 600 are tracked wrongly.
    """
    frames = np.arange(640)
    steps = np.stack([np.sin(0.013 * frames), 0.8 * np.sin(0.021 * frames + 1), np.cos(0.017 * frames)], axis=1)
    inertial = quat.exponential(1.2 * steps)
    error = np.zeros((640, 3))
    error[50:201, 0] = np.radians(70.0) * np.linspace(0, 1, 151)
    error[400:601, 1] = np.radians(110.0) * np.sin(np.linspace(0, np.pi, 201))
    tracked = quat.multiply(inertial, quat.exponential(error))

    def distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return the distance of Eq. 7.17."""
        return np.degrees(quat.angle(inertial, quat.multiply(quat.multiply(b, tracked), a)))

    a, b = quat.exponential([1.1, -0.9, 0.7]), quat.exponential([-0.8, 1.3, 0.5])
    curves = {
        "both offsets right": distance(quat.IDENTITY, quat.IDENTITY),
        "one wrong": distance(quat.IDENTITY, b),
        "both wrong": distance(a, b),
    }
    return curves, (error == 0.0).all(axis=1)


def plot_offsets(curves: Mapping[str, np.ndarray], right: np.ndarray, path: Path) -> None:
    """Plot the curves in rows, wrong frames shaded."""
    with drawn(path, (9, 5), len(curves), sharex=True) as panels:
        for panel, (name, values) in zip(panels, curves.items(), strict=True):
            panel.plot(values, color="black", lw=1.0)
            panel.fill_between(np.arange(len(values)), 0.0, 180.0, where=~right, color="0.85", lw=0, zorder=0)
            panel.set(ylim=(0, 180), ylabel="degrees")
            panel.set_title(name, fontsize=9, loc="left")
        panels[-1].set_xlabel("frame")


def offset_figures(curves: Mapping[str, np.ndarray], right: np.ndarray) -> dict[str, Any]:
    """Return the separation of wrong frames by a threshold."""
    return {name: {"told apart": told_apart(np.round(values, 6), ~right)} for name, values in curves.items()}


def mean_told(told: Sequence[dict[str, float | None]]) -> dict[str, float]:
    """Return the means over limbs and recordings of each signal."""
    return {name: float(np.mean([row[name] for row in told if row[name] is not None])) for name in SIGNALS}
