"""Batches and evaluations of many runs: `depthmocap bench scale --database POSES [--recordings 24] [--runs 1000
10000]`.

Tracks recordings of UTD-MHAD by `depthmocap track --workers`, as a batch is tracked, and says how many hours of a core
a thousand of them take. Then evaluates as many runs as are asked for, each in a process of its own: copies of eight
runs of UTD-MHAD's length over small depth images, compared with another system's skeleton, which takes the most memory.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from benchmarks._rows import add_database_options, poses_of
from benchmarks.real import RECORDINGS
from toolkit.app.pipeline.manifest import DONE, MANIFEST_FILE
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.evaluation.evaluate import evaluate_runs
from toolkit.io.files import sha256_of
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera
from toolkit.tracks import TRACKED, FrameResult, RunInfo, TrackWriter

FRAMES = 67
"""Of a recording: the mean of UTD-MHAD."""
TURN = np.diag([1.0, -1.0, -1.0])
"""R_level_camera of a camera that looks horizontally."""


def measured_batch(recordings: list[Path], database: Path, workers: int, runs: Path) -> dict[str, Any]:
    """Figures of a batch that is tracked as it is typed."""
    command = [
        sys.executable,
        "-m",
        "toolkit.app.cli.main",
        "track",
        *map(str, recordings),
        "--database",
        str(database),
    ]
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([*command, "--output", str(runs), "--workers", str(workers)], check=True, capture_output=True)
    after, seconds = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - start
    rows = [json.loads(line) for line in (runs / MANIFEST_FILE).read_text().splitlines()[1:]]
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    frames = sum(row["frames"] for row in rows)
    return {
        "recordings": len(rows),
        "done": sum(row["status"] == DONE for row in rows),
        "frames": frames,
        "workers": workers,
        "seconds": seconds,
        "processor_seconds": processor,
        "core_hours_per_1000_recordings": processor / len(rows) / 3.6,
        "core_hours_per_million_frames": processor / frames / 3.6e-3,
        "peak_megabytes_of_a_process": after.ru_maxrss / 1024,
    }


def make_runs(folder: Path, count: int) -> None:
    """So many run folders of eight recordings of eight people."""
    rng, body = np.random.default_rng(0), load_body("neutral")
    poses = np.zeros((FRAMES, skeleton.POSE_SIZE))
    poses[:, :3] = 0.0, 0.0, -3.0
    poses[:, 6:] = rng.normal(0.0, 0.1, (FRAMES, skeleton.POSE_SIZE - 6))
    joints = (body.joint_positions(poses) @ TURN).astype(np.float32)
    depth = np.where(rng.random((FRAMES, 24, 32)) < 0.3, 3000, 0).astype(np.uint16)
    for person in range(8):
        recording = folder / f"a1_s{person}_t1.npz"
        other = joints + rng.normal(0.0, 0.03, joints.shape)
        save_recording(
            recording, depth=depth, camera=Camera(30.0, 30.0, 15.5, 11.5, 32, 24), timestamps=np.arange(FRAMES) / 15,
            reference_joints=other,
        )  # fmt: skip
        run = folder / "runs" / f"{person:05}"
        writer = TrackWriter(run, ("fit",), ("local",))
        for i, pose in enumerate(poses):
            ones = np.ones(20, np.float32)
            writer.append(FrameResult(pose, joints[i], ones, TRACKED, 0, np.ones(1, np.float32)), i / 15)
        writer.finish()
        RunInfo(
            str(recording), sha256_of(recording), {}, skeleton.fingerprint(), [0.0], 1.0, "", TURN.ravel().tolist(),
            {}, "0",
        ).save(run)  # fmt: skip
    for number in range(8, count):
        copy = folder / "runs" / f"{number:05}"
        copy.mkdir()
        for file in (folder / "runs" / f"{number % 8:05}").iterdir():
            os.link(file, copy / file.name)


def measured_evaluation(folder: Path) -> dict[str, Any]:
    """Figures of one evaluation, in a process of its own."""
    start = time.perf_counter()
    table = evaluate_runs([folder / "runs"], surface=False)
    return {
        "runs": len(table),
        "seconds": time.perf_counter() - start,
        "peak_megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "agreement": table.mean().agreement_offsets,
    }


def main() -> None:
    """Parse the command line, measure, print and store the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_database_options(parser)
    parser.add_argument("--recordings", type=int, default=24, help="of UTD-MHAD, evenly spaced")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--runs", type=int, nargs="+", default=[1000, 10_000])
    options = parser.parse_args()
    figures: dict[str, Any] = {"evaluate": []}
    with tempfile.TemporaryDirectory() as name:
        paths = sorted(RECORDINGS.glob("*_depth.mat"))
        chosen = [paths[i] for i in np.unique(np.linspace(0, len(paths) - 1, options.recordings).astype(int))]
        figures["batch"] = measured_batch(chosen, poses_of(options), options.workers, Path(name) / "batch")
        print(figures["batch"], flush=True)
        for count in options.runs:
            folder = Path(name) / f"of {count}"
            folder.mkdir()
            make_runs(folder, count)
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
                figures["evaluate"].append(process.submit(measured_evaluation, folder).result())
            print(figures["evaluate"][-1], flush=True)
            shutil.rmtree(folder)
    print(save_figures("scale", figures, vars(options)))


if __name__ == "__main__":
    main()
