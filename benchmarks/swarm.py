"""The swarm tracker: `depthmocap bench swarm PART`, which is one of

- `suite [--split report] [--joints colour,depth,truth]`: the simulated suite. No database, no pose, no shape is given:
  the recording, and joints in the image, which the network finds in colour or in the shaded depth (`depthmocap joints
  --fetch`), or which are the true ones with the errors of such a network (`truth`, see `toolkit/testing/joints.py`).
  `--rows` chooses settings of `benchmarks/_rows.py`, compared with the first one by a paired bootstrap over the
  recordings. With `--cold` every sixth frame is a first frame: right is one of which 18 of 20 joints are within 150 mm.
- `sequences`, `table2`, `table3`, `models`: Qammaz, 3.3, on our four sequences. Delta and A(t) of
  `configs/swarm.yaml` and `configs/qammaz.yaml`; depth alone, joints alone, both (its curves are the paper's figure 5),
  and a second phase on the depth alone, which gained the paper less than 5 mm;
  five weights w_D with and without perturbation (figure 4); Table 4, every sequence with the bodies scanned from all
  four subjects, with balls and with the neutral body (figure 6).
- `scan`: the bodies of the four sequences, scanned from four views of a T-pose, against what they are.

Delta is the mean distance of the joints, not capped; A(t) the share of them within t millimetres. In the sequences the
person's body is the scanned one, the joints are found in the colour. Beside ours stand the paper's figures, of its own
sequences: they differ in people, rendering and detector. Doubtful in the paper: its w_D and alpha belong to units that
it does not say, so that ours is w_D / 3 in metres; Table 3 denies at 1.5 that perturbation helps for every w_D; in
Table 4 the scanned body of M2 on MS_1 is worse than the primitives P.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._record import RESULTS, run_part, save_figures
from benchmarks._rows import SWARM_ROWS, WEIGHTS, add_take_options, swarm_settings
from benchmarks._takes import SOURCES, TURNS, is_right, joints_of, prepared, scanned, sequence, view_of
from benchmarks._two_phases import TwoPhaseTracker
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.config import parse_overrides
from toolkit.evaluation.joints import CURVE
from toolkit.files import save_bytes
from toolkit.names import shown
from toolkit.pages import png_of
from toolkit.pipeline.scan import scan_recordings
from toolkit.qammaz.tracker import SwarmTracker, SwarmTrackerSettings
from toolkit.sensing.recording import Recording
from toolkit.testing.bootstrap import paired_bootstrap
from toolkit.testing.sequences import FRAMES, SEQUENCES, sequence_body
from toolkit.testing.solo import Solo
from toolkit.testing.suite import GROUPS, LONGEST, WORK, chosen_takes

EVERY = 6
"""Frames from one cold start to the next."""


SWARM_KINDS: dict[str, type[SwarmTracker]] = {"qammaz two phases": TwoPhaseTracker}
"""Trackers of the rows of `SWARM_ROWS` that settings alone do not make."""


class Tracked(NamedTuple):
    """One recording: errors (T, 20), metres, and confidences (T, 20) of the joints; milliseconds (T,) per frame, and
    which frames are right, bool (T,).
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
    kind: type[SwarmTracker] = SwarmTracker,
) -> Tracked:
    """The first `frames` of a recording; with `cold` every sixth of them on its own, with the body that was learnt.

    A `body` that is known is not learnt.
    """
    solo = Solo(kind(settings, body=body), recording)
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


