"""Time per frame: `depthmocap bench speed DATABASE [--frames 1050] [--max-poses 25000]`.

A rendered subject moves before cameras that see it with 3,000, 6,000 and 16,000 pixels. Times are those of the stages,
without reading the file, in one pinned process with one thread; the first 50 frames, in which code is compiled, are
left out. The same follows at half resolution, the error beside both; then the whole frame against the plain pipeline
(`benchmarks/plain_pipeline.py`) in the same run; and the peak memory of `depthmocap track` over a short and a long
recording. A database of fewer poses than asked for is filled up with its own poses, moved by two degrees per angle.
Runs too short for a 99.9th percentile (1,000 frames) are written to a file of their own, ending in `_part`.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from benchmarks._timing import percentiles, pin_to_one_processor
from benchmarks.plain_pipeline import SIZES, WARM_UP, compare
from toolkit import skeleton
from toolkit.body.shape import load_body
from toolkit.config import load_settings
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.joints import accuracy, frame_errors, joint_errors
from toolkit.hybrid.settings import HybridSettings
from toolkit.hybrid.tracker import HybridTracker
from toolkit.recordings.opening import open_recording
from toolkit.testing.subjects import write_recording
from toolkit.tracking.solo import Solo

JITTER = np.radians(2.0)
ONE_THREAD = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def filled_up(database: PoseDatabase, count: int) -> tuple[PoseDatabase, int]:
    """The first `count` poses of a database, filled up with jittered ones if there are fewer; and how many of those."""
    missing = count - len(database)
    if missing <= 0:
        return database.limited(count), 0
    rng = np.random.default_rng(0)
    rows = rng.integers(len(database), size=missing)
    extra = database.poses[rows].astype(np.float64)
    extra[:, 6:] += rng.normal(0.0, JITTER, (missing, skeleton.POSE_SIZE - 6))
    extra[:, 6:] = np.clip(extra[:, 6:], *skeleton.POSE_LIMITS[6:].T)
    both = [
        np.concatenate([part, part[rows]]) for part in (database.offsets, database.pose_source, database.pose_frame)
    ]
    return PoseDatabase.of_poses(
        np.concatenate([database.poses, extra]), load_body(database.body_name), sources=database.sources,
        hashes=database.hashes, offsets=both[0], pose_source=both[1], pose_frame=both[2],
        mirrored=np.concatenate([database.mirrored, database.mirrored[rows]]), regressor=database.regressor,
    ), missing  # fmt: skip


def timed(path: Path, database: PoseDatabase, settings: HybridSettings) -> dict[str, Any]:
    """Times of every stage and of the whole frame, and the error, of one recording."""
    recording = open_recording(path)
    tracker = HybridTracker(database, settings)
    solo = Solo(tracker, recording)
    results, pixels = [], []
    for frame in recording.stream():
        results.append(solo.step(frame.depth_mm, frame.timestamp))
        pixels.append(int((frame.depth_mm > 0).sum()))
    warm = min(WARM_UP, len(results) // 2)
    stage_ms = np.array([result.stage_ms for result in results], dtype=np.float64)[warm:]
    errors = joint_errors(np.array([result.joints for result in results]), recording.joints)
    return {
        "recording": recording.name,
        "frames": len(stage_ms),
        "pixels": float(np.mean(pixels)),
        "half_resolution": settings.sensing.half_resolution,
        "frame": percentiles(stage_ms.sum(axis=1)),
        "stages": {name: percentiles(stage_ms[:, s]) for s, name in enumerate(tracker.stage_names)},
        "error_mm": 1000 * float(np.nanmean(frame_errors(errors))),
        "a100": float(accuracy(errors)),
    }


def peak_memory(recording: Path, database: Path, output: Path) -> float:
    """Peak resident memory of `depthmocap track` over a recording, megabytes; its run folder goes to `output`."""
    command = [sys.executable, "-m", "toolkit.cli.main", "track", recording, "--database", database, "--output", output]
    process = subprocess.Popen(
        [str(word) for word in command], env={**os.environ, **ONE_THREAD}, stdout=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"depthmocap track of {recording} ended with {process.returncode}")
    return usage.ru_maxrss / 1024.0  # kilobytes, on Linux


def print_times(rows: list[dict[str, Any]]) -> None:
    """One line per recording and resolution, its stages below."""
    print(f"{'pixels':>7} {'':<10} {'median':>8} {'p99':>8} {'p99.9':>8} ms {'error':>7} mm {'A(100)':>7} %")
    for row in rows:
        label = "half" if row["half_resolution"] else ""
        times = (f"{value:8.2f}" for value in row["frame"].values())
        print(f"{row['pixels']:7.0f} {label:<10}", *times, f"   {row['error_mm']:7.1f}    {100 * row['a100']:7.1f}")
        for name, stage in row["stages"].items():
            print(f"{'':7} {name:<10}", *(f"{value:8.2f}" for value in stage.values()))


def main() -> None:
    """Measure, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("database", type=Path)
    parser.add_argument("--frames", type=int, default=1050, help="of each recording")
    parser.add_argument("--plain-frames", type=int, default=120, help="against the plain pipeline; 0 leaves it out")
    parser.add_argument("--memory-frames", type=int, nargs="*", default=[200, 2000], help="recordings for peak memory")
    parser.add_argument("--max-poses", type=int, default=25_000)
    parser.add_argument("--config", default="hybrid")
    options = parser.parse_args()
    pin_to_one_processor()
    database, jittered = filled_up(PoseDatabase.load(options.database), options.max_poses)
    print(f"{len(database)} poses, {jittered} of them jittered")
    settings = load_settings(HybridSettings, options.config)
    half = load_settings(HybridSettings, options.config, {"sensing.half_resolution": True})
    figures: dict[str, Any] = {"jittered_poses": jittered}
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"rendered_{size}.npz" for size in SIZES]
        for path, size in zip(paths, SIZES, strict=True):
            write_recording(path, size, options.frames)
        figures["times"] = [timed(path, database, chosen) for path in paths for chosen in (settings, half)]
        print_times(figures["times"])
        if options.plain_frames:
            figures["plain"] = [compare(open_recording(p), database, settings, options.plain_frames) for p in paths]
            for row in figures["plain"]:
                print(
                    f"{row['pixels']:7.0f} pixels: {row['compiled']['median_ms']:.2f} ms, plain"
                    f" {row['plain']['median_ms']:.0f} ms, {row['faster']:.1f} times faster,"
                    f" joints apart by {row['apart_mm']['median']:.3f} mm (median)"
                )
        figures["memory"] = []
        saved = Path(folder) / "poses.npz"
        database.save(saved)
        for frames in options.memory_frames:
            path = Path(folder) / f"memory_{frames}.npz"
            write_recording(path, SIZES[1], frames)
            peak = peak_memory(path, saved, Path(folder) / f"run_{frames}")
            figures["memory"].append({"frames": frames, "peak_mb": peak})
            print(f"peak memory over {frames} frames: {peak:.0f} MB")
    name = "speed" if options.frames >= 1000 + WARM_UP else "speed_part"
    print("written:", save_figures(name, figures, asdict(settings) | {"poses": len(database)}))


if __name__ == "__main__":
    main()
