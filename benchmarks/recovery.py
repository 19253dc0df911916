"""Recovery from wrong poses and from no pose: `depthmocap bench recovery PART`, which is one of

- `wrong [--split report] [--starts 50]`: the recordings of the simulated suite are tracked. At random correct frames
  the tracker's previous pose is replaced by a wrong one, with facing and centre to match: a random database pose in the
  same place; left and right exchanged; the body rotated by 180 degrees; the arms exchanged; the body shifted by 1 m in
  a random horizontal direction. The figure is the number of frames until the result is correct, starting from 1.
  Recordings that end before continue backwards. A start counts only if the wrong pose is not correct. No recovery
  within 90 frames counts as 90; incorrect undisturbed frames are counted too.
- `cold [--split report] [--joints depth] [--rows hybrid,no swarm] [--every 12]`: every N-th frame of the suite is
  tracked alone, as after a loss, with the body that was learnt from the recording. Rows are the hybrid
  tracker with the swarm among its hypotheses and without it, and the swarm tracker, which has no database. Rows after
  the first one are compared with it by a paired bootstrap over the recordings.

Right is a frame of which 18 of 20 joints are within 150 mm. `--joints` gives every frame joints in the image (see
`bench swarm`).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import asdict
from itertools import cycle, islice
from typing import Any

import numpy as np

from benchmarks._record import run_part, save_figures
from benchmarks._rows import (
    add_database_options,
    add_take_options,
    make_tracker,
    poses_of,
    settings_of,
    swarm_settings,
)
from benchmarks._takes import SOURCES, is_right, joints_of, prepared
from tests.support.bootstrap import paired_bootstrap
from tests.support.misled import KINDS, misled, wrong_pose
from tests.support.solo import Solo
from tests.support.suite import GROUPS, LONGEST, chosen_takes
from toolkit.app.config import parse_overrides
from toolkit.database.database import PoseDatabase
from toolkit.sensing.recording import Recording
from toolkit.trackers.qammaz.tracker import SwarmTracker
from toolkit.tracking.tracker_protocol import Tracker

CAP = 90
"""Frames after which a start counts as not recovered."""


def frames_from(start: int, total: int) -> Iterator[int]:
    """Yield frame numbers after `start`, to the end, back to the beginning, and so on."""
    there_and_back = [*range(total), *range(total - 2, 0, -1)]
    return islice(cycle(there_and_back), start + 1, None)


def recovery(solo: Solo, recording: Recording, start: int, wrong: np.ndarray) -> int | None:
    """Return the recovery time in frames after `start`, None if more than `CAP`; the person's state is unchanged."""
    undisturbed = solo.follower.state
    solo.follower.state = misled(undisturbed, wrong)
    timestamp = float(recording.timestamps[start])
    step = float(np.median(np.diff(recording.timestamps)))
    taken = None
    for count, i in enumerate(islice(frames_from(start, len(recording)), CAP), start=1):
        timestamp += step
        if is_right(solo.step(recording.depth(i), timestamp, joints_of(recording, i)).joints, recording.joints[i]):
            taken = count
            break
    solo.follower.state = undisturbed
    return taken


def run(
    tracker: Tracker, recordings: list[Recording], poses: np.ndarray, starts: int, rng: np.random.Generator
) -> tuple[list[dict[str, Any]], float]:
    """Run all starts, spread over the recordings; also return the fraction of correct undisturbed frames."""
    found: list[dict[str, Any]] = []
    right: list[bool] = []
    for number, recording in enumerate(recordings):
        due = [kind for k, kind in enumerate(KINDS) for _ in range(_share(starts, len(recordings), number, k))]
        rng.shuffle(due)
        # a start has a frame before which it does not begin; it begins at the next frame that allows it
        waiting = sorted(zip(rng.integers(1, max(2, int(0.7 * len(recording))), len(due)).tolist(), due, strict=True))
        solo = Solo(tracker, recording)
        for i in range(len(recording)):
            result = solo.step(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i))
            right.append(is_right(result.joints, recording.joints[i]))
            if not right[-1] or solo.follower.state.previous is None:
                continue
            for entry in [entry for entry in waiting if entry[0] <= i]:
                kind = entry[1]
                wrong = wrong_pose(kind, solo.follower.state.pose, poses, rng)
                joints = solo.body.joint_positions(wrong) @ solo.level_rotation
                if is_right(joints, recording.joints[i]):
                    continue
                waiting.remove(entry)
                taken = recovery(solo, recording, i, wrong)
                found.append({"kind": kind, "recording": recording.name, "frame": i, "frames": taken})
        print(f"\r{number + 1} of {len(recordings)} recordings, {len(found)} starts", end="", flush=True)
    print()
    return found, float(np.mean(right))


