"""Runs of trackers on single recordings, and their figures."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks._takes import is_right, joints_of
from tests.support.solo import Solo
from toolkit.sensing.recording import Recording
from toolkit.tracking.tracker_protocol import Tracker


class Tracked:
    """Joints of one recording.

    Attributes
    ----------
    joints, truth : estimated and true joints (T, 20, 3), metres
    milliseconds : per frame (T,)
    """

    def __init__(self, joints: Any, truth: Any, milliseconds: Any = ()) -> None:
        self.joints, self.truth, self.milliseconds = np.array(joints), np.array(truth), np.array(milliseconds)

    @cached_property
    def errors(self) -> np.ndarray:
        """Distances to the true joints (T, 20), metres."""
        distances: np.ndarray = np.linalg.norm(self.joints - self.truth, axis=2)
        return distances

    @property
    def right(self) -> np.ndarray:
        """Bool (T,) mask of the correct frames."""
        return np.array([is_right(joints, truth) for joints, truth in zip(self.joints, self.truth, strict=True)])


def follow(tracker: Tracker, recording: Recording) -> Tracked:
    """Track a recording."""
    solo = Solo(tracker, recording)
    results = [
        solo.step(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i))
        for i in range(len(recording))
    ]
    return Tracked([r.joints for r in results], recording.joints, [r.stage_ms.sum() for r in results])


def swarm_figures(tracked: Sequence[Tracked]) -> dict[str, float]:
    """Return means over recordings; times over frames, without the first of each."""
    errors = [t.errors for t in tracked]
    figures = {"delta_mm": 1000.0 * float(np.mean([e.mean() for e in errors]))}
    for limit in (50, 80, 100):
        figures[f"a{limit}"] = float(np.mean([(e < limit / 1000.0).mean() for e in errors]))
    figures["right"] = float(np.mean([t.right.mean() for t in tracked]))
    times = np.concatenate([t.milliseconds[1:] for t in tracked])
    if len(times):
        figures["median_ms"], figures["p99_ms"] = (float(np.percentile(times, q)) for q in (50, 99))
    return figures


def print_row(name: str, figures: dict[str, float]) -> None:
    """Print one line: Delta in mm, A(50), A(80), A(100) and correct frames in per cent, times in ms."""
    shares = " ".join(f"{100 * figures[key]:6.1f}" for key in ("a50", "a80", "a100", "right"))
    times = "".join(f" {figures[key]:7.1f}" for key in ("median_ms", "p99_ms") if key in figures)
    print(f"{name:<28}{figures['delta_mm']:8.1f} {shares}{times}", flush=True)
