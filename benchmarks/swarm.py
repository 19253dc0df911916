"""The swarm tracker: `depthmocap bench swarm PART`, which is one of

- `suite [--split report] [--joints colour|depth|truth]`: the simulated suite. No database, no pose, no shape is given:
  the recording, and joints in the image, which the network finds in colour or in the shaded depth (`depthmocap joints
  --fetch`), or which are the true ones with the errors of such a network (`truth`, `tests/support/image_joints.py`).
- `sequences`, `table2`, `table3`, `budget`, `models`, `cameras`: Qammaz, 3.3, on our four sequences. Delta and A(t) of
  `configs/swarm.yaml` and `configs/qammaz.yaml`; depth alone, joints alone, both (Table 2, Fig. 5); a plain and a
  perturbed swarm over the weight of the depth term (Table 3, Fig. 4); particles and generations (Fig. 3); each sequence
  with the bodies scanned from all four subjects, with balls and with the neutral body (Table 4); other methods, also
  with two cameras (Fig. 6): the hybrid tracker on depth alone, the mean of two such tracks, and joints of the network
  triangulated from the colour images of two cameras. The second camera is simulated 60 degrees to the side, and is
  calibrated by the true joints.
- `scan`: the bodies of the four sequences, scanned from four views of a T-pose, against what they are.

Delta is the mean distance of the joints, not capped; A(t) the share of them within t millimetres. In the sequences the
person's body is the scanned one, and joints are found in colour. The paper's figures are of its own sequences, which
differ in people, rendering and detector; it does not give the units of w_D, which is w_D / 3 in metres here.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._papers import published
from benchmarks._record import Benchmark, benchmark, script, show
from benchmarks._rows import DATABASE, TAKES, make_tracker, swarm_settings
from benchmarks._takes import SOURCES, TURNS, Tracked, follow, prepared, scanned, sequence, swarm_figures, view_of
from tests.support.bootstrap import paired_bootstrap
from tests.support.sequences import FRAMES, SEQUENCES, sequence_body
from tests.support.suite import GROUPS, WORK, chosen_takes
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline.scan import scan_recordings
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.database import DEFAULT_DATABASE
from toolkit.evaluation.joint_errors import CURVE, accuracy
from toolkit.evaluation.marker_alignment import align
from toolkit.sensing.recording import Recording
from toolkit.trackers.qammaz.tracker import SwarmTracker


@benchmark(TAKES, joints=SOURCES, set=DATABASE["set"], work=WORK)
def suite(options: argparse.Namespace) -> tuple[str, Any]:
    """Track the simulated suite."""
    settings, tracked = swarm_settings("swarm", parse_overrides(options.set)), {}
    takes = chosen_takes(options.split, count=options.takes)
    for take in takes:
        recording = prepared(take, options.joints, options.work, options.frames)
        tracked[take.name] = follow(SwarmTracker(settings), recording)
        show(swarm_figures([tracked[take.name]]), take.name)
    members = {group: [tracked[take.name] for take in takes if take.group == group] for group in GROUPS}
    groups = {group: swarm_figures(runs) for group, runs in members.items() if runs}
    groups["overall"] = swarm_figures(list(tracked.values()))
    return f"swarm_{options.split}_{options.joints}", {f"{options.joints}, swarm": {"groups": groups}}


def body_errors(body: Body, truth: Body) -> dict[str, float]:
    """Return the errors of a body: those of the skin along the normal of the nearest true vertex."""
    nearest = cKDTree(truth.vertices).query(body.vertices)[1]
    skin = ((body.vertices - truth.vertices[nearest]) * truth.normals[nearest]).sum(axis=1)
    return {
        "skin_median_mm": float(np.median(1000.0 * np.abs(skin))),
        "joints_median_mm": 1000.0 * float(np.median(np.linalg.norm(body.joints - truth.joints, axis=1))),
    }


@benchmark(work=WORK)
def scan(options: argparse.Namespace) -> tuple[str, Any]:
    """Scan the bodies of the four subjects."""
    figures, neutral = {}, load_body("neutral")
    for name in SEQUENCES:
        truth = sequence_body(name)
        found = scan_recordings([view_of(name, degrees, options.work) for degrees in TURNS])
        figures[name] = {
            "scanned": body_errors(found.body, truth),
            "neutral": body_errors(neutral.scaled(truth.height / neutral.height), truth),
        }
    return "scan", figures


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
SECOND_VIEW = 60.0
"""Angle between the two cameras of Fig. 6, degrees (the paper: wide baseline)."""
CENTRES = {"neck": ("shoulder",), "pelvis": ("hip",), "spine": ("shoulder", "hip")}
"""Joints that no detector reports -> the joints of both sides whose mean replaces them."""


class Bench:
    """Sequences to track by the options of the command, and their figures."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.frames, self.work = options.frames, options.work
        self.names: list[str] = options.sequences.split(",")
        self.overrides = parse_overrides(options.set)
        self.figures: dict[str, Any] = {}
        self.runs: dict[str, list[Tracked]] = {}

    def row(self, label: str, row: str, names: Sequence[str], body: Body | None = None, **more: Any) -> None:
        """Track sequences with the settings of a row; store and print the figures as `label`.

        `body` is the same for all; None takes the person's own.
        """
        settings = swarm_settings(row, {**self.overrides, **more})
        runs = []
        for name in names:
            tracker = SwarmTracker(settings, body=body or scanned(name, self.work))
            runs.append(follow(tracker, sequence(name, "colour", self.work, self.frames)))
        self.store(label, runs)

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
    for row, name in product(("swarm", "qammaz"), bench.names):
        bench.row(f"{row}, {name}", row, [name])


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
    bodies = {name: scanned(name, bench.work) for name in SEQUENCES}
    neutral = load_body("neutral")
    for name in bench.names:
        sized = neutral.scaled(sequence_body(name).height / neutral.height)
        for model, body in bodies.items():
            scaled = body if model == name else body.scaled(sequence_body(name).height / body.height)
            bench.row(f"{name} with {model}", "qammaz", [name], scaled)
        bench.row(f"{name} with neutral", "qammaz", [name], sized)
        bench.row(f"{name} with balls", "qammaz", [name], sized, **PRIMITIVES)


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
    for particles, generations in product(BUDGETS, BUDGETS):
        label = f"{particles} in {generations}"
        sizes: dict[str, Any] = {"swarm.particles": particles, "swarm.generations": generations}
        bench.row(label, "qammaz", bench.names, **sizes)
        deltas.setdefault(f"{particles} particles", []).append(bench.figures[label]["delta_mm"])
    bench.figures["over generations"] = {"generations": list(BUDGETS), **deltas}


