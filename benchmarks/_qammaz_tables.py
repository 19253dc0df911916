"""The tables of Qammaz, 3.3, on our four sequences: parts of `depthmocap bench swarm`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._papers import published
from benchmarks._record import RESULTS, save_figures
from benchmarks._rows import swarm_settings
from benchmarks._swarm_runs import Tracked, follow, print_row, swarm_figures
from benchmarks._takes import SOURCES, scanned, sequence
from tests.support.bootstrap import paired_bootstrap
from tests.support.sequences import FRAMES, SEQUENCES, sequence_body
from tests.support.suite import WORK
from toolkit.app.config import parse_overrides
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.evaluation.joint_errors import CURVE
from toolkit.io.display_names import shown
from toolkit.io.files import save_bytes
from toolkit.io.html import png_of

PAPER: dict[str, dict[str, float]] = {
    "sequences": {name: published("qammaz", "Table 4")[f"{name} with {name}"] for name in SEQUENCES},
    "table2": published("qammaz", "Table 2"),
    "table3": published("qammaz", "Table 3"),
    "models": published("qammaz", "Table 4"),
}
"""Mean joint distance of the paper in mm, by our names of sequences and people."""
WEIGHTS = (0.5, 1.5, 3.0, 6.0, 18.0)
"""Weights of the depth term (Table 3); 3 is the paper's, which is 1 here, where all terms are in metres."""
BUDGETS = (16, 32, 64, 128)
"""Numbers of particles, and of generations (Fig. 3)."""
TABLE_2 = ("qammaz", "qammaz depth", "qammaz joints")
PRIMITIVES = {"discrepancy.figure": "balls"}


class Bench:
    """Sequences to track, and their figures.

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
        """Return the scanned body of a subject."""
        return scanned(name, self.work)

    def row(self, label: str, row: str, names: Sequence[str], body: Body | None = None, **more: Any) -> list[Tracked]:
        """Track sequences with the settings of a row once per seed; store and print the figures as `label`.

        `body` is the same for all; None takes the person's own.
        """
        tracked, deltas = [], []
        for seed in self.seeds:
            settings = swarm_settings(row, {"seed": seed, **self.overrides, **more})
            runs = [
                follow(
                    settings,
                    sequence(name, self.joints, self.work, self.frames),
                    body=body or self.body(name),
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
        """Compare rows with the first one, over sequences and seeds."""
        for other in others:
            mine, its = ([1000.0 * t.errors.mean() for t in self.runs[name]] for name in (first, other))
            worse = paired_bootstrap(np.array(its), np.array(mine), np.random.default_rng(0))
            self.figures[other]["worse_mm"] = asdict(worse)
            print(f"{other} is worse than {first} by {worse.mean:.1f} mm ({worse.low:.1f} to {worse.high:.1f})")


def sequences(bench: Bench) -> None:
    """Measure both trackers on each sequence, with the subject's body."""
    for row in ("swarm", "qammaz"):
        for name in bench.names:
            bench.row(f"{row}, {name}", row, [name])


def table2(bench: Bench) -> None:
    """Measure depth alone and joints alone (Table 2)."""
    for row in TABLE_2:
        bench.runs[row] = [t for name in bench.names for t in bench.row(f"{row}, {name}", row, [name])]
        bench.figures[row] = swarm_figures(bench.runs[row])
        print_row(row, bench.figures[row])
    bench.compare(TABLE_2[0], TABLE_2[1:])


def models(bench: Bench) -> None:
    """Measure each sequence with the bodies of all subjects (Table 4)."""
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
    # A seed with a lost person has no information about bodies.
    middle = {
        label: figures["seed_middle_mm"] for label, figures in bench.figures.items() if "seed_middle_mm" in figures
    }
    own = [middle[f"{name} with {name}"] for name in bench.names]
    other = [middle[f"{name} with {model}"] for name in bench.names for model in bodies if model != name]
    print(f"middle seeds: own body {np.mean(own):.1f} mm, another's scaled to size {np.mean(other):.1f} mm")


def table3(bench: Bench) -> None:
    """Measure a plain and a perturbed swarm by the weight of the depth term (Table 3, Fig. 4)."""
    kinds: dict[str, dict[str, Any]] = {"baseline": {"swarm.perturbed_every": 0}, "perturbed": {}}
    for kind, settings in kinds.items():
        for weight in WEIGHTS:
            weighed = {**settings, "discrepancy.depth": weight / 3.0}
            bench.row(f"{kind} {weight}", "qammaz", bench.names, **weighed)
    deltas = {kind: [bench.figures[f"{kind} {weight}"]["delta_mm"] for weight in WEIGHTS] for kind in kinds}
    bench.figures["over weights"] = {"weight of the depth term": list(WEIGHTS), **deltas}


def budget(bench: Bench) -> None:
    """Measure numbers of particles and generations (Fig. 3)."""
    for particles in BUDGETS:
        for generations in BUDGETS:
            sizes: dict[str, Any] = {"swarm.particles": particles, "swarm.generations": generations}
            bench.row(f"{particles} in {generations}", "qammaz", bench.names, **sizes)
    deltas = {
        f"{n} particles": [bench.figures[f"{n} in {m}"]["delta_mm"] for m in BUDGETS] for n in BUDGETS
    }  # fmt: skip
    bench.figures["over generations"] = {"generations": list(BUDGETS), **deltas}


def curves_of(bench: Bench, part: str) -> dict[str, np.ndarray]:
    """Return errors (N,), metres, of the rows in the plot of a part."""
    drawn = {
        "table2": TABLE_2,
        "models": ("all with their own", "all with neutral", "all with balls"),
        "sequences": tuple(bench.runs),
    }.get(part, ())
    return {row: np.concatenate([t.errors.ravel() for t in bench.runs[row]]) for row in drawn}


def plot_curves(errors: Mapping[str, np.ndarray], path: Path) -> None:
    """Plot A(t) of several sets of distances (N,), metres, in one picture."""
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
        plot_curves(curves, RESULTS / f"{name}.jpg")
    settings = {key: getattr(options, key) for key in ("sequences", "frames", "joints", "seeds", "set")}
    print("written:", save_figures(name, {"ours": bench.figures, "paper_mm": paper}, settings))


TABLES = {"sequences": sequences, "table2": table2, "table3": table3, "budget": budget, "models": models}