def _share(starts: int, recordings: int, number: int, kind: int) -> int:
    """Return the number of starts of a kind in a recording; the remainder rotates over the recordings."""
    each, rest = divmod(starts, recordings)
    return each + ((number + kind * rest) % recordings < rest)


def summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Return median and 95th percentile of the frames, and the number of failed recoveries."""
    frames = [CAP if entry["frames"] is None else entry["frames"] for entry in found]
    return {
        "starts": len(found),
        "median": float(np.median(frames)) if frames else None,
        "p95": float(np.percentile(frames, 95)) if frames else None,
        "not_recovered": sum(entry["frames"] is None for entry in found),
    }


def wrong_starts(parser: argparse.ArgumentParser) -> None:
    """Measure, print one line per kind, write JSON."""
    add_take_options(parser)
    parser.add_argument("--starts", type=int, default=50, help="of each kind")
    parser.add_argument("--joints", choices=SOURCES, default="none")
    add_database_options(parser)
    options = parser.parse_args()
    takes = chosen_takes(options.split, count=options.takes)
    recordings = [prepared(take, options.joints, options.work, options.frames) for take in takes]
    poses = PoseDatabase.load(poses_of(options))
    overrides = parse_overrides(options.set)
    tracker = make_tracker("hybrid", poses, overrides)
    found, right = run(tracker, recordings, poses.poses, options.starts, np.random.default_rng(0))
    kinds = {kind: summary([entry for entry in found if entry["kind"] == kind]) for kind in KINDS}
    kinds["all"] = summary(found)
    print(f"{'wrong start':<16}{'starts':>7}{'median':>8}{'p95':>6}{'not recovered':>15}")
    for kind, row in kinds.items():
        if row["starts"]:
            print(f"{kind:<16}{row['starts']:7d}{row['median']:8.0f}{row['p95']:6.0f}{row['not_recovered']:15d}")
    print(f"undisturbed frames that are right: {100 * right:.1f} %")
    whole = options.takes is None and options.frames >= LONGEST and not options.set
    figures = {"kinds": kinds, "starts": found, "undisturbed_right": right}
    settings = asdict(settings_of("hybrid", overrides)) | {"poses": len(poses), "cap": CAP}
    name = f"recovery_{options.split}{'' if options.joints == 'none' else '_joints'}{'' if whole else '_part'}"
    print("written:", save_figures(name, figures, settings | {"joints": options.joints}))


COLD_ROWS = ("hybrid", "no swarm", "swarm")
EVERY = 12
"""Frames from one start to the next."""


def without_swarm() -> list[str]:
    """Hypotheses of the hybrid tracker without the swarm."""
    return [name for name in settings_of("hybrid").hypotheses if name != "swarm"]


def tracker_of(row: str, database: PoseDatabase | None, overrides: dict[str, Any]) -> Tracker:
    """Return the tracker of a row."""
    if row == "swarm" or database is None:
        return SwarmTracker(swarm_settings("swarm", overrides))
    own = {"hypotheses": without_swarm()} if row == "no swarm" else {}
    return make_tracker("hybrid", database, {**overrides, **own})


def started(tracker: Tracker, recording: Recording, every: int) -> tuple[np.ndarray, np.ndarray]:
    """Return whether each start is correct, bool (N,), and its mean error in millimetres (N,)."""
    solo = Solo(tracker, recording)
    first = solo.follower.state
    right, errors = [], []
    for i in range(0, len(recording), every):
        solo.follower.state = first
        result = solo.step(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i))
        right.append(is_right(result.joints, recording.joints[i]))
        errors.append(1000.0 * np.linalg.norm(result.joints - recording.joints[i], axis=1).mean())
    return np.array(right), np.array(errors)


def cold(parser: argparse.ArgumentParser) -> None:
    """Measure, print one line per group, write JSON."""
    add_take_options(parser)
    parser.add_argument("--joints", choices=SOURCES, default="depth")
    parser.add_argument("--rows", default="hybrid,no swarm", help=f"out of {', '.join(COLD_ROWS)}, with commas")
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


def main() -> None:
    """Run the named part."""
    run_part(__doc__, {"wrong": wrong_starts, "cold": cold})


if __name__ == "__main__":
    main()
