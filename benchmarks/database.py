"""Database builds: `depthmocap bench database PART`, which is one of

- `size MOCAP [--poses 1000000 5000000] [--selected 25000]`: time and memory. The frames are those of the mocap folder,
  then copies of them with every angle jittered by a Gaussian of 0.02 rad, until there are half as many as poses; they
  are written as AMASS files, and the build mirrors them. Each build runs in a process of its own, so that the memory is
  its own: that of the process that samples, and that of each one that reads. Up to `--checked` poses are also sampled
  by plain farthest-first, which thins nothing: how far a pose can be from a selected one, beside the same where poses
  were thinned as they came. Every size has a file of figures of its own.
- `collections [--collections 40]`: does every build come to its end? Small collections of motion files are drawn by
  seed from all mocap at hand: one to five files, mirrored or not, with the bundled seated motions or without, sampled
  finely or coarsely, on adults or children. Each is built to its end with a small joint regressor, is read back, and
  its regressor is asked. A failure is a row with its reason, and the exit code 1.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from joblib.externals.loky import get_reusable_executor

from benchmarks._record import run_part, save_figures
from database_builder import pool
from database_builder.build import Sampling, build_database
from database_builder.regressor import RegressorSettings
from database_builder.sampling import pose_distance
from tests.support.amass import write_amass
from tests.support.suite import MOCAP
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.database.database import PoseDatabase
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.read import find_clips, read_clip
from toolkit.mocap.retarget import retarget

JITTER = 0.02
"""Radians, standard deviation."""
CLIP = 10_000
"""Frames of one file: long for mocap."""
MEGABYTE = 1024
"""Kilobytes, in which the system tells memory."""


def corpus(mocap: Path, frames: int) -> Iterator[np.ndarray]:
    """`frames` poses (n, P), a clip at a time: the mocap, then jittered copies of it."""
    body, rng = load_body("neutral"), np.random.default_rng(0)
    base = np.concatenate([retarget(read_clip(path), body).poses for path in find_clips(mocap)])
    low, high = skeleton.POSE_LIMITS.T
    done = 0
    while done < frames:
        for start in range(0, len(base), CLIP):
            poses = base[start : start + CLIP][: frames - done]
            if done >= len(base):
                poses = poses.copy()
                poses[:, 3:] += rng.normal(0.0, JITTER, poses[:, 3:].shape)
                poses = np.clip(poses, low, high)
            done += len(poses)
            if len(poses):
                yield poses


def measured_build(folder: Path, output: Path, selected: int, workers: int, part: int) -> dict[str, Any]:
    """Figures of one build of a folder of AMASS files that thins `part` poses together."""
    pool.PART = part
    start = time.perf_counter()
    report = build_database([folder], output, Sampling(max_poses=selected, seated=False), parts=None, workers=workers)
    seconds = time.perf_counter() - start
    if workers > 1:
        get_reusable_executor().shutdown()  # the system tells of processes that have ended
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    joints, thinned = report.database.joints, report.database.notes["thinned"]
    last = float(pose_distance(joints[:-1], joints[-1]).min())
    return {
        "poses_in": report.poses_read,
        "poses_left": thinned.get("poses", report.poses_read),
        "poses_out": len(report.database),
        "seconds": seconds,
        "seconds_by_stage": report.seconds,
        "processor_seconds": own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime,
        "peak_megabytes": own.ru_maxrss / MEGABYTE,
        "peak_megabytes_of_a_reader": children.ru_maxrss / MEGABYTE,
        "file_megabytes": output.stat().st_size / 1e6,
        "distance_of_last_pose_mm": 1000 * last,
        "farthest_pose_at_most_mm": 1000 * (last + thinned.get("cover", 0.0)),
    }


def size(parser: argparse.ArgumentParser) -> None:
    """Parse the command line, build, print and store the figures."""
    parser.add_argument("mocap", type=Path, help="folder of BVH and AMC files")
    parser.add_argument("--poses", type=int, nargs="+", default=[1_000_000, 5_000_000], help="ascending")
    parser.add_argument("--selected", type=int, default=25_000)
    parser.add_argument("--checked", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()

    with tempfile.TemporaryDirectory() as name:
        folder, written, clips = Path(name) / "mocap", 0, corpus(options.mocap, options.poses[-1] // 2)
        folder.mkdir()

        def build(part: int) -> dict[str, Any]:
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
                how = (folder, Path(name) / "poses.npz", options.selected, options.workers, part)
                figures = {"part": part, **process.submit(measured_build, *how).result()}
            for key, value in figures.items():
                print(f"{key:28} {value}", flush=True)
            return figures

        for poses in options.poses:
            while written < poses // 2:
                clip = PoseClip(f"{written:09}", next(clips), 120.0, "jittered")
                write_amass(folder / f"{clip.name}.npz", clip)
                written += len(clip)
            builds = [build(part) for part in ((pool.PART, poses) if poses <= options.checked else (pool.PART,))]
            print(save_figures(f"builder_{poses}", builds, {**vars(options), "jitter_radians": JITTER}))


FOLDERS = (MOCAP, MOCAP.with_name("mocap_more"))
MOST_FILES = 5
BODIES = ("neutral", "slim_male", "heavy_female", "child")
SMALL = RegressorSettings(images=150, pixels=60, trees=2, depth=10, questions=40, calibration=150)


def collections(parser: argparse.ArgumentParser) -> None:
    """Draw and build all collections, print a line for each and store the figures."""
    parser.add_argument("mocap", type=Path, nargs="*", default=FOLDERS, help="folders of motion files")
    parser.add_argument("--collections", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    files = [path for folder in options.mocap for path in find_clips(folder)]
    rows = []
    for number in range(options.collections):
        rows.append(built(files, np.random.default_rng([options.seed, number])))
        print(f"{number:3d} " + " ".join(f"{name}={value}" for name, value in rows[-1].items()), flush=True)
    failed = [row for row in rows if row["failure"]]
    figures = {"collections": len(rows), "failed": len(failed), "builds": rows}
    print(save_figures("builds", figures, {**vars(options), "mocap": [path.name for path in options.mocap]}))
    print(f"{len(failed)} of {len(rows)} builds failed")
    sys.exit(1 if failed else 0)


def built(files: list[Path], rng: np.random.Generator) -> dict[str, Any]:
    """Facts about the build of one collection of `files`; its reason in `failure` where it did not come to its end."""
    chosen = [files[k] for k in np.sort(rng.choice(len(files), rng.integers(1, MOST_FILES + 1), replace=False))]
    body, threshold = str(rng.choice(BODIES)), float(rng.uniform(0.009, 0.03))
    mirror, seated = bool(rng.random() < 0.5), bool(rng.random() < 0.5)
    row = {"files": [path.name for path in chosen], "body": body, "mirror": mirror, "seated": seated}
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "poses.npz"
        try:
            build_database(
                chosen, output, Sampling(threshold, None, mirror, seated), body=load_body(body), parts=SMALL, workers=1
            )  # fmt: skip
            database = PoseDatabase.load(output)
            whole = database.regressor is not None and database.regressor.calibration.shape[1] > 2
            failure = "" if whole else "the joint regressor is not there or not calibrated"
            row |= {"poses": len(database), "megabytes": round(output.stat().st_size / 1e6, 2)}
        except Exception as error:  # whatever ends a build is what is looked for
            failure = f"{type(error).__name__}: {error}"
    return {**row, "seconds": round(time.perf_counter() - start, 1), "failure": failure}


def main() -> None:
    """Run the part that is asked for."""
    run_part(__doc__, {"size": size, "collections": collections})


if __name__ == "__main__":
    main()
