"""Runs of trackers on single recordings, and their figures."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks._takes import joints_of
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
    times = np.concatenate([t.milliseconds[1:] for t in tracked])
    if len(times):
        figures["median_ms"], figures["p99_ms"] = (float(np.percentile(times, q)) for q in (50, 99))
    return figures
