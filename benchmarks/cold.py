"""First frames: `depthmocap bench cold [--split report] [--joints depth] [--rows hybrid,no swarm] [--every 12]`.

Every so many frames of the simulated suite are tracked on their own, as after a loss, with the body that was learnt
from the recording before. Right is a frame of which 18 of 20 joints are within 150 mm. Rows are the hybrid tracker with
the swarm among its hypotheses and without it, whose joints are found in colour or in the shaded depth (see
`bench swarm`), and the swarm tracker, which has no database. Rows after the first one are compared with it by a paired
bootstrap over the recordings.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

import numpy as np

from benchmarks import _rows, _swarm_rows
from benchmarks._options import add_database_options, add_take_options, poses_of
from benchmarks._record import save_figures
from benchmarks._takes import SOURCES, is_right, joints_of, prepared
from toolkit.config import parse_overrides
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.bootstrap import paired_bootstrap
from toolkit.qammaz.tracker import SwarmTracker
from toolkit.sensing.recording import Recording
from toolkit.testing.suite import GROUPS, chosen_takes
from toolkit.tracking.protocol import Tracker
from toolkit.tracking.solo import Solo

ROWS = ("hybrid", "no swarm", "swarm")
EVERY = 12
"""Frames from one start to the next."""


def without_swarm() -> list[str]:
    """The hypotheses of the hybrid tracker but for the swarm."""
    return [name for name in _rows.settings_of("hybrid").hypotheses if name != "swarm"]


def tracker_of(row: str, database: PoseDatabase | None, overrides: dict[str, Any]) -> Tracker:
    """The tracker of a row."""
    if row == "swarm" or database is None:
        return SwarmTracker(_swarm_rows.settings_of("swarm", overrides))
    own = {"hypotheses": without_swarm()} if row == "no swarm" else {}
    return _rows.make_tracker("hybrid", database, {**overrides, **own})


def started(tracker: Tracker, recording: Recording, every: int) -> tuple[np.ndarray, np.ndarray]:
    """Whether each start is right, bool (N,), and its mean error in millimetres (N,)."""
    solo = Solo(tracker, recording)
    first = solo.follower.state
    right, errors = [], []
    for i in range(0, len(recording), every):
        solo.follower.state = first
        result = solo.step(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i))
        right.append(is_right(result.joints, recording.joints[i]))
        errors.append(1000.0 * np.linalg.norm(result.joints - recording.joints[i], axis=1).mean())
    return np.array(right), np.array(errors)


def main() -> None:
    """Measure, print one line per group, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_take_options(parser)
    parser.add_argument("--joints", choices=SOURCES, default="depth")
    parser.add_argument("--rows", default="hybrid,no swarm", help=f"out of {', '.join(ROWS)}, with commas between them")
    parser.add_argument("--every", type=int, default=EVERY, help="frames from one start to the next")
    add_database_options(parser)
    options = parser.parse_args()
    rows = options.rows.split(",")
    database = None if rows == ["swarm"] else PoseDatabase.load(poses_of(options))
    overrides = parse_overrides(options.set)
    takes = chosen_takes(options.split, count=options.takes)
    found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {row: [] for row in rows}
    for take in takes:
        recording = prepared(take, options.joints, options.work, options.frames)
        for row in rows:
            found[row].append(started(tracker_of(row, database, overrides), recording, options.every))
        print(take.name, ", ".join(f"{row} {100 * found[row][-1][0].mean():.0f} %" for row in rows), flush=True)
    figures: dict[str, Any] = {}
    for row, runs in found.items():
        figures[row] = {}
        for group in (*GROUPS, "overall"):
            chosen = [run for run, take in zip(runs, takes, strict=True) if group in (take.group, "overall")]
            if not chosen:
                continue
            right, errors = (np.concatenate(parts) for parts in zip(*chosen, strict=True))
            part = {"starts": len(right), "right": float(right.mean()), "error_mm": float(errors.mean())}
            figures[row][group] = part | {"median_mm": float(np.median(errors))}
            print(f"{row:<10} {group:<8} {len(right):4d} starts, right {100 * part['right']:5.1f} %,", end=" ")
            print(f"mean {part['error_mm']:6.1f} mm, median {figures[row][group]['median_mm']:6.1f} mm")
    for row in rows[1:]:
        shares = [np.array([run[0].mean() for run in found[name]]) for name in (rows[0], row)]
        gain = paired_bootstrap(100.0 * shares[0], 100.0 * shares[1], np.random.default_rng(0))
        figures[row]["fewer_right_points"] = asdict(gain)
        print(f"{rows[0]} has {gain.mean:.1f} points ({gain.low:.1f} to {gain.high:.1f}) more right than {row}")
    name = f"cold_{options.split}_{options.joints}"
    settings = {"rows": options.rows, "takes": options.takes, "every": options.every, "set": options.set}
    print("written:", save_figures(name, figures, settings))


if __name__ == "__main__":
    main()
