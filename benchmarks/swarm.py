"""The swarm tracker: `depthmocap bench swarm PART`, which is one of

- `suite [--split report] [--joints colour|depth|truth]`: the simulated suite. No database, no pose, no shape is given:
  the recording, and joints in the image, which the network finds in colour or in the shaded depth (`depthmocap joints
  --fetch`), or which are the true ones with the errors of such a network (`truth`, `tests/support/image_joints.py`).
  `--row` chooses settings of `benchmarks/_rows.py`.
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

import argparse
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._qammaz_tables import TABLES, paper
from benchmarks._record import part_suffix, run_part, save_figures
from benchmarks._rows import SWARM_ROWS, add_take_options, swarm_settings
from benchmarks._swarm_runs import follow, print_row, swarm_figures
from benchmarks._takes import SOURCES, TURNS, prepared, view_of
from tests.support.sequences import SEQUENCES, sequence_body
from tests.support.suite import GROUPS, WORK, chosen_takes
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline.scan import scan_recordings
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.trackers.qammaz.tracker import SwarmTracker


def suite(parser: argparse.ArgumentParser) -> None:
    """Track, print, write JSON."""
    add_take_options(parser)
    parser.add_argument("--joints", default="colour", choices=SOURCES)
    parser.add_argument("--row", default="swarm", choices=SWARM_ROWS)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="setting of the tracker")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    settings, label = swarm_settings(options.row, parse_overrides(options.set)), f"{options.joints}, {options.row}"
    takes, tracked = chosen_takes(options.split, count=options.takes), {}
    print(f"{'':<28}{'Delta':>8} {'A(50)':>6} {'A(80)':>6} {'A(100)':>6} {'right':>6} {'median':>7} {'p99':>7} ms")
    for take in takes:
        tracked[take.name] = follow(
            SwarmTracker(settings), prepared(take, options.joints, options.work, options.frames)
        )
        print_row(f"  {take.name[:25]}", swarm_figures([tracked[take.name]]))
    members = {group: [tracked[take.name] for take in takes if take.group == group] for group in GROUPS}
    groups = {group: swarm_figures(runs) for group, runs in members.items() if runs}
    groups["overall"] = swarm_figures(list(tracked.values()))
    for group, found in groups.items():
        print_row(f"{label}, {group}", found)
    each = {name: swarm_figures([one]) for name, one in tracked.items()}
    name = f"swarm_{options.split}_{options.joints}{part_suffix(parser, options, 'takes', 'frames', 'row', 'set')}"
    described = {key: getattr(options, key) for key in ("row", "joints", "set")}
    print("written:", save_figures(name, {label: {"groups": groups, "recordings": each}}, described))


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
