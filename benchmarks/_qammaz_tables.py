"""The tables and figures of Qammaz, 3.3, on our four sequences: parts of `depthmocap bench swarm`."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from benchmarks._papers import published
from benchmarks._record import Benchmark, benchmark, show
from benchmarks._rows import DATABASE, swarm_settings
from benchmarks._swarm_runs import Tracked, follow, swarm_figures
from benchmarks._takes import scanned, sequence
from tests.support.bootstrap import paired_bootstrap
from tests.support.sequences import FRAMES, SEQUENCES, sequence_body
from tests.support.suite import WORK
from toolkit.app.config import parse_overrides
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.evaluation.joint_errors import CURVE, accuracy
from toolkit.sensing.recording import Recording
from toolkit.trackers.qammaz.tracker import SwarmTracker

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
        self.frames, self.work = options.frames, options.work
        self.names: list[str] = options.sequences.split(",")
        self.overrides = parse_overrides(options.set)
        self.figures: dict[str, Any] = {}
        self.runs: dict[str, list[Tracked]] = {}

    def body(self, name: str) -> Body:
        """Return the scanned body of a subject."""
        return scanned(name, self.work)

    def recording(self, name: str) -> Recording:
        """Return a sequence with its image joints."""
        return sequence(name, "colour", self.work, self.frames)

    def row(self, label: str, row: str, names: Sequence[str], body: Body | None = None, **more: Any) -> None:
        """Track sequences with the settings of a row; store and print the figures as `label`.

        `body` is the same for all; None takes the person's own.
        """
        settings = swarm_settings(row, {**self.overrides, **more})
        self.store(label, [follow(SwarmTracker(settings, body=body or self.body(n)), self.recording(n)) for n in names])

    def store(self, label: str, tracked: list[Tracked]) -> None:
        """Store and print the figures of some runs as `label`."""
        self.runs[label], self.figures[label] = tracked, swarm_figures(tracked)
        show(self.figures[label], label)

    def compare(self, first: str, others: Sequence[str]) -> None:
        """Compare rows with the first one, over sequences."""
        for other in others:
            mine, its = ([1000.0 * t.errors.mean() for t in self.runs[name]] for name in (first, other))
            worse = paired_bootstrap(np.array(its), np.array(mine), np.random.default_rng(0))
            self.figures[other]["worse_mm"] = asdict(worse)

    def accuracy(self, labels: Sequence[str]) -> None:
        """Store the accuracy curves A(t), in per cent, of some rows."""
        self.figures["accuracy"] = {"t_mm": np.round(1000 * CURVE).tolist()}
        for label in labels:
            shares = accuracy(np.concatenate([t.errors.ravel() for t in self.runs[label]]), CURVE)
            self.figures["accuracy"][label] = np.round(100 * shares, 2).tolist()


def sequences(bench: Bench) -> None:
    """Measure both trackers on each sequence, with the subject's body."""
    for row in ("swarm", "qammaz"):
        for name in bench.names:
            bench.row(f"{row}, {name}", row, [name])
    bench.accuracy(tuple(bench.runs))


def table2(bench: Bench) -> None:
    """Measure depth alone and joints alone (Table 2, Fig. 5)."""
    for row in TABLE_2:
        for name in bench.names:
            bench.row(f"{row}, {name}", row, [name])
        bench.store(row, [t for name in bench.names for t in bench.runs[f"{row}, {name}"]])
    bench.compare(TABLE_2[0], TABLE_2[1:])
    bench.accuracy(TABLE_2)


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
    all_with = {
        "their own": [bench.runs[f"{name} with {name}"] for name in bench.names],
        "other bodies": [bench.runs[f"{n} with {m}"] for n in bench.names for m in bodies if m != n],
        "neutral": [bench.runs[f"{name} with neutral"] for name in bench.names],
        "balls": [bench.runs[f"{name} with balls"] for name in bench.names],
    }
    for kind, runs in all_with.items():
        bench.store(f"all with {kind}", sum(runs, []))
    bench.accuracy([f"all with {kind}" for kind in all_with])


def table3(bench: Bench) -> None:
    """Measure a plain and a perturbed swarm by the weight of the depth term (Table 3, Fig. 4)."""
    kinds: dict[str, dict[str, Any]] = {"baseline": {"swarm.perturbed_every": 0}, "perturbed": {}}
    for kind, settings in kinds.items():
        for weight in WEIGHTS:
            weighed = {**settings, "discrepancy.depth": weight / 3.0}
            bench.row(f"{kind} {weight}", "qammaz", bench.names, **weighed)
    bench.accuracy([f"perturbed {weight}" for weight in WEIGHTS])


def budget(bench: Bench) -> None:
    """Measure numbers of particles and generations (Fig. 3)."""
    deltas: dict[str, list[float]] = {}
    for particles in BUDGETS:
        for generations in BUDGETS:
            label = f"{particles} in {generations}"
            sizes: dict[str, Any] = {"swarm.particles": particles, "swarm.generations": generations}
            bench.row(label, "qammaz", bench.names, **sizes)
            deltas.setdefault(f"{particles} particles", []).append(bench.figures[label]["delta_mm"])
    bench.figures["over generations"] = {"generations": list(BUDGETS), **deltas}


def table(measure: Callable[[Bench], None], sequences: str, frames: int) -> Benchmark:
    """Return the benchmark of a table with its own sequences and frames of each, a third of each motion."""

    @benchmark(sequences=sequences, frames=frames, set=DATABASE["set"], work=WORK)
    def measured(options: argparse.Namespace) -> tuple[str, Any]:
        bench = Bench(options)
        measure(bench)
        return f"qammaz_{options.part}", {"ours": bench.figures, "paper_mm": PAPER.get(options.part, {})}

    return measured


ALL = ",".join(SEQUENCES)
TABLES = {
    "sequences": table(sequences, ALL, FRAMES),
    "table2": table(table2, "MS_1,FS_1", FRAMES),
    "table3": table(table3, "MS_1", 60),
    "budget": table(budget, "MS_1", 30),
    "models": table(models, ALL, FRAMES),
}
"""Part -> benchmark."""