def suite(parser: argparse.ArgumentParser) -> None:
    """Track, print, write JSON."""
    add_take_options(parser)
    parser.add_argument("--joints", default="colour", help=f"out of {', '.join(SOURCES)}, with commas between them")
    parser.add_argument("--rows", default="swarm", help=f"out of {', '.join(SWARM_ROWS)}, with commas between them")
    parser.add_argument("--first", type=int, help="follow only so many frames of each take")
    parser.add_argument("--cold", action="store_true", help="every sixth frame as a first frame")
    parser.add_argument("--seed", type=int, default=0, help="of the swarms")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="setting of all rows")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    takes = chosen_takes(options.split, count=options.takes)
    figures: dict[str, Any] = {}
    print(f"{'':<28}{'Delta':>8} {'A(50)':>6} {'A(80)':>6} {'A(100)':>6} {'right':>6} {'median':>7} {'p99':>7} ms")
    for source in options.joints.split(","):
        deltas: dict[str, np.ndarray] = {}
        for row in options.rows.split(","):
            settings = swarm_settings(row, {"seed": options.seed, **parse_overrides(options.set)})
            tracked = []
            for take in takes:
                recording = prepared(take, source, options.work, options.frames)
                kind = SWARM_KINDS.get(row, SwarmTracker)
                tracked.append(follow(settings, recording, cold=options.cold, frames=options.first, kind=kind))
                print_row(f"  {take.name[:25]}", swarm_figures(tracked[-1:]))
            groups = {
                group: swarm_figures([t for t, take in zip(tracked, takes, strict=True) if take.group == group])
                for group in GROUPS
                if any(take.group == group for take in takes)
            }
            groups["overall"] = swarm_figures(tracked)
            for group, found in groups.items():
                print_row(f"{source}, {row}, {group}", found)
            deltas[row] = np.array([1000.0 * t.errors.mean() for t in tracked])
            bins = calibration(tracked)
            print("confidence, found:", ", ".join(f"{b['said']:.2f} {b['found']:.2f}" for b in bins))
            figures[f"{source}, {row}"] = {
                "groups": groups,
                "confidence": bins,
                "recordings": {take.name: swarm_figures([t]) for take, t in zip(takes, tracked, strict=True)},
            }
        first, *others = deltas
        for row in others:
            worse = paired_bootstrap(deltas[row], deltas[first], np.random.default_rng(0))
            figures[f"{source}, {row}"]["worse_mm"] = asdict(worse)
            print(f"{row} is worse than {first} by {worse.mean:.1f} mm ({worse.low:.1f} to {worse.high:.1f})")
    whole = options.takes is None and options.frames >= LONGEST and not options.set
    told = options.joints.replace(",", "_")
    name = f"swarm_{options.split}_{told}{'_cold' if options.cold else ''}{'' if whole else '_part'}"
    described = {key: getattr(options, key) for key in ("rows", "joints", "seed", "set", "first")}
    print("written:", save_figures(name, figures, described))


PAPER: dict[str, dict[str, float]] = {
    "sequences": {"MS_1": 67.3, "MS_2": 76.9, "FS_1": 75.6, "FS_2": 79.7},
    "table2": {
        "qammaz depth, MS_1": 140.2, "qammaz joints, MS_1": 98.9, "qammaz, MS_1": 67.3,
        "qammaz depth, FS_1": 152.1, "qammaz joints, FS_1": 98.7, "qammaz, FS_1": 75.6,
    },
    "table3": {
        **{f"plain w_D {w:g}": d for w, d in zip(WEIGHTS, (82.8, 67.5, 84.1, 93.7, 108.3), strict=True)},
        **{f"w_D {w:g}": d for w, d in zip(WEIGHTS, (77.0, 70.0, 67.3, 73.5, 81.2), strict=True)},
    },
    "models": {
        f"{sequence} with {model}": delta
        for sequence, row in {
            "MS_1": (67.3, 103.7, 85.4, 87.5, 95.1), "MS_2": (83.3, 76.9, 84.3, 94.7, 112.2),
            "FS_1": (90.2, 96.9, 75.6, 99.4, 100.2), "FS_2": (84.7, 103.2, 92.8, 79.7, 108.1),
        }.items()
        for model, delta in zip(("MS_1", "MS_2", "FS_1", "FS_2", "balls"), row, strict=True)
    },
}  # fmt: skip
"""Delta in mm; sequences and people by the names that ours have."""
TABLE_2 = ("qammaz", "qammaz depth", "qammaz joints", "qammaz two phases")
TABLE_3 = tuple(f"{kind}w_D {w:g}" for kind in ("", "plain ") for w in WEIGHTS)
PRIMITIVES = {"discrepancy.figure": "balls"}


