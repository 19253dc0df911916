"""The swarm tracker on the simulated suite: `depthmocap bench swarm [--split report] [--joints colour,depth,truth]`.

No database, no pose, no shape is given: the recording, and joints in the image, which the network finds in colour or
in the shaded depth (`scripts/fetch_pose_model.py`), or which are the true ones with the errors of such a network
(`truth`, see `toolkit/testing/joints.py`). `--rows` chooses settings: those of `configs/swarm.yaml`, the paper's own
(`qammaz`, figures of Qammaz in its section 3.3), and parts of either switched off: Table 2 is `qammaz`, `qammaz depth`
and `qammaz joints`, Table 3 the rows `w_D ...` and `plain w_D ...`, in multiples of our weight as the paper's are of 3.
Delta is the mean distance of the joints, not capped; A(t) the share of them within t millimetres. Rows are compared
with the first one by a paired bootstrap over the recordings. With `--cold` every sixth frame is a first frame: right is
one of which 18 of 20 joints are within 150 mm.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks._options import add_take_options
from benchmarks._record import save_figures
from benchmarks.recovery import is_right
from toolkit.config import load_settings, parse_overrides
from toolkit.evaluation.bootstrap import paired_bootstrap
from toolkit.pipeline.joints import JointChoice, joint_source
from toolkit.sensing.joints2d import Joints2D
from toolkit.sensing.opening import open_recording
from toolkit.sensing.people.joints import JointSource
from toolkit.sensing.recording import Recording
from toolkit.sensing.stream import Frame
from toolkit.testing.joints import detected
from toolkit.testing.suite import GROUPS, LONGEST, WORK, Take, chosen_takes, record
from toolkit.tracking.solo import Solo
from toolkit.tracking.swarm import SwarmTracker, SwarmTrackerSettings

SOURCES = ("colour", "depth", "truth")
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
    """One recording: errors (T, 20), metres, milliseconds (T,) per frame, and which frames are right, bool (T,)."""

    errors: np.ndarray
    milliseconds: np.ndarray
    right: np.ndarray


def prepared(take: Take, source: str, work: Path, frames: int) -> tuple[Recording, JointSource]:
    """The take with joints in the image from `source`."""
    recording = open_recording(record(take, work, frames, color=source == "colour"))
    if source == "truth":
        rng = np.random.default_rng(take.seed)
        recording.give_joints_2d(detected(np.asarray(recording.joints), recording.camera.undistorted(), rng))
    return recording, joint_source(recording, JointChoice("auto" if source == "truth" else source), "required")


def joints_of(recording: Recording, i: int) -> tuple[Joints2D, ...]:
    """What the frame itself brings."""
    return () if recording.image_joints is None else recording.joints_2d(i)


def frame_of(recording: Recording, i: int, source: JointSource) -> Frame:
    """Frame `i`, in colour if the source wants it."""
    color = recording.color(i) if source.needs_color else None
    return Frame(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i), color)


def follow(settings: SwarmTrackerSettings, recording: Recording, source: JointSource, *, cold: bool) -> Tracked:
    """The whole recording; with `cold` every sixth frame on its own, with the body that was learnt."""
    solo = Solo(SwarmTracker(settings), recording, source)
    first, before = solo.follower.state, source.export_state()
    errors, milliseconds, right = [], [], []
    for i in range(0, len(recording), EVERY if cold else 1):
        if cold:
            solo.follower.state = first
            source.restore_state(before)
        result = solo.step(*frame_of(recording, i, source))
        truth = recording.joints[i]
        errors.append(np.linalg.norm(result.joints - truth, axis=1))
        milliseconds.append(float(result.stage_ms.sum()))
        right.append(is_right(result.joints, truth))
    return Tracked(np.array(errors), np.array(milliseconds), np.array(right))


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


def print_row(name: str, figures: dict[str, float]) -> None:
    """One line: Delta in mm, A(50), A(80), A(100) and right frames in per cent, times in ms."""
    shares = " ".join(f"{100 * figures[key]:6.1f}" for key in ("a50", "a80", "a100", "right"))
    print(
        f"{name:<28}{figures['delta_mm']:8.1f} {shares} {figures['median_ms']:7.1f} {figures['p99_ms']:7.1f}",
        flush=True,
    )


def main() -> None:
    """Track, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_take_options(parser)
    parser.add_argument("--joints", default="colour", help=f"out of {', '.join(SOURCES)}, with commas between them")
    parser.add_argument("--rows", default="swarm", help=f"out of {', '.join(ROWS)}, with commas between them")
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
            config, own = ROWS[row]
            overrides = {"seed": options.seed, **parse_overrides(options.set), **own}
            settings = load_settings(SwarmTrackerSettings, config, overrides)
            tracked = []
            for take in takes:
                recording, joints = prepared(take, source, options.work, options.frames)
                tracked.append(follow(settings, recording, joints, cold=options.cold))
                print_row(f"  {take.name[:25]}", figures_of(tracked[-1:]))
            groups = {
                group: figures_of([t for t, take in zip(tracked, takes, strict=True) if take.group == group])
                for group in GROUPS
                if any(take.group == group for take in takes)
            }
            groups["overall"] = figures_of(tracked)
            for group, found in groups.items():
                print_row(f"{source}, {row}, {group}", found)
            deltas[row] = np.array([1000.0 * t.errors.mean() for t in tracked])
            figures[f"{source}, {row}"] = {
                "groups": groups,
                "recordings": {take.name: figures_of([t]) for take, t in zip(takes, tracked, strict=True)},
            }
        first, *others = deltas
        for row in others:
            worse = paired_bootstrap(deltas[row], deltas[first], np.random.default_rng(0))
            figures[f"{source}, {row}"]["worse_mm"] = asdict(worse)
            print(f"{row} is worse than {first} by {worse.mean:.1f} mm ({worse.low:.1f} to {worse.high:.1f})")
    whole = options.takes is None and options.frames >= LONGEST and not options.set
    name = f"swarm_{options.split}{'_cold' if options.cold else ''}{'' if whole else '_part'}"
    settings = {"rows": options.rows, "joints": options.joints, "seed": options.seed, "set": options.set}
    print("written:", save_figures(name, figures, settings))


if __name__ == "__main__":
    main()
