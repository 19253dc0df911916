"""What the benchmarks of the swarm tracker share: its rows, following, figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks._takes import is_right, joints_of
from toolkit.body.body import Body
from toolkit.config import load_settings
from toolkit.qammaz.tracker import SwarmTracker, SwarmTrackerSettings
from toolkit.sensing.recording import Recording
from toolkit.tracking.solo import Solo

NO_IMAGE = {"discrepancy.depth": 0.0}
NO_JOINTS = {"discrepancy.joints_2d": 0.0, "discrepancy.joints_3d": 0.0, "search.pulled": 0, "search.disagreement": 0.0}
PLAIN = {"swarm.perturbed_every": 0}
WEIGHTS = (0.5, 1.5, 3.0, 6.0, 18.0)
"""w_D of the paper's Table 3; 3 is its own, ours is 1."""
ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "swarm": ("swarm", {}),
    "mesh": ("swarm", {"discrepancy.figure": "mesh", "discrepancy.width": 45, "discrepancy.height": 60}),
    "64x64": ("swarm", {"swarm.particles": 64, "swarm.generations": 64}),
    "depth": ("swarm", NO_JOINTS),
    "joints": ("swarm", NO_IMAGE),
    "no 2D": ("swarm", {"discrepancy.joints_2d": 0.0}),
    "no 3D": ("swarm", {"discrepancy.joints_3d": 0.0}),
    "no joints first": ("swarm", {"search.joints_first": False}),
    "no fresh start": ("swarm", {"search.disagreement": 0.0}),
    "no perturbation": ("swarm", PLAIN),
    "swarm alone": ("swarm", {"hypotheses": ["swarm"]}),
    "qammaz": ("qammaz", {}),
    "qammaz depth": ("qammaz", NO_JOINTS),
    "qammaz joints": ("qammaz", NO_IMAGE),
    "qammaz 2D": ("qammaz", {**NO_IMAGE, "discrepancy.joints_3d": 0.0}),
    "qammaz 3D": ("qammaz", {**NO_IMAGE, "discrepancy.joints_2d": 0.0}),
    **{f"w_D {w:g}": ("qammaz", {"discrepancy.depth": w / 3.0}) for w in WEIGHTS},
    **{f"plain w_D {w:g}": ("qammaz", {"discrepancy.depth": w / 3.0, **PLAIN}) for w in WEIGHTS},
}
"""Name of the row, shipped settings that it starts from, and overrides."""
EVERY = 6
"""Frames from one cold start to the next."""


class Tracked(NamedTuple):
    """One recording: errors (T, 20), metres, and confidences (T, 20) of the joints; milliseconds (T,) per frame, and
    which frames are right, bool (T,).
    """

    errors: np.ndarray
    confidence: np.ndarray
    milliseconds: np.ndarray
    right: np.ndarray


def settings_of(row: str, overrides: Mapping[str, Any] | None = None) -> SwarmTrackerSettings:
    """Settings of a row; the overrides apply unless the row itself says otherwise."""
    config, own = ROWS[row]
    return load_settings(SwarmTrackerSettings, config, {**(overrides or {}), **own})


def follow(
    settings: SwarmTrackerSettings,
    recording: Recording,
    *,
    cold: bool = False,
    body: Body | None = None,
    frames: int | None = None,
) -> Tracked:
    """The first `frames` of a recording; with `cold` every sixth of them on its own, with the body that was learnt.

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


def figures_of(tracked: Sequence[Tracked]) -> dict[str, float]:
    """Means over recordings; times over frames, without the first of each."""
    errors = [t.errors for t in tracked]
    times = np.concatenate([t.milliseconds[1:] for t in tracked])
    figures = {"delta_mm": 1000.0 * float(np.mean([e.mean() for e in errors]))}
    for limit in (50, 80, 100):
        figures[f"a{limit}"] = float(np.mean([(e < limit / 1000.0).mean() for e in errors]))
    figures["right"] = float(np.mean([t.right.mean() for t in tracked]))
    figures["median_ms"], figures["p99_ms"] = (float(np.percentile(times, q)) for q in (50, 99))
    return figures


def calibration(tracked: Sequence[Tracked]) -> list[dict[str, float]]:
    """What the confidence says, and the share of joints within 50 mm that is found, in tenths of the confidence."""
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
    """One line: Delta in mm, A(50), A(80), A(100) and right frames in per cent, times in ms."""
    shares = " ".join(f"{100 * figures[key]:6.1f}" for key in ("a50", "a80", "a100", "right"))
    print(
        f"{name:<28}{figures['delta_mm']:8.1f} {shares} {figures['median_ms']:7.1f} {figures['p99_ms']:7.1f}",
        flush=True,
    )
