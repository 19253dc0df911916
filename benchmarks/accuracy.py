"""Accuracy on the simulated suite, with ablations: `depthmocap bench accuracy [--split report] [--rows hybrid,local]`.

The suite is described in `tests/support/suite.py`, the rows in `benchmarks/_rows.py`. Every tracker gets the recording
and the database, no true pose and no true shape. Figures as `depthmocap evaluate` defines them: averaged over the
frames of a recording, then over recordings. The gain is the mean error of the local hypothesis minus that of the
result, over the frames that a database hypothesis won. A frame is correct if 18 of 20 joints are within 150 mm; the
longest run of incorrect frames shows persistent errors. Rows are compared by a paired bootstrap over recordings.
Figures without the hybrid tracker are written under the name of their first row, those of a part of the suite to files
that end in `_part`.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import RESULTS, save_figures
from benchmarks._rows import (
    ROWS,
    WatchedTracker,
    add_database_options,
    add_take_options,
    figures_of,
    make_tracker,
    poses_of,
    settings_of,
)
from benchmarks._takes import is_right
from tests.support.bootstrap import paired_bootstrap
from tests.support.casting import Scene
from tests.support.scenes import record_scene
from tests.support.suite import GROUPS, LONGEST, chosen_takes, has_mocap, takes
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline import track_recording
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.evaluate import evaluate_runs
from toolkit.evaluation.joint_errors import frame_errors, joint_errors
from toolkit.evaluation.scores import EvaluationTable, RunScores
from toolkit.fitting.joint_confidence import WITHIN
from toolkit.io.files import save_bytes
from toolkit.io.html import png_of
from toolkit.recordings.opening import open_recording
from toolkit.tracks import TRACKED, Track

COLUMNS = (
    ("error_mm", "error", 1.0),
    ("visible_mm", "visible", 1.0),
    ("hidden_mm", "hidden", 1.0),
    ("a100", "A(100) %", 100.0),
    ("a100_hands_feet", "ends %", 100.0),
    ("lost", "lost %", 100.0),
    ("overlap", "IoU %", 100.0),
    ("extrema", "five %", 100.0),
    ("extrema_free", "free %", 100.0),
)
"""Figure, heading and factor of the printed tables."""
COLOURS = {
    "baak2013 local": "#7f9fc6", "baak2013 lookup": "#e0a458", "baak2013": "#9c3b3b", "baak2013 mixed": "#b9a8c9",
    "local": "#7f9fc6", "hybrid": "#2b2b2b",
}  # fmt: skip
"""Colours of the plotted rows."""
BINS = np.linspace(0.0, 1.0, 21)
"""Bins of the confidence."""


class Row:
    """One tracker on all takes."""

    def __init__(self, name: str, takes: Sequence[Scene], table: EvaluationTable) -> None:
        self.name = name
        self.groups = {group: [i for i, take in enumerate(takes) if take.group == group] for group in GROUPS}
        self.groups = {group: rows for group, rows in self.groups.items() if rows}
        self.table = table

    def means(self) -> dict[str, RunScores]:
        """Return means over the recordings of each group, and over all."""
        parts = {group: EvaluationTable([self.table.rows[i] for i in rows]) for group, rows in self.groups.items()}
        return {**{group: part.mean() for group, part in parts.items()}, "overall": self.table.mean()}

    def figures(self) -> dict[str, Any]:
        """Return the difference for JSON."""
        return {
            "means": {group: figures_of(mean) for group, mean in self.means().items()},
            "recordings": {scores.recording: figures_of(scores) for scores in self.table},
        }


def run_row(
    name: str, paths: Sequence[Path], poses: PoseDatabase, poses_path: Path, overrides: dict[str, Any], work: Path
) -> tuple[list[Path], list[dict[str, Any]]]:
    """Track all recordings; return run folders, and per recording the local hypothesis's errors (`one pass` only)."""
    tracker = make_tracker(name, poses, overrides, str(poses_path))
    runs, gains = [], []
    for i, path in enumerate(paths):
        run = work / "runs" / name.replace(" ", "_") / path.stem
        shutil.rmtree(run, ignore_errors=True)
        recording = open_recording(path)
        track_recording(recording, tracker, run, warm_up=i == 0)
        runs.append(run)
        if isinstance(tracker, WatchedTracker):
            gains.append(gain(Track.load(run), tracker.local_joints, recording.joints))
        print(f"\r{name}: {i + 1} of {len(paths)} tracked", end="", flush=True)
    print()
    return runs, gains


