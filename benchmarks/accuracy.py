"""Accuracy on the simulated suite, with ablations: `depthmocap bench accuracy [--split report] [--rows hybrid,local]`.

The suite is described in `tests/support/suite.py`, the rows in `benchmarks/_rows.py`. Every tracker gets the recording
and the database, no true pose and no true shape. Figures as `depthmocap evaluate` defines them: averaged over the
frames of a recording, then over recordings. A frame is correct if 18 of 20 joints are within 150 mm; the longest run of
incorrect frames shows persistent errors. Figures without the hybrid tracker are written under the name of their first
row, those of a part of the suite to files that end in `_part`.
"""

import argparse
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import benchmark, script
from benchmarks._rows import DATABASE, ROWS, TAKES, figures_of, make_tracker, poses_of, track_each
from benchmarks._takes import is_right
from tests.support.casting import Scene
from tests.support.scenes import record_scene
from tests.support.suite import GROUPS, chosen_takes
from toolkit.app.config import parse_overrides
from toolkit.evaluation.evaluate import evaluate_runs
from toolkit.evaluation.joint_errors import joint_errors
from toolkit.evaluation.scores import EvaluationTable
from toolkit.landmarks.joint_network import RELIABLE_WITHIN
from toolkit.recordings.opening import open_recording
from toolkit.tracks import Track

BINS = np.linspace(0.0, 1.0, 21)
"""Bins of the confidence."""


def figures_of_row(takes: Sequence[Scene], table: EvaluationTable) -> dict[str, Any]:
    """Return the scores of one tracker: means of each group and over all recordings, and each recording's."""
    groups: dict[str, list[Any]] = {}
    for take, scores in zip(takes, table, strict=True):
        groups.setdefault(take.group, []).append(scores)
    means = {group: EvaluationTable(rows).mean() for group, rows in groups.items()} | {"overall": table.mean()}
    return {
        "means": {group: figures_of(mean) for group, mean in means.items()},
        "recordings": {scores.recording: figures_of(scores) for scores in table},
    }


def confidence_bins(tracks: Sequence[Track], truths: Sequence[np.ndarray]) -> list[dict[str, Any]]:
    """Return errors of the joints by bin of the confidence."""
    errors = np.concatenate([joint_errors(t.joints, truth[: len(t)]) for t, truth in zip(tracks, truths, strict=True)])
    confidence = np.concatenate([track.confidence for track in tracks])
    number = np.clip(np.digitize(confidence, BINS) - 1, 0, len(BINS) - 2)
    return [
        {
            "joints": int((number == i).sum()),
            "mean": float(confidence[number == i].mean()),
            "within": float((errors[number == i] <= RELIABLE_WITHIN).mean()),
        }
        for i in np.unique(number)
    ]


def wrong_stretches(tracks: Sequence[Track], truths: Sequence[np.ndarray]) -> dict[str, int]:
    """Return the number of frames that are not correct (`is_right`), and the longest run of them."""
    wrong, longest = 0, 0
    for track, truth in zip(tracks, truths, strict=True):
        right = [is_right(joints, true) for joints, true in zip(track.joints, truth, strict=False)]
        wrong += right.count(False)
        longest = max(longest, *(len(list(frames)) for is_so, frames in groupby(right) if not is_so), 0)
    return {"frames": wrong, "longest": longest}


@benchmark(TAKES, DATABASE, rows=",".join(ROWS))
def accuracy(options: argparse.Namespace) -> tuple[str, Any]:
    """Track and evaluate the suite by each row."""
    chosen, overrides = chosen_takes(options.split, GROUPS, options.takes), parse_overrides(options.set)
    paths = [record_scene(take, options.work, options.frames) for take in chosen]
    truths = [open_recording(path).joints for path in paths]
    figures: dict[str, Any] = {"rows": {}, "confidence": [], "wrong": {}}
    for name in options.rows.split(","):
        folder = options.work / "runs" / name.replace(" ", "_")
        runs: dict[Path, Any] = {folder / path.stem: (path, {}) for path in paths}
        if track_each(runs, make_tracker(name, poses_of(options), overrides)):
            raise SystemExit(f"not all recordings were tracked by {name}")
        figures["rows"][name] = figures_of_row(chosen, evaluate_runs(list(runs)))
        tracks = [Track.load(run) for run in runs]
        figures["wrong"][name] = wrong_stretches(tracks, truths)
        if name == "hybrid":
            figures["confidence"] = confidence_bins(tracks, truths)
    first = "accuracy" if "hybrid" in figures["rows"] else options.rows.split(",")[0]
    return f"{first}_{options.split}", figures


main = script(__name__, __doc__, accuracy)
