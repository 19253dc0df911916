"""The swarm tracker: `depthmocap bench swarm PART`, which is one of

- `suite [--split report] [--joints colour|depth|truth]`: the simulated suite. No database, no pose, no shape is given:
  the recording, and joints in the image, which the network finds in colour or in the shaded depth (`depthmocap joints
  --fetch`), or which are the true ones with the errors of such a network (`truth`, `tests/support/image_joints.py`).
- `sequences`, `table2`, `table3`, `budget`, `models`: Qammaz, 3.3, on our four sequences. Delta and A(t) of
  `configs/swarm.yaml` and `configs/qammaz.yaml`; depth alone, joints alone, both (Table 2, Fig. 5); a plain and a
  perturbed swarm over the weight of the depth term (Table 3, Fig. 4); particles and generations (Fig. 3); each sequence
  with the bodies scanned from all four subjects, with balls and with the neutral body (Table 4).
- `scan`: the bodies of the four sequences, scanned from four views of a T-pose, against what they are.

Delta is the mean distance of the joints, not capped; A(t) the share of them within t millimetres. In the sequences the
person's body is the scanned one, the joints are found in the colour. Beside ours stand the paper's figures, of its own
sequences: they differ in people, rendering and detector. Doubtful in the paper: its w_D and alpha belong to units that
it does not say, so that ours is w_D / 3 in metres; in Table 4 the scanned body of M2 on MS_1 is worse than the
primitives P.
"""

import argparse
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._qammaz_tables import TABLES
from benchmarks._record import benchmark, script, show
from benchmarks._rows import DATABASE, TAKES, swarm_settings
from benchmarks._swarm_runs import follow, swarm_figures
from benchmarks._takes import SOURCES, TURNS, prepared, view_of
from tests.support.sequences import SEQUENCES, sequence_body
from tests.support.suite import GROUPS, WORK, chosen_takes
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline.scan import scan_recordings
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.trackers.qammaz.tracker import SwarmTracker


@benchmark(TAKES, joints=SOURCES, set=DATABASE["set"], work=WORK)
def suite(options: argparse.Namespace) -> tuple[str, Any]:
    """Track the simulated suite."""
    settings, takes, tracked = (
        swarm_settings("swarm", parse_overrides(options.set)),
        chosen_takes(options.split, count=options.takes),
        {},
    )
    for take in takes:
        recording = prepared(take, options.joints, options.work, options.frames)
        tracked[take.name] = follow(SwarmTracker(settings), recording)
        show(swarm_figures([tracked[take.name]]), take.name)
    members = {group: [tracked[take.name] for take in takes if take.group == group] for group in GROUPS}
    groups = {group: swarm_figures(runs) for group, runs in members.items() if runs}
    groups["overall"] = swarm_figures(list(tracked.values()))
    return f"swarm_{options.split}_{options.joints}", {f"{options.joints}, swarm": {"groups": groups}}


def skin_mm(body: Body, truth: Body) -> np.ndarray:
    """Return distances along the normal from each vertex of a body to the nearest true vertex, millimetres."""
    nearest = cKDTree(truth.vertices).query(body.vertices)[1]
    off = (body.vertices - truth.vertices[nearest]) * truth.normals[nearest]
    return 1000.0 * np.abs(off.sum(axis=1))


def body_errors(body: Body, truth: Body) -> dict[str, float]:
    """Return the errors of a body."""
    return {
        "skin_median_mm": float(np.median(skin_mm(body, truth))),
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


main = script(__name__, __doc__, {"suite": suite, **TABLES, "scan": scan})
