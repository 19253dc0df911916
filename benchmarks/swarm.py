"""The swarm tracker: `depthmocap bench swarm PART`, which is one of

- `suite [--split report] [--joints colour,depth,truth]`: the simulated suite. No database, no pose, no shape is given:
  the recording, and joints in the image, which the network finds in colour or in the shaded depth (`depthmocap joints
  --fetch`), or which are the true ones with the errors of such a network (`truth`, `tests/support/image_joints.py`).
  `--rows` chooses settings of `benchmarks/_rows.py`, compared with the first one by a paired bootstrap over the
  recordings. With `--cold` every sixth frame is a first frame: right is one of which 18 of 20 joints are within 150 mm.
- `sequences`, `table2`, `table3`, `budget`, `models`, `cameras`: Qammaz, 3.3, on our four sequences. Delta and A(t) of
  `configs/swarm.yaml` and `configs/qammaz.yaml`; depth alone, joints alone, both (Table 2, Fig. 5); a plain and a
  perturbed swarm over the weight of the depth term (Table 3, Fig. 4); particles and generations (Fig. 3); each sequence
  with the bodies scanned from all four subjects, with balls and with the neutral body (Table 4); other methods, also
  with two cameras (Fig. 6): the hybrid tracker on depth alone, the mean of two such tracks, and joints of the network
  triangulated from the colour images of two cameras. The second camera is simulated 60 degrees to the side, and is
  calibrated by the true joints.
- `scan`: the bodies of the four sequences, scanned from four views of a T-pose, against what they are.

Delta is the mean distance of the joints, not capped; A(t) the share of them within t millimetres. In the sequences the
person's body is the scanned one, the joints are found in the colour. Beside ours stand the paper's figures, of its own
sequences: they differ in people, rendering and detector. Doubtful in the paper: its w_D and alpha belong to units that
it does not say, so that ours is w_D / 3 in metres; in Table 4 the scanned body of M2 on MS_1 is worse than the
primitives P.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._qammaz_tables import TABLES, paper
from benchmarks._record import run_part, save_figures
from benchmarks._rows import SWARM_ROWS, add_take_options, swarm_settings
from benchmarks._swarm_runs import calibration, follow, print_row, swarm_figures
from benchmarks._takes import SOURCES, TURNS, prepared, view_of
from tests.support.bootstrap import paired_bootstrap
from tests.support.sequences import SEQUENCES, sequence_body
from tests.support.suite import GROUPS, LONGEST, WORK, chosen_takes
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline.scan import scan_recordings
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.trackers.qammaz.tracker import SwarmTracker


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
                tracked.append(follow(SwarmTracker(settings), recording, cold=options.cold, frames=options.first))
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


def skin_mm(body: Body, truth: Body) -> np.ndarray:
    """Return distances along the normal from each vertex of a body to the nearest true vertex, millimetres."""
    nearest = cKDTree(truth.vertices).query(body.vertices)[1]
    off = (body.vertices - truth.vertices[nearest]) * truth.normals[nearest]
    return 1000.0 * np.abs(off.sum(axis=1))


def body_errors(body: Body, truth: Body) -> dict[str, float]:
    """Return the errors of a body."""
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


def main() -> None:
    """Run the named part."""
    run_part(__doc__, {"suite": suite, **dict.fromkeys(TABLES, paper), "scan": scan})


if __name__ == "__main__":
    main()
