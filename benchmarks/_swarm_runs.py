"""Runs of trackers on single recordings, and their figures."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks._takes import is_right, joints_of
from tests.support.solo import Solo
from toolkit.sensing.recording import Recording
from toolkit.tracking.tracker_protocol import Tracker

EVERY = 6
"""Frames between two cold starts."""


class Tracked:
    """Joints of one recording.

    Attributes
    ----------
    joints, truth : estimated and true joints (T, 20, 3), metres
    confidence : of the joints (T, 20); None without a tracker
    milliseconds : per frame (T,)
    """

    def __init__(self, joints: Any, truth: Any, confidence: Any = None, milliseconds: Any = ()) -> None:
        self.joints, self.truth, self.milliseconds = np.array(joints), np.array(truth), np.array(milliseconds)
        self.confidence: Any = None if confidence is None else np.array(confidence)

    @cached_property
    def errors(self) -> np.ndarray:
        """Distances to the true joints (T, 20), metres."""
        distances: np.ndarray = np.linalg.norm(self.joints - self.truth, axis=2)
        return distances

    @property
    def right(self) -> np.ndarray:
        """Bool (T,) mask of the correct frames."""
        return np.array([is_right(joints, truth) for joints, truth in zip(self.joints, self.truth, strict=True)])


def follow(tracker: Tracker, recording: Recording, *, cold: bool = False, frames: int | None = None) -> Tracked:
    """Track the first `frames` of a recording; with `cold` each sixth frame alone, with the learned body."""
    solo = Solo(tracker, recording)
    first = solo.follower.state
    chosen, results = range(0, min(len(recording), frames or len(recording)), EVERY if cold else 1), []
    for i in chosen:
        if cold:
            solo.follower.state = first
        results.append(solo.step(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i)))
    return Tracked(
        [result.joints for result in results],
        [recording.joints[i] for i in chosen],
        [result.confidence for result in results],
        [result.stage_ms.sum() for result in results],
    )


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


def calibration(tracked: Sequence[Tracked]) -> list[dict[str, float]]:
    """Return mean confidence and fraction of joints within 50 mm, in tenths of the confidence."""
    said = np.concatenate([t.confidence.ravel() for t in tracked])
    within = np.concatenate([t.errors.ravel() for t in tracked]) < 0.05
    tenth = np.minimum((10.0 * said).astype(int), 9)
    rows = []
    for k in np.unique(tenth):
        inside = tenth == k
        row = {"said": said[inside].mean(), "found": within[inside].mean(), "joints": inside.sum()}
        rows.append({name: float(value) for name, value in row.items()})
    return rows


def print_row(name: str, figures: dict[str, float]) -> None:
    """Print one line: Delta in mm, A(50), A(80), A(100) and correct frames in per cent, times in ms."""
    shares = " ".join(f"{100 * figures[key]:6.1f}" for key in ("a50", "a80", "a100", "right"))
    times = "".join(f" {figures[key]:7.1f}" for key in ("median_ms", "p99_ms") if key in figures)
    print(f"{name:<28}{figures['delta_mm']:8.1f} {shares}{times}", flush=True)