def gain(track: Track, local: Sequence[np.ndarray | None], truth: np.ndarray) -> dict[str, Any]:
    """Return frames in which database and local hypotheses competed, those that the database won, and its gain (mm)."""
    both = [i for i, joints in enumerate(local) if joints is not None and track.state[i] == TRACKED]
    won = [i for i in both if track.source_names[track.source[i]] != "local"]
    if not won:
        return {"frames": len(both), "won": 0, "gains_mm": []}
    rivals = np.array([local[i] for i in won])
    gained = frame_errors(joint_errors(rivals, truth[won])) - frame_errors(joint_errors(track.joints[won], truth[won]))
    return {"frames": len(both), "won": len(won), "gains_mm": (1000 * gained).tolist()}


def summary_of_gains(gains: Sequence[dict[str, Any]]) -> dict[str, float | None]:
    """Return the fraction of frames that a database hypothesis won, and its mean gain, over all frames."""
    frames, won = (sum(entry[key] for entry in gains) for key in ("frames", "won"))
    gained = [value for entry in gains for value in entry["gains_mm"]]
    return {"won": won / frames if frames else None, "gain_mm": float(np.mean(gained)) if gained else None}


def confidence_bins(runs: Sequence[Path], paths: Sequence[Path]) -> list[dict[str, Any]]:
    """Return errors of the joints by bin of the confidence."""
    tracks, truths = [Track.load(run) for run in runs], [open_recording(path).joints for path in paths]
    errors = np.concatenate([joint_errors(t.joints, truth[: len(t)]) for t, truth in zip(tracks, truths, strict=True)])
    confidence = np.concatenate([track.confidence for track in tracks])
    number = np.clip(np.digitize(confidence, BINS) - 1, 0, len(BINS) - 2)
    bins = []
    for i in range(len(BINS) - 1):
        inside = errors[number == i]
        known = len(inside) > 0
        bins.append(
            {
                "confidence": [float(BINS[i]), float(BINS[i + 1])],
                "joints": len(inside),
                "mean": float(confidence[number == i].mean()) if known else None,
                "median_mm": 1000 * float(np.median(inside)) if known else None,
                "p90_mm": 1000 * float(np.percentile(inside, 90)) if known else None,
                "within": float((inside <= WITHIN).mean()) if known else None,
            }
        )
    return bins


def wrong_stretches(runs: Sequence[Path], paths: Sequence[Path]) -> dict[str, int]:
    """Return the number of frames that are not correct (`is_right`), and the longest run of them."""
    wrong, longest = 0, 0
    for run, path in zip(runs, paths, strict=True):
        track, truth = Track.load(run), open_recording(path).joints
        right = [is_right(joints, true) for joints, true in zip(track.joints, truth, strict=False)]
        wrong += right.count(False)
        longest = max(longest, *(len(list(frames)) for is_so, frames in groupby(right) if not is_so), 0)
    return {"frames": wrong, "longest": longest}


def print_row(row: Row, gains: Sequence[dict[str, Any]]) -> None:
    """Print the table of one tracker, a line per group."""
    print(
        f"\n{row.name}\n{'group':<9}{'clips':>6}{'frames':>7}", *(f"{heading:>8}" for _, heading, _ in COLUMNS), end=""
    )
    print(f"{'won %':>8}{'gain':>7}  won by" if gains else "")
    for group, mean in row.means().items():
        members = row.groups.get(group, range(len(row.table)))
        values = [(getattr(mean, name), factor) for name, _, factor in COLUMNS]
        cells = [f"{'-':>8}" if value is None else f"{factor * value:8.1f}" for value, factor in values]
        print(f"{group:<9}{len(members):6d}{mean.frames:7d}", *cells, end="")
        if gains:
            of_group = summary_of_gains([gains[i] for i in members])
            won, gained = of_group["won"], of_group["gain_mm"]
            print(
                f"{'-' if won is None else f'{100 * won:.1f}':>8}{'-' if gained is None else f'{gained:.1f}':>7}",
                end="",
            )
        print("  " + ", ".join(f"{name} {100 * share:.0f}" for name, share in mean.sources.items() if share))


def compare(rows: dict[str, Row]) -> dict[str, Any]:
    """Return the error of each other row minus that of the hybrid row, millimetres, over all and per group."""
    rng = np.random.default_rng(0)
    own = rows["hybrid"].table.figures("error_mm")
    found = {}
    for name, row in rows.items():
        if name == "hybrid":
            continue
        other = row.table.figures("error_mm")
        difference = paired_bootstrap(other, own, rng)
        groups = {group: float((other - own)[members].mean()) for group, members in row.groups.items()}
        found[name] = {**asdict(difference), "groups": groups}
        print(
            f"hybrid better than {name} by {difference.mean:.1f} mm [{difference.low:.1f}, {difference.high:.1f}]; "
            + ", ".join(f"{group} {value:+.1f}" for group, value in groups.items())
        )
    return found


