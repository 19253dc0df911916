"""Counts of wrong inputs that are named, of plausible recordings that are doubted, and of attempts at the limits.

python -m benchmarks.plausibility faults [--every 6]    # needs the data of utd-mhad, msr-action3d and the rooms
python -m benchmarks.plausibility limits [--frames 20000]
python -m benchmarks.plausibility long [--frames 20000] [--first-runs 8]    # minutes
python -m benchmarks.plausibility signals [--after 1 3]
"""

from __future__ import annotations

import argparse
import os
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import run_part, save_figures
from tests.container_files import RosWriter
from toolkit.io.errors import DepthMocapError
from toolkit.io.files import OWN_MARK
from toolkit.people.image_rotation import quarter_turns
from toolkit.people.person_network import person_network
from toolkit.people.plausibility import plausibility
from toolkit.recordings.opening import open_recording, recording_of
from toolkit.recordings.writer import RecordingWriter
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording
from toolkit.tracks import Track

COMMAND = f"{sys.executable} -m depthmocap"
KINECT = (525.0, 525.0, 319.5, 239.5)
FRAMES = 12
"""Frames of each recording that are changed in memory."""


def _recordings(every: int) -> list[tuple[Path, dict[str, Any], bool]]:
    """Return recordings of others with their reader options, and True if people are segmented."""
    data = Path(os.environ["DEPTHMOCAP_DATA"])
    found: list[tuple[Path, dict[str, Any], bool]] = []
    for name in ("utd_mhad", "msr_action3d"):
        found += [(path, {}, True) for path in sorted((data / "depth" / name).glob("*_depth.mat"))[::every]]
    rooms = [path.parent for path in sorted((data / "rooms").glob("*/depth"))]
    return found + [(path, {"intrinsics": KINECT}, False) for path in rooms[:: max(1, every // 8)]]


def _scaled(metres: float) -> Callable[[np.ndarray, Camera], tuple[np.ndarray, Camera]]:
    return lambda depth, camera: (np.minimum(np.rint(depth * (0.001 / metres)), 64000).astype(np.uint16), camera)


def _turned(turns: int) -> Callable[[np.ndarray, Camera], tuple[np.ndarray, Camera]]:
    return lambda depth, camera: (np.ascontiguousarray(np.rot90(depth, -turns, (1, 2))), camera.rotated(turns))


def _lens(factor: float) -> Callable[[np.ndarray, Camera], tuple[np.ndarray, Camera]]:
    def change(depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, Camera]:
        fx, fy, cx, cy = (factor * camera.intrinsics).tolist()
        return depth, Camera(fx, fy, cx, cy, camera.width, camera.height)

    return change


def _exchanged(depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, Camera]:
    return depth, Camera(camera.fx, camera.fy, camera.cy, camera.cx, camera.width, camera.height)


FAULTS: dict[str, Callable[[np.ndarray, Camera], tuple[np.ndarray, Camera]]] = {
    "none": lambda depth, camera: (depth, camera),
    "centimetres": _scaled(0.01),
    "inches": _scaled(0.0254),
    "1/5000 m": _scaled(0.0002),
    "1/4 mm": _scaled(0.00025),
    "halved": _scaled(0.002),
    "doubled": _scaled(0.0005),
    "turned by 90 degrees": _turned(1),
    "upside down": _turned(2),
    "turned by 270 degrees": _turned(3),
    "intrinsics of twice the size": _lens(2.0),
    "intrinsics of half the size": _lens(0.5),
    "cx and cy exchanged": _exchanged,
}


def faults(parser: argparse.ArgumentParser) -> None:
    """Count the named faults by kind, of segmented people and of rooms."""
    parser.add_argument("--every", type=int, default=6)
    arguments = parser.parse_args()
    classifier = person_network()
    counts: dict[str, dict[str, list[int]]] = {}
    for path, options, cut_out in _recordings(arguments.every):
        recording = open_recording(path, **options)
        numbers = np.linspace(0, len(recording) - 1, min(FRAMES, len(recording))).astype(int)
        depth, camera = np.stack([recording.depth(int(i)) for i in numbers]), recording.camera.undistorted()
        for name, change in FAULTS.items():
            group = counts.setdefault(name, {}).setdefault("cut out" if cut_out else "room", [0, 0])
            group[0] += _is_named(*change(depth, camera), classifier)
            group[1] += 1
        print(path.name, flush=True)
    for name, groups in counts.items():
        print(name, groups)
    print(save_figures("plausibility_faults", counts, vars(arguments)))


def _is_named(depth: np.ndarray, camera: Camera, classifier: Any) -> bool:
    try:
        recording = recording_of(depth, intrinsics=tuple(camera.intrinsics), frame_rate=30.0)
        return bool(quarter_turns(recording, classifier) or plausibility(recording, classifier))
    except DepthMocapError:
        return True


STREAMED = ("npz", "npz, stored", "npy", "png", "db3")
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


def limits(parser: argparse.ArgumentParser) -> None:
    """Read long recordings of every format, and run commands at the limits of the system."""
    parser.add_argument("--frames", type=int, default=20_000)
    arguments = parser.parse_args()
    figures: dict[str, Any] = {}

    def note(name: str, values: Any) -> None:
        figures[name] = values
        print(name, values, flush=True)

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for form in STREAMED:
            note(f"stream, {form}", _streamed(form, folder, arguments.frames))
        long, short = folder / "long.npz", folder / "short.npz"
        _long(long, 3_000)
        _long(short, 12)
        for label, redirection, environment in (
            ("info", "", {}),
            ("info, closed standard error", "2>&-", {}),
            ("info, closed standard output", ">&-", {}),
            ("info, both closed", ">&- 2>&-", {}),
            ("info, broken pipe", "| true", {}),
            ("info, unusable temporary folder", "", {"TMPDIR": "/dev/full"}),
        ):
            picture = folder / "picture.png"
            picture.unlink(missing_ok=True)
            command = f"{COMMAND} info {short} --output {picture} {redirection}; exit ${{PIPESTATUS[0]}}"
            done = subprocess.run(["bash", "-c", command], env={**os.environ, **environment}, capture_output=True)
            note(label, {"exit code": done.returncode, "picture written": picture.exists()})
        note("track, files of at most 4 kB", _full_disk(short, folder))
        note("report while its run is written", _reported(long, folder))
    print(save_figures("plausibility_limits", figures, vars(arguments)))


def long(parser: argparse.ArgumentParser) -> None:
    """Track a long recording, track with bounds checks, and run at the same time with one cold cache."""
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--first-runs", type=int, default=8)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        short = _long(folder / "short.npz", 12).path
        figures = {
            "bounds checks": _bounds(short, folder),
            "first runs with one cold cache": _first_runs(short, folder, arguments.first_runs),
            "track": _tracked(_long(folder / "long.npz", arguments.frames).path, folder / "run", arguments.frames),
        }
    print(figures)
    print(save_figures("plausibility_long", figures, vars(arguments)))


def signals(parser: argparse.ArgumentParser) -> None:
    """Send each signal to each long command after some seconds, and run it again."""
    parser.add_argument("--after", type=float, nargs="+", default=[2.5], help="seconds of each try")
    parser.add_argument("--only", nargs="+", choices=SIGNALLED, default=list(SIGNALLED))
    arguments = parser.parse_args()
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recording = _long(folder / "recording.npz", 600).path
        names = {"recording": recording, "other": _long(folder / "other.npz", 600).path, "run": folder / "run"}
        names["mocap"] = Path(os.environ["DEPTHMOCAP_DATA"]) / "mocap" / "hdm05"
        subprocess.run(shlex.split(f"{COMMAND} track {recording} --output {names['run']}"), capture_output=True)
        for command in arguments.only:
            counts = {
                "ended": 0,
                "exit 1": 0,
                "finished before": 0,
                "other exits": 0,
                "tracebacks": 0,
                "temporary files left": 0,
            }
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                for after in arguments.after:
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
                    counts["temporary files left"] += sum(
                        path.is_file() and path.name != OWN_MARK for path in folder.rglob(".*")
                    )
                    shutil.rmtree(out.parent)
            figures[command] = counts
            print(command, counts, flush=True)
    print(save_figures("plausibility_signals", figures, vars(arguments)))


def _streamed(form: str, folder: Path, frames: int) -> dict[str, Any]:
    """Frames that a reader yields of a long recording, equal ones among them, and the largest memory in use."""
    path = folder / "streamed"
    options: dict[str, Any] = {"intrinsics": (100.0, 100.0, 39.5, 29.5)}
    depth = _depth()
    if form == "npz":
        path = _long(path.with_suffix(".npz"), frames).path
    elif form == "npz, stored":
        path = path.with_suffix(".npz")
        np.savez(path, depth=np.broadcast_to(depth, (frames, *depth.shape)))
    elif form == "npy":
        path = path.with_suffix(".npy")
        np.save(path, np.broadcast_to(depth, (frames, *depth.shape)))
    elif form == "png":
        import cv2

        path.mkdir()
        content = cv2.imencode(".png", depth)[1].tobytes()
        for i in range(frames):
            (path / f"{i:05}.png").write_bytes(content)
    else:
        options, path = {}, folder / "streamed_db3"
        depth = np.pad(depth, ((0, 84), (0, 96)))  # 176x144 pixels
        with RosWriter(path) as writer:
            writer.camera("/camera/depth/camera_info", 0.0)
            for i in range(frames):
                writer.image("/camera/depth/image_raw", i / 30.0, depth, "16UC1")
    start, count, equal = time.perf_counter(), 0, 0
    for frame in open_recording(path, **options).stream():
        count += 1
        equal += np.array_equal(frame.depth_mm, depth)
    found = {"frames": count, "expected": frames, "equal": equal, "seconds": time.perf_counter() - start}
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    return found


def _tracked(path: Path, run: Path, frames: int) -> dict[str, Any]:
    """Rows of a long track, and the memory of the process that wrote it."""
    start = time.perf_counter()
    done = subprocess.run(shlex.split(f"{COMMAND} track {path} --output {run}"), capture_output=True)
    rows = len(Track.load(run))
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    spent = time.perf_counter() - start
    return {"exit code": done.returncode, "rows": rows, "expected": frames, "seconds": spent, "megabytes": memory}


def _bounds(path: Path, folder: Path) -> dict[str, Any]:
    """Exit code of a track whose compiled loops check their indices, with a cache of its own."""
    typed = f"{COMMAND} track {path} --config hybrid --people all --output {folder / 'checked'}"
    environment = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(folder / "cache")}
    done = subprocess.run(shlex.split(typed), env={**os.environ, **environment}, capture_output=True, text=True)
    return {"hybrid": {"exit code": done.returncode, "index errors": done.stderr.count("IndexError")}}


def _first_runs(path: Path, folder: Path, count: int) -> dict[str, Any]:
    """Exit codes of first runs at the same time, and whether their pictures are equal."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cold")}
    typed = [shlex.split(f"{COMMAND} info {path} --output {folder / f'first_{k}.png'}") for k in range(count)]
    running = [subprocess.Popen(words, env=environment, stderr=subprocess.PIPE, text=True) for words in typed]
    told = [child.communicate()[1] for child in running]
    pictures = {(folder / f"first_{k}.png").read_bytes() for k in range(count)}
    return {
        "exit codes": [child.returncode for child in running], "different pictures": len(pictures),
        "tracebacks": sum("Traceback" in text for text in told),
    }  # fmt: skip


def _full_disk(path: Path, folder: Path) -> dict[str, Any]:
    """A track that may write files of 4 kB at most, and the same again without that limit."""
    typed = f"{COMMAND} track {path} --output {folder / 'full'}"
    first = subprocess.run(["bash", "-c", f"ulimit -f 4; {typed}"], capture_output=True, text=True)
    again = subprocess.run(shlex.split(f"{typed} --resume"), capture_output=True)
    return {
        "exit code": first.returncode, "tracebacks": first.stderr.count("Traceback"),
        "exit code of the next": again.returncode, "rows": len(Track.load(folder / "full")),
    }  # fmt: skip


def _reported(path: Path, folder: Path) -> dict[str, Any]:
    """Reports of a run while it is written; the run is stopped after them and its rows are counted."""
    run, codes, traces = folder / "reported", [], 0
    with subprocess.Popen(shlex.split(f"{COMMAND} track {path} --output {run}"), stderr=subprocess.DEVNULL) as tracking:
        time.sleep(5.0)
        for k in range(3):
            typed = shlex.split(f"{COMMAND} report {run} --output {folder / f'{k}.html'}")
            done = subprocess.run(typed, capture_output=True, text=True)
            codes.append(done.returncode)
            traces += done.stderr.count("Traceback")
        tracking.send_signal(signal.SIGTERM)
    return {"exit codes": codes, "tracebacks": traces, "rows of the run": len(Track.load(run))}


def _depth() -> np.ndarray:
    """A frame of 80x60 pixels with a box of a person's size."""
    depth = np.zeros((60, 80), dtype=np.uint16)
    depth[10:50, 30:50] = 2500
    return depth


def _long(path: Path, frames: int) -> Recording:
    camera = Camera(100.0, 100.0, 39.5, 29.5, 80, 60)
    depth = _depth()
    with RecordingWriter(path, camera, up_camera=(0.0, -1.0, 0.0)) as writer:
        for i in range(frames):
            writer.append(depth, i / 30.0)
    return open_recording(path)


def main() -> None:
    """Run one part."""
    warnings.simplefilter("ignore")
    run_part(__doc__, {"faults": faults, "limits": limits, "long": long, "signals": signals})


if __name__ == "__main__":
    main()
