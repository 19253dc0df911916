"""Attempts at the limits of the system: `depthmocap bench plausibility PART`, which is one of

- `limits [--frames 20000]`: long recordings of every format that is read frame by frame; a full disk during `track`.
- `long [--frames 20000] [--first-runs 8]`: a track of a long recording, a track with bounds checks in the compiled
  loops, and first runs at the same time with one cold cache.
- `signals [--after 2.5]`: each termination signal to each long command after some seconds.
"""

import argparse
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import benchmark, command_cost, script
from tests.container_files import RosWriter
from toolkit.datasets.folder import data_folder
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import RecordingWriter
from toolkit.sensing.camera import Camera
from toolkit.tracks import Track

COMMAND = f"{sys.executable} -m depthmocap"
STREAMED = ("npz", "npy", "png", "db3")
"""Formats whose frames are read one by one and that store images of any size."""
SIGNALLED: dict[str, str] = {
    "info": "info {recording} --output {out}.png",
    "track": "track {recording} --output {out}",
    "track of several people": "track {recording} --people all --output {out}",
    "batch": "track {recording} {other} --workers 1 --output {out}",
    "joints": "joints {recording} --joints depth --output {out}.npz",
    "render": "render {run} --output {out}.webm",
    "report": "report {run} --output {out}.html",
    "export": "export {run} --output {out}.glb",
    "evaluate": "evaluate {run} --output {out}.csv",
    "simulate": "simulate --output {out}.npz",
    "database build": "database build {mocap} --output {out}.npz",
    "index": "index {mocap} --output {out}.npz",
}
"""Long commands, by name."""


@benchmark(frames=20_000)
def limits(options: argparse.Namespace) -> tuple[str, Any]:
    """Read long recordings of every format, and track with a full disk."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        figures = {f"stream, {form}": streamed(form, folder, options.frames) for form in STREAMED}
        figures["track, files of at most 4 kB"] = on_full_disk(box_recording(folder / "short.npz", 12), folder)
    return "plausibility_limits", figures


@benchmark(frames=20_000, first_runs=8)
def long(options: argparse.Namespace) -> tuple[str, Any]:
    """Track a long recording, track with bounds checks, and run at the same time with one cold cache."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        short = box_recording(folder / "short.npz", 12)
        figures: dict[str, Any] = {
            "bounds checks": {"hybrid": with_bounds_checks(short, folder)},
            "first runs with one cold cache": first_runs(short, folder, options.first_runs),
        }
        path = box_recording(folder / "long.npz", options.frames)
        megabytes, _ = command_cost(["track", path, "--output", folder / "run"])
        rows = len(Track.load(folder / "run"))
        figures["track"] = {"rows": rows, "expected": options.frames, "megabytes": megabytes}
    return "plausibility_long", figures


@benchmark(after=2.5)
def signals(options: argparse.Namespace) -> tuple[str, Any]:
    """Send each signal to each long command after some seconds."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        names = {kind: box_recording(folder / f"{kind}.npz", 600) for kind in ("recording", "other")}
        names |= {"run": folder / "run", "mocap": data_folder() / "mocap" / "hdm05"}
        run(f"track {names['recording']} --output {names['run']}")
        figures = {command: signalled(command, options.after, folder, names) for command in SIGNALLED}
    return "plausibility_signals", figures


def signalled(command: str, after: float, folder: Path, names: dict[str, Path]) -> dict[str, int]:
    """Return how a command ended after each signal, and the numbers of tracebacks and temporary files."""
    counts = Counter({"ended": 0, "exit 1": 0, "finished before": 0, "tracebacks": 0, "temporary files left": 0})
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        out = folder / "out" / f"{command.split()[0]}-{number.name}"
        out.parent.mkdir(exist_ok=True)
        typed = shlex.split(f"{COMMAND} {SIGNALLED[command].format(out=out, **names)}")
        with subprocess.Popen(typed, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as child:
            time.sleep(after)
            child.send_signal(number)
            told = child.communicate()[1]
        known = {128 + number: "ended", -number: "ended", 1: "exit 1", 0: "finished before"}
        counts[known.get(child.returncode, "other exits")] += 1
        counts["tracebacks"] += "Traceback" in told
        counts["temporary files left"] += sum(p.is_file() for p in folder.rglob(".*"))
        shutil.rmtree(out.parent)
    return dict(counts)


def run(words: str, before: str = "", **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command in a shell, after the shell command `before`, with additional environment variables."""
    typed = ["bash", "-c", f"{before} {COMMAND} {words}"]
    return subprocess.run(typed, env={**os.environ, **environment}, capture_output=True, text=True, check=False)