class Bench:
    """Sequences that are followed, and what comes of it.

    Parameters
    ----------
    options : of the command
    """

    def __init__(self, options: argparse.Namespace) -> None:
        self.frames, self.work, self.joints = options.frames, options.work, options.joints
        self.names: list[str] = options.sequences.split(",")
        self.seeds = range(options.seeds)
        self.overrides = parse_overrides(options.set)
        self.figures: dict[str, Any] = {}
        self.runs: dict[str, list[Tracked]] = {}

    def body(self, name: str) -> Body:
        """The scanned one of a subject."""
        return scanned(name, self.work)

    def row(self, label: str, row: str, names: Sequence[str], body: Body | None = None, **more: Any) -> list[Tracked]:
        """Follow sequences with the settings of a row once for each seed; keep and print the figures as `label`.

        `body` is that of everybody; None takes the person's own.
        """
        tracked, deltas = [], []
        for seed in self.seeds:
            settings = swarm_settings(row, {"seed": seed, **self.overrides, **more})
            runs = [
                follow(
                    settings,
                    sequence(name, self.joints, self.work, self.frames),
                    body=body or self.body(name),
                    kind=SWARM_KINDS.get(row, SwarmTracker),
                )  # fmt: skip
                for name in names
            ]
            deltas.append(1000.0 * np.mean([run.errors.mean() for run in runs]))
            tracked += runs
        self.runs[label] = tracked
        spread = {
            "seed_low_mm": float(min(deltas)),
            "seed_middle_mm": float(np.median(deltas)),
            "seed_high_mm": float(max(deltas)),
        }
        self.figures[label] = swarm_figures(tracked) | spread
        print_row(label, self.figures[label])
        return tracked

    def compare(self, first: str, others: Sequence[str]) -> None:
        """By how much rows are worse than the first, over sequences and seeds."""
        for other in others:
            mine, its = ([1000.0 * t.errors.mean() for t in self.runs[name]] for name in (first, other))
            worse = paired_bootstrap(np.array(its), np.array(mine), np.random.default_rng(0))
            self.figures[other]["worse_mm"] = asdict(worse)
            print(f"{other} is worse than {first} by {worse.mean:.1f} mm ({worse.low:.1f} to {worse.high:.1f})")


def sequences(bench: Bench) -> None:
    """Both trackers on every sequence, with the right body."""
    for row in ("swarm", "qammaz"):
        for name in bench.names:
            bench.row(f"{row}, {name}", row, [name])


def table2(bench: Bench) -> None:
    """What depth and joints contribute."""
    for row in TABLE_2:
        bench.runs[row] = [t for name in bench.names for t in bench.row(f"{row}, {name}", row, [name])]
        bench.figures[row] = swarm_figures(bench.runs[row])
        print_row(row, bench.figures[row])
    bench.compare(TABLE_2[0], TABLE_2[1:])


def table3(bench: Bench) -> None:
    """Weights of the depth, with and without perturbation."""
    for row in TABLE_3:
        bench.row(row, row, bench.names)
    for w in WEIGHTS:
        bench.compare(f"w_D {w:g}", [f"plain w_D {w:g}"])


def models(bench: Bench) -> None:
    """Whose body is taken for the person's."""
    bodies = {name: bench.body(name) for name in SEQUENCES}
    neutral = load_body("neutral")
    for name in bench.names:
        sized = neutral.scaled(sequence_body(name).height / neutral.height)
        for model, body in bodies.items():
            scaled = body if model == name else body.scaled(sequence_body(name).height / body.height)
            bench.row(f"{name} with {model}", "qammaz", [name], scaled)
        bench.row(f"{name} with neutral", "qammaz", [name], sized)
        bench.row(f"{name} with balls", "qammaz", [name], sized, **PRIMITIVES)
    for kind in (*SEQUENCES, "neutral", "balls"):
        others = [name for name in bench.names if name != kind]
        bench.runs[f"all with {kind}"] = [t for name in others for t in bench.runs[f"{name} with {kind}"]]
    bench.runs["all with their own"] = [t for name in bench.names for t in bench.runs[f"{name} with {name}"]]
    for label in ("all with their own", "all with neutral", "all with balls"):
        bench.figures[label] = swarm_figures(bench.runs[label])
        print_row(label, bench.figures[label])
    # A seed that loses the person, whom the paper's way never gives up, says nothing about bodies.
    middle = {
        label: figures["seed_middle_mm"] for label, figures in bench.figures.items() if "seed_middle_mm" in figures
    }
    own = [middle[f"{name} with {name}"] for name in bench.names]
    other = [middle[f"{name} with {model}"] for name in bench.names for model in bodies if model != name]
    print(f"middle seeds: own body {np.mean(own):.1f} mm, another's scaled to size {np.mean(other):.1f} mm")