def cameras(bench: Bench) -> None:
    """Measure this tracker beside a tracker of depth alone, with one and with two cameras, and beside joints in two
    colour images (Fig. 6).
    """
    bench.row("qammaz", "qammaz", bench.names)
    neutral, runs = load_body("neutral"), []
    for name in bench.names:
        bench.row(name, "qammaz", [name], neutral.scaled(sequence_body(name).height / neutral.height), **PRIMITIVES)
        runs += bench.runs.pop(name)
        del bench.figures[name]
    bench.store("qammaz with balls", runs)

    def views(name: str, source: str) -> list[Recording]:
        return [sequence(name, source, bench.work, bench.frames, yaw) for yaw in (0.0, SECOND_VIEW)]

    depth = make_tracker("hybrid", DEFAULT_DATABASE)  # its database has no actor of the sequences
    tracked = [[follow(depth, view) for view in views(name, "none")] for name in bench.names]
    bench.store("depth, one camera", [first for first, _ in tracked])
    bench.store("depth, two cameras", [mean_of(*pair) for pair in tracked])
    bench.store("joints, two cameras", [triangulated(views(name, "colour")) for name in bench.names])
    bench.accuracy(list(bench.runs))


def mean_of(first: Tracked, second: Tracked) -> Tracked:
    """Return the means of joints that two cameras give, in the frame of the first one."""
    turn = align(second.truth, first.truth)
    return Tracked(0.5 * (first.joints + second.joints @ turn.rotation.T + turn.translation), first.truth)


def triangulated(views: Sequence[Recording]) -> Tracked:
    """Return the joints with the smallest squared distances to the rays of their pixels.

    They are in the frame of the first camera. Distances are weighted by the detector's confidence.
    """
    matrix, right, truth = np.zeros((3, 3)), np.zeros(3), np.asarray(views[0].joints)
    for view in views:
        turn = align(np.asarray(view.joints), truth)  # from this camera to the first one
        assert view.image_joints is not None  # of the network
        u, v, confidence = np.moveaxis(view.image_joints[0].astype(float), -1, 0)
        camera = view.camera
        rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)
        rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True) @ turn.rotation.T
        across = confidence[..., None, None] * (np.eye(3) - rays[..., :, None] * rays[..., None, :])
        matrix, right = matrix + across, right + across @ turn.translation
    joints: np.ndarray = np.linalg.solve(matrix, right[..., None])[..., 0]
    for name, parts in CENTRES.items():
        both = [skeleton.REPORTED.index(f"{side}_{part}") for part in parts for side in ("left", "right")]
        joints[:, skeleton.REPORTED.index(name)] = joints[:, both].mean(axis=1)
    return Tracked(joints, truth)


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
    "cameras": table(cameras, ALL, 60),
}
"""Part -> benchmark."""


main = script(__name__, __doc__, {"suite": suite, **TABLES, "scan": scan})
