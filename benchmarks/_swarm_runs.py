"""Runs of the swarm tracker, and their figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks._takes import is_right, joints_of
from tests.support.solo import Solo
from toolkit.body.body import Body
from toolkit.sensing.recording import Recording
from toolkit.trackers.qammaz.tracker import SwarmTracker, SwarmTrackerSettings

EVERY = 6
"""Frames between two cold starts."""


class Tracked(NamedTuple):
    """One recording: errors (T, 20), metres, and confidences (T, 20) of the joints; milliseconds (T,) per frame, and
    correct frames, bool (T,).
    """

    errors: np.ndarray
    confidence: np.ndarray
    milliseconds: np.ndarray
    right: np.ndarray


def follow(
    settings: SwarmTrackerSettings,
    recording: Recording,
    *,
    cold: bool = False,
    body: Body | None = None,
    frames: int | None = None,
) -> Tracked:
    """Track the first `frames` of a recording; with `cold` each sixth frame alone, with the learnt body.

    A `body` that is known is not learnt.
    """
    solo = Solo(SwarmTracker(settings, body=body), recording)
    first = solo.follower.state
    errors, confidence, milliseconds, right = [], [], [], []
    for i in range(0, min(len(recording), frames or len(recording)), EVERY if cold else 1):
        if cold:
            solo.follower.state = first
        result = solo.step(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i))
        truth = recording.joints[i]
        errors.append(np.linalg.norm(result.joints - truth, axis=1))
        confidence.append(result.confidence)
        milliseconds.append(float(result.stage_ms.sum()))
        right.append(is_right(result.joints, truth))
    return Tracked(np.array(errors), np.array(confidence), np.array(milliseconds), np.array(right))


def swarm_figures(tracked: Sequence[Tracked]) -> dict[str, float]:
    """Return means over recordings; times over frames, without the first of each."""
    errors = [t.errors for t in tracked]
    times = np.concatenate([t.milliseconds[1:] for t in tracked])
    figures = {"delta_mm": 1000.0 * float(np.mean([e.mean() for e in errors]))}
    for limit in (50, 80, 100):
        figures[f"a{limit}"] = float(np.mean([(e < limit / 1000.0).mean() for e in errors]))
    figures["right"] = float(np.mean([t.right.mean() for t in tracked]))
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
    print(
        f"{name:<28}{figures['delta_mm']:8.1f} {shares} {figures['median_ms']:7.1f} {figures['p99_ms']:7.1f}",
        flush=True,
    )