def streamed(form: str, folder: Path, frames: int) -> dict[str, int]:
    """Return the number of frames that a reader yields of a long recording, and of the equal ones."""
    path, options, depth = written(form, folder, frames)
    equal = [np.array_equal(frame.depth_mm, depth) for frame in open_recording(path, **options).stream()]
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    return {"frames": len(equal), "expected": frames, "equal": sum(equal)}


def written(form: str, folder: Path, frames: int) -> tuple[Path, dict[str, Any], np.ndarray]:
    """Write a long recording; return its path, the options of its reader and the depth of each frame."""
    depth, path = box_depth(), folder / "streamed"
    options = {"intrinsics": (100.0, 100.0, 39.5, 29.5)}
    if form == "npz":
        return box_recording(path.with_suffix(".npz"), frames), options, depth
    if form == "npy":
        np.save(path.with_suffix(".npy"), np.broadcast_to(depth, (frames, *depth.shape)))
        return path.with_suffix(".npy"), options, depth
    if form == "png":
        import cv2

        path.mkdir()
        content = cv2.imencode(".png", depth)[1].tobytes()
        for i in range(frames):
            (path / f"{i:05}.png").write_bytes(content)
        return path, options, depth
    path, depth = folder / "streamed_db3", np.pad(depth, ((0, 84), (0, 96)))  # 176x144 pixels
    with RosWriter(path) as writer:
        writer.camera("/camera/depth/camera_info", 0.0)
        for i in range(frames):
            writer.image("/camera/depth/image_raw", i / 30.0, depth, "16UC1")
    return path, {}, depth


def with_bounds_checks(path: Path, folder: Path) -> dict[str, Any]:
    """Return the index errors of a track whose compiled loops check their indices, with their own cache."""
    environment = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(folder / "cache")}
    done = run(f"track {path} --config hybrid --people all --output {folder / 'checked'}", **environment)
    return {"index errors": done.stderr.count("IndexError")}


def first_runs(path: Path, folder: Path, count: int) -> dict[str, Any]:
    """Return the exit codes of first runs at the same time, and the number of different pictures."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cold")}
    typed = [shlex.split(f"{COMMAND} info {path} --output {folder / f'first_{k}.png'}") for k in range(count)]
    running = [subprocess.Popen(words, env=environment) for words in typed]
    codes = [child.wait() for child in running]
    pictures = {(folder / f"first_{k}.png").read_bytes() for k in range(count)}
    return {"exit codes": codes, "different pictures": len(pictures)}


def on_full_disk(path: Path, folder: Path) -> dict[str, Any]:
    """Return the result of a track that may write files of 4 kB at most, and of the same without that limit."""
    words = f"track {path} --output {folder / 'full'}"
    first, _ = run(words, "ulimit -f 4;"), run(f"{words} --resume")
    tracebacks = first.stderr.count("Traceback")
    return {"exit code": first.returncode, "tracebacks": tracebacks, "rows": len(Track.load(folder / "full"))}


def box_depth() -> np.ndarray:
    """Return a frame of 80x60 pixels with a box of a person's size."""
    depth = np.zeros((60, 80), dtype=np.uint16)
    depth[10:50, 30:50] = 2500
    return depth


def box_recording(path: Path, frames: int) -> Path:
    """Write a recording of the box and return its path."""
    with RecordingWriter(path, Camera(100.0, 100.0, 39.5, 29.5, 80, 60), up_camera=(0.0, -1.0, 0.0)) as writer:
        for i in range(frames):
            writer.append(box_depth(), i / 30.0)
    return path


main = script(__name__, __doc__, {"limits": limits, "long": long, "signals": signals})