def plot_rows(rows: dict[str, Row], path: Path) -> None:
    """Plot the error per recording as bars: the hybrid tracker, or the paper's and its two halves (Fig. 5.12)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 4.6), layout="constrained")
    axes = figure.add_subplot()
    shown = [name for name in COLOURS if name in rows]
    names = [scores.recording for scores in next(iter(rows.values())).table]
    for k, name in enumerate(shown):
        places = np.arange(len(names)) + (k - (len(shown) - 1) / 2) * 0.8 / len(shown)
        axes.bar(places, rows[name].table.figures("error_mm"), 0.8 / len(shown), label=name, color=COLOURS[name])
    axes.set_xticks(range(len(names)), [n.rsplit("_", 1)[0] for n in names], rotation=60, ha="right", fontsize=7)
    axes.set(ylabel="mean error, mm", xlim=(-0.6, len(names) - 0.4))
    axes.legend(frameon=False)
    save_bytes(path, png_of(figure))


def plot_confidence(bins: Sequence[dict[str, Any]], path: Path) -> None:
    """Plot error, and fraction of joints within 50 mm, against confidence."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    filled = [entry for entry in bins if entry["joints"]]
    middle = [entry["mean"] for entry in filled]
    left.plot(middle, [entry["median_mm"] for entry in filled], "o-", color="black", label="median")
    left.plot(middle, [entry["p90_mm"] for entry in filled], "o--", color="0.5", label="90th percentile")
    left.set(xlabel="confidence", ylabel="error of the joint, mm", xlim=(0, 1), ylim=(0, None))
    left.legend(frameon=False)
    share = np.array([entry["joints"] for entry in filled]) / sum(entry["joints"] for entry in filled)
    right.bar(middle, 100 * share, 0.02, color="0.85", label="share of all joints")
    right.plot(middle, [100 * entry["within"] for entry in filled], "o-", color="black", label="within 100 mm")
    right.plot([0, 1], [0, 100], ":", color="0.5")
    right.set(xlabel="confidence", ylabel="%", xlim=(0, 1), ylim=(0, 101))
    right.legend(frameon=False)
    save_bytes(path, png_of(figure))


def parse() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_take_options(parser)
    parser.add_argument("--rows", default=",".join(ROWS), help="comma-separated, out of: " + ", ".join(ROWS))
    parser.add_argument("--groups", default=",".join(GROUPS), help="comma-separated, out of: " + ", ".join(GROUPS))
    add_database_options(parser)
    parser.add_argument(
        "--no-surface", dest="surface", action="store_false", help="without what needs every depth frame"
    )
    return parser.parse_args()


def main() -> None:
    """Track missing runs, evaluate, print, write JSON and plots."""
    options = parse()
    chosen = chosen_takes(options.split, options.groups.split(","), options.takes)
    print(f"{len(chosen)} takes of the {options.split} split, from {'mocap' if has_mocap() else 'bundled motions'}")
    paths = [record_scene(take, options.work, options.frames) for take in chosen]
    poses_path = poses_of(options)
    poses = PoseDatabase.load(poses_path)
    overrides = parse_overrides(options.set)
    rows: dict[str, Row] = {}
    gains: list[Any] = []
    bins: list[Any] = []
    wrong: dict[str, dict[str, int]] = {}
    for name in options.rows.split(","):
        runs, found = run_row(name, paths, poses, poses_path, overrides, options.work)
        rows[name] = Row(name, chosen, evaluate_runs(runs, surface=options.surface))
        gains = found or gains
        if name == "hybrid":
            bins = confidence_bins(runs, paths)
        print_row(rows[name], found)
        wrong[name] = wrong_stretches(runs, paths)
        print(f"{wrong[name]['frames']} frames are not right, at most {wrong[name]['longest']} of them in a row")
    figures = {"rows": {name: row.figures() for name, row in rows.items()}, "confidence": bins, "wrong": wrong}
    figures["gains"] = {path.stem: entry for path, entry in zip(paths, gains, strict=False)}
    if "hybrid" in rows:
        figures["compared"] = compare(rows)
    settings = {name: asdict(settings_of(name, overrides)) for name in rows}
    whole = len(chosen) == len(takes(options.split)) and options.frames >= LONGEST and not options.set
    stem = f"{'accuracy' if 'hybrid' in rows else next(iter(rows))}_{options.split}{'' if whole else '_part'}"
    described = {
        "takes": [asdict(take) for take in chosen],
        "mocap": has_mocap(),
        "poses": len(poses),
        "rows": settings,
    }
    print("written:", save_figures(stem, figures, described))
    plot_rows(rows, RESULTS / f"{stem}.jpg")
    if bins:
        plot_confidence(bins, RESULTS / f"{stem}_confidence.jpg")


if __name__ == "__main__":
    main()
