"""Recovery from wrong poses and from no pose: `depthmocap bench recovery PART`, which is one of

- `wrong [--split report] [--starts 50]`: the recordings of the simulated suite are tracked. At random correct frames
  the tracker's previous pose is replaced by a wrong one, with facing and centre to match: a random database pose in the
  same place; left and right exchanged; the body rotated by 180 degrees; the arms exchanged; the body shifted by 1 m in
  a random horizontal direction. The figure is the number of frames until the result is correct, starting from 1.
  Recordings that end before continue backwards. A start counts only if the wrong pose is not correct. No recovery
  within 90 frames counts as 90.
- `cold [--split report] [--joints depth] [--every 24]`: every N-th frame of the suite is tracked alone, as after a
  loss, with the body that was learnt from the recording. Rows are the hybrid tracker with the swarm among its
  hypotheses and without it, compared by a paired bootstrap over the recordings.

Correct is a frame of which 18 of 20 joints are within 150 mm.
"""

import argparse
from dataclasses import asdict
from itertools import cycle, islice
from typing import Any

import numpy as np

from benchmarks._record import benchmark, script
from benchmarks._rows import DATABASE, TAKES, make_tracker, poses_of, settings_of
from benchmarks._takes import SOURCES, is_right, joints_of, prepared
from tests.support.bootstrap import paired_bootstrap
from tests.support.misled import KINDS, misled, wrong_pose
from tests.support.solo import Solo
from tests.support.suite import chosen_takes
from toolkit.app.config import parse_overrides
from toolkit.database.database import PoseDatabase
from toolkit.sensing.recording import Recording
from toolkit.tracking.tracker_protocol import Tracker

CAP = 90
"""Frames after which a start counts as not recovered."""


def recovery(solo: Solo, recording: Recording, start: int, wrong: np.ndarray) -> int | None:
    """Return the recovery time in frames after `start`, None if more than `CAP`; the person's state is unchanged."""
    undisturbed = solo.follower.state
    solo.follower.state = misled(undisturbed, wrong)
    timestamp = float(recording.timestamps[start])
    step = float(np.median(np.diff(recording.timestamps)))
    taken = None
    there_and_back = [*range(len(recording)), *range(len(recording) - 2, 0, -1)]
    for count, i in enumerate(islice(cycle(there_and_back), start + 1, start + 1 + CAP), start=1):
        timestamp += step
        if is_right(solo.step(recording.depth(i), timestamp).joints, recording.joints[i]):
            taken = count
            break
    solo.follower.state = undisturbed
    return taken


def recoveries(
    tracker: Tracker, recording: Recording, due: list[str], poses: np.ndarray, rng: np.random.Generator
) -> list[dict[str, Any]]:
    """Track one recording and start from each `due` kind of wrong pose at a random correct frame."""
    rng.shuffle(due)
    # a start has a frame before which it does not begin; it begins at the next frame that allows it
    waiting = sorted(zip(rng.integers(1, max(2, int(0.7 * len(recording))), len(due)).tolist(), due, strict=True))
    solo, found = Solo(tracker, recording), []
    for i in range(len(recording)):
        result = solo.step(recording.depth(i), float(recording.timestamps[i]))
        if not is_right(result.joints, recording.joints[i]) or solo.follower.state.previous is None:
            continue
        for entry in [entry for entry in waiting if entry[0] <= i]:
            wrong = wrong_pose(entry[1], solo.follower.state.pose, poses, rng)
            if not is_right(solo.body.joint_positions(wrong) @ solo.level_rotation, recording.joints[i]):
                waiting.remove(entry)
                taken = recovery(solo, recording, i, wrong)
                found.append({"kind": entry[1], "recording": recording.name, "frame": i, "frames": taken})
    return found


def shared_out(starts: int, recordings: int, number: int, kind: int) -> int:
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


@benchmark(TAKES, DATABASE, starts=50)
def wrong_starts(options: argparse.Namespace) -> tuple[str, Any]:
    """Measure the recovery from wrong poses."""
    takes, rng = chosen_takes(options.split, count=options.takes), np.random.default_rng(0)
    poses = PoseDatabase.load(poses_of(options)).poses
    tracker, found = make_tracker("hybrid", poses_of(options), parse_overrides(options.set)), []
    for number, take in enumerate(takes):
        recording = prepared(take, "none", options.work, options.frames)
        due = [kind for k, kind in enumerate(KINDS) for _ in range(shared_out(options.starts, len(takes), number, k))]
        found += recoveries(tracker, recording, due, poses, rng)
        print(f"\r{number + 1} of {len(takes)} recordings, {len(found)} starts", end="", flush=True)
    kinds = {kind: summary([entry for entry in found if entry["kind"] == kind]) for kind in KINDS}
    kinds["all"] = summary(found)
    print()
    return f"recovery_{options.split}", {"kinds": kinds, "starts": found}


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


@benchmark(TAKES, DATABASE, joints={"choices": SOURCES, "default": "depth"}, every=24)
def cold(options: argparse.Namespace) -> tuple[str, Any]:
    """Measure the first pose of every N-th frame."""
    overrides = parse_overrides(options.set)
    fewer = [name for name in settings_of("hybrid").hypotheses if name != "swarm"]
    rows: dict[str, dict[str, Any]] = {"hybrid": {}, "no swarm": {"hypotheses": fewer}}
    trackers = {row: make_tracker("hybrid", poses_of(options), {**overrides, **own}) for row, own in rows.items()}
    found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {row: [] for row in rows}
    for take in chosen_takes(options.split, count=options.takes):
        recording = prepared(take, options.joints, options.work, options.frames)
        for row, tracker in trackers.items():
            found[row].append(started(tracker, recording, options.every))
        print(take.name, {row: f"{100 * runs[-1][0].mean():.0f} %" for row, runs in found.items()}, flush=True)
    figures: dict[str, Any] = {}
    for row, runs in found.items():
        right, errors = (np.concatenate(parts) for parts in zip(*runs, strict=True))
        overall = {"starts": len(right), "right": float(right.mean()), "error_mm": float(errors.mean())}
        figures[row] = {"overall": overall}
    first, second = (100.0 * np.array([right.mean() for right, _ in runs]) for runs in found.values())
    figures["no swarm"]["fewer_right_points"] = asdict(paired_bootstrap(first, second, np.random.default_rng(0)))
    return f"cold_{options.split}_{options.joints}", figures


main = script(__name__, __doc__, {"wrong": wrong_starts, "cold": cold})