def curves_of(bench: Bench, part: str) -> dict[str, np.ndarray]:
    """Errors (N,), metres, of the rows that the plot of a part shows."""
    drawn = {
        "table2": TABLE_2,
        "table3": TABLE_3,
        "models": ("all with their own", "all with neutral", "all with balls"),
        "sequences": tuple(bench.runs),
    }.get(part, ())
    return {row: np.concatenate([t.errors.ravel() for t in bench.runs[row]]) for row in drawn}


def plot_curves(errors: Mapping[str, np.ndarray], path: Path) -> None:
    """Write A(t) of several sets of distances (N,), metres, in one picture, each under its name."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for name, distances in errors.items():
        axes.plot(CURVE * 1000, 100 * (distances <= CURVE[:, None]).mean(axis=1), lw=1.4, label=shown(name, "plot"))
    axes.set(xlabel="t, mm", ylabel="joints within t, %", xlim=(0, CURVE[-1] * 1000), ylim=(0, 100), title="A(t)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="lower right")
    save_bytes(path, png_of(figure))


def paper(parser: argparse.ArgumentParser) -> None:
    """Track, print, write JSON and a plot."""
    parser.add_argument("--sequences", default=",".join(SEQUENCES), help="with commas between them")
    parser.add_argument("--frames", type=int, default=FRAMES, help="of each sequence, a third of each motion")
    parser.add_argument("--joints", choices=SOURCES, default="colour")
    parser.add_argument("--seeds", type=int, default=1, help="runs with different seeds")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="setting of all rows")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    bench = Bench(options)
    print(f"{'':<28}{'Delta':>8} {'A(50)':>6} {'A(80)':>6} {'A(100)':>6} {'right':>6} {'median':>7} {'p99':>7} ms")
    TABLES[options.part](bench)
    if paper := PAPER.get(options.part, {}):
        print("the paper:", ", ".join(f"{label} {delta}" for label, delta in paper.items()))
    name = f"qammaz_{options.part}"
    if curves := curves_of(bench, options.part):
        plot_curves(curves, RESULTS / f"{name}.png")
    settings = {key: getattr(options, key) for key in ("sequences", "frames", "joints", "seeds", "set")}
    print("written:", save_figures(name, {"ours": bench.figures, "paper_mm": paper}, settings))


def skin_mm(body: Body, truth: Body) -> np.ndarray:
    """Distances along the normal from each vertex of a body to the nearest vertex of the truth, millimetres."""
    nearest = cKDTree(truth.vertices).query(body.vertices)[1]
    off = (body.vertices - truth.vertices[nearest]) * truth.normals[nearest]
    return 1000.0 * np.abs(off.sum(axis=1))


def body_errors(body: Body, truth: Body) -> dict[str, float]:
    """Errors of a body."""
    skin = skin_mm(body, truth)
    joints = 1000.0 * np.linalg.norm(body.joints - truth.joints, axis=1)
    return {
        "skin_median_mm": float(np.median(skin)),
        "skin_p90_mm": float(np.percentile(skin, 90)),
        "joints_median_mm": float(np.median(joints)),
        "joints_worst_mm": float(joints.max()),
    }


def scan(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--names", default=",".join(SEQUENCES), help="of the sequences")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    figures = {}
    for name in options.names.split(","):
        truth = sequence_body(name)
        views = [view_of(name, degrees, options.work) for degrees in TURNS]
        begun = time.process_time()
        found = scan_recordings(views)
        seconds = time.process_time() - begun
        neutral = load_body("neutral")
        figures[name] = {
            "scanned": body_errors(found.body, truth)
            | {"seen": float(found.seen.mean()), "processor_seconds": seconds},
            "neutral": body_errors(neutral.scaled(truth.height / neutral.height), truth),
        }
        for what, row in figures[name].items():
            print(f"{name} {what:8}", ", ".join(f"{key} {value:.2f}" for key, value in row.items()), flush=True)
    print(save_figures("scan", figures, vars(options)))


TABLES = {"sequences": sequences, "table2": table2, "table3": table3, "models": models}


def main() -> None:
    """Run the part that is asked for."""
    run_part(__doc__, {"suite": suite, **dict.fromkeys(TABLES, paper), "scan": scan})


if __name__ == "__main__":
    main()
