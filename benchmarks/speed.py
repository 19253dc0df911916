"""Time per frame: `depthmocap bench speed PART`, which is one of

- `hybrid DATABASE [--frames 1050] [--max-poses 25000]`: a rendered subject moves before cameras that see it with 3,000,
  6,000 and 16,000 pixels. Times are those of the stages, without reading the file, in one pinned process with one
  thread; the first 50 frames, in which code is compiled, are left out. The same follows at half resolution, the error
  beside both; then the whole frame against the plain pipeline (`tests/support/plain_pipeline.py`) in the same run;
  and the peak memory of `depthmocap track` over a short and a long recording. A database of fewer poses than asked for
  is filled up with its own poses, moved by two degrees per angle. Runs too short for a 99.9th percentile (1,000 frames)
  are written to a file of their own, ending in `_part`.
- `crowd DATABASE [--people 1,2,3,6]`: simulated people of about 6,000 pixels each move side by side before one wide
  camera, already cut out; the image is the same for every count. A frame is one `MultiPersonTracker.step` with a known
  body. The excess is the time over N times that of one person. The people of all counts take their frames in
  turn, so that what else the machine does falls on all alike.
- `passes DATABASE`: `depthmocap track` as it is typed, in two passes and in one (`--online`), of one person of about
  6,000 pixels who is cut out (300 and 600 frames), of six in a furnished room before a Kinect of 640x480 pixels (60 and
  150 frames), and of the classroom of `bench rooms` where its data is. Processor time, at real-time priority where that
  is permitted. A frame costs what the longer recording takes more than the shorter one, and the fixed cost is the rest.
  The first and the second command over 76 frames are measured in new processes, the first one with no kernel compiled.
- `swarm`: the swarm tracker (`benchmarks/_speed_swarm.py`).
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import cycle
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from benchmarks._record import percentiles, pin_to_one_processor, run_part, save_figures
from benchmarks._rows import settings_of
from benchmarks._speed_swarm import swarm
from benchmarks.rooms import RATES, ROOMS, annotations_of
from tests.support import suite
from tests.support.plain_pipeline import PlainTracker
from tests.support.solo import Solo
from tests.support.subjects import DISTANCE, camera_for, draw, moving_poses, write_recording
from toolkit.app.config import load_settings, parse_overrides
from toolkit.body import skeleton
from toolkit.body.shape import load_body, subject_body
from toolkit.database.database import PoseDatabase, PoseOrigins
from toolkit.evaluation.joint_errors import accuracy, frame_errors, joint_errors
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SUBJECT_MOTIONS
from toolkit.people.survey import find_people
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.sensors import KinectV1
from toolkit.simulation.simulate import CaptureSettings, simulate_scene
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracking.multi_person import MultiPersonTracker
from toolkit.tracks import EMPTY, Track
from toolkit.tracks.runs import person_runs

JITTER = np.radians(2.0)
ONE_THREAD = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


SIZES = (3_000, 6_000, 16_000)
WARM_UP = 50
"""Frames without times: the shape is learnt from 45."""


def filled_up(database: PoseDatabase, count: int) -> tuple[PoseDatabase, int]:
    """Return the first `count` poses of a database, filled up with jittered ones, and the number of these."""
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
    mirrored = np.concatenate([database.mirrored, database.mirrored[rows]])
    return PoseDatabase.of_poses(
        np.concatenate([database.poses, extra]), load_body(database.body_name),
        PoseOrigins(database.sources, database.hashes, both[1], both[2], mirrored),
        offsets=both[0],
    ), missing  # fmt: skip


def timed(path: Path, database: PoseDatabase, settings: HybridSettings) -> dict[str, Any]:
    """Return times of each stage and of the whole frame, and the error, of one recording."""
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


def compare(recording: Recording, database: PoseDatabase, settings: HybridSettings, frames: int) -> dict[str, Any]:
    """Return figures of one recording: times of both trackers and the distance of their joints."""
    trackers = (HybridTracker(database, settings), PlainTracker(database, settings))
    people = [Solo(tracker, recording) for tracker in trackers]
    pixels, results = [], []
    for i in range(min(frames, len(recording))):
        depth = recording.depth(i)
        pixels.append(int((depth > 0).sum()))
        results.append([person.step(depth, float(recording.timestamps[i])) for person in people])
    stage_ms = np.array([[result.stage_ms for result in pair] for pair in results])[min(WARM_UP, len(results) // 2) :]
    joints = np.array([[result.joints for result in pair] for pair in results], dtype=np.float64)
    apart = 1000.0 * np.linalg.norm(joints[:, 0] - joints[:, 1], axis=2).max(axis=1)
    total = stage_ms.sum(axis=2)
    return {
        "recording": recording.name,
        "frames": len(results),
        "pixels": float(np.mean(pixels)),
        "compiled": percentiles(total[:, 0]),
        "plain": percentiles(total[:, 1]),
        "faster": float(np.median(total[:, 1]) / np.median(total[:, 0])),
        "stages_ms": {
            name: np.round(np.median(stage_ms[:, :, s], axis=0), 3).tolist()
            for s, name in enumerate(trackers[0].stage_names)
        },
        "apart_mm": {
            "median": float(np.median(apart)),
            "p99": float(np.percentile(apart, 99)),
            "max": float(apart.max()),
        },
        "within_1_mm": float((apart < 1.0).mean()),
        "equal_sources": float(np.mean([a.source == b.source for a, b in results])),
    }


MEASURED = """
import contextlib, os, resource, subprocess, sys
with contextlib.suppress(AttributeError, OSError):  # needs a privilege, and Linux
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
ended = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_maxrss, used.ru_utime + used.ru_stime)
sys.exit(ended)
"""
"""Script that runs a command and prints its peak memory in kilobytes (Linux) and processor time in seconds. It has its
own process, because Linux counts the memory of the parent process too.
"""


def tracked(
    recording: Path, database: Path, output: Path, options: Sequence[str] = (), cache: Path | None = None
) -> tuple[float, float]:
    """Return peak memory, megabytes, and processor time, seconds, of `depthmocap track` over a recording into `output`.

    `cache` is the folder of compiled kernels; default: that of the user.
    """
    command = [
        sys.executable,
        "-m",
        "toolkit.app.cli.main",
        "track",
        recording,
        "--database",
        database,
        "--output",
        output,
    ]
    words = [sys.executable, "-c", MEASURED, *map(str, (*command, *options))]
    own = {} if cache is None else {"NUMBA_CACHE_DIR": str(cache)}
    environment = {**os.environ, **ONE_THREAD, **own}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # else each command compiles all sources
    ended = subprocess.run(words, env=environment, stdout=subprocess.PIPE, text=True, check=False)
    if ended.returncode:
        raise SystemExit(f"depthmocap track of {recording} ended with {ended.returncode}")
    peak, seconds = map(float, ended.stdout.split())
    return peak / 1024.0, seconds


def print_times(rows: list[dict[str, Any]]) -> None:
    """Print one line per recording and resolution, its stages below."""
    print(f"{'pixels':>7} {'':<10} {'median':>8} {'p99':>8} {'p99.9':>8} ms {'error':>7} mm {'A(100)':>7} %")
    for row in rows:
        label = "half" if row["half_resolution"] else ""
        times = (f"{value:8.2f}" for value in row["frame"].values())
        print(f"{row['pixels']:7.0f} {label:<10}", *times, f"   {row['error_mm']:7.1f}    {100 * row['a100']:7.1f}")
        for name, stage in row["stages"].items():
            print(f"{'':7} {name:<10}", *(f"{value:8.2f}" for value in stage.values()))


def hybrid(parser: argparse.ArgumentParser) -> None:
    """Measure, print, write JSON."""
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
            peak, _ = tracked(path, saved, Path(folder) / f"run_{frames}")
            figures["memory"].append({"frames": frames, "peak_mb": peak})
            print(f"peak memory over {frames} frames: {peak:.0f} MB")
    name = "speed" if options.frames >= 1000 + WARM_UP else "speed_part"
    print("written:", save_figures(name, figures, asdict(settings) | {"poses": len(database)}))


PIXELS = 6000
APART = 1.25
"""Distance of two people, metres: with stretched arms they nearly touch."""
UP = np.array([0.0, -1.0, 0.0])
RATE = 30.0
SETTLED = 15
"""Frames left out: half a second after all people were found."""


def wide_camera(people: int) -> Camera:
    """Return a camera that sees a number of people side by side with `PIXELS` pixels each."""
    one = camera_for(PIXELS)
    width = round((people * APART + 0.6) / DISTANCE * one.fx)
    return Camera(one.fx, one.fy, (width - 1) / 2, one.cy, width, one.height)


def row_of_people(people: int, most: int, frames: int) -> np.ndarray:
    """Return depth uint16 (T, H, W), millimetres, of the first `people` of a row of `most`."""
    camera, rng = wide_camera(most), np.random.default_rng(0)
    depth = np.zeros((frames, *camera.shape), dtype=np.uint16)
    for k in range(most):
        poses = moving_poses(frames, rng)
        poses[:, 0] += (k - (most - 1) / 2) * APART
        body = subject_body("neutral", seed=k)
        if k < people:
            for image, pose in zip(depth, poses, strict=True):
                own = np.rint(1000 * draw(body, pose, camera, rng)).astype(np.uint16)
                nearer = (own > 0) & ((image == 0) | (own < image))
                image[nearer] = own[nearer]
    return depth


def frame_times(
    crowds: Sequence[MultiPersonTracker], recordings: Sequence[Recording], counts: Sequence[int]
) -> np.ndarray:
    """Return milliseconds (C, T) of the frames in which all groups track all their people, in turn."""
    times = []
    for frames in zip(*(recording.stream() for recording in recordings), strict=True):
        taken = []
        for crowd, frame in zip(crowds, frames, strict=True):
            start = perf_counter()
            crowd.step(frame)
            taken.append(1000 * (perf_counter() - start))
        if all(len(crowd.bodies) == n for crowd, n in zip(crowds, counts, strict=True)):
            times.append(taken)
    if len(times) <= SETTLED:
        raise SystemExit(f"all people were followed in {len(times)} frames, {SETTLED} of them to warm up; ask for more")
    return np.array(times[SETTLED:]).T


def by_number(
    database: PoseDatabase, counts: Sequence[int], options: argparse.Namespace, folder: Path
) -> dict[str, Any]:
    """Return the median milliseconds of a frame by the number of people, and the excess over the multiple of one
    person.
    """
    camera, recordings = wide_camera(max(counts)), []
    for n in counts:
        path = folder / f"people_{n}.npz"
        save(path, row_of_people(n, max(counts), options.frames), camera)
        recordings.append(open_recording(path))
    tracker = HybridTracker(database, settings_of("hybrid", parse_overrides(options.set)), body=load_body("neutral"))
    times = frame_times(
        [MultiPersonTracker(tracker, find_people(recording), recording.up_camera) for recording in recordings],
        recordings,
        counts,
    )
    median = np.median(times, axis=1)
    rows = {
        str(n): {"median_ms": float(ms), "excess_ms": float(ms - n * median[0])}
        for n, ms in zip(counts, median, strict=True)
    }
    return {"frames": times.shape[1], "people": rows}


def save(path: Path, depth: np.ndarray, camera: Camera) -> None:
    """Save frames as a recording of a horizontal camera."""
    stamps = np.arange(len(depth)) / RATE
    save_recording(path, depth=iter(depth), camera=camera, timestamps=stamps, up_camera=UP)


def crowd(parser: argparse.ArgumentParser) -> None:
    """Time people side by side, print, write JSON."""
    parser.add_argument("database", type=Path)
    parser.add_argument("--people", default="1,2,3,6", help="comma-separated, 1 first")
    parser.add_argument("--frames", type=int, default=100, help="of each recording")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="setting")
    options = parser.parse_args()
    pin_to_one_processor()
    database = PoseDatabase.load(options.database)
    with tempfile.TemporaryDirectory() as folder:
        figures = by_number(database, [int(n) for n in options.people.split(",")], options, Path(folder))
    for n, row in figures["people"].items():
        print(f"{n} people: {row['median_ms']:6.1f} ms, {row['excess_ms']:+.1f} ms over {n} times one")
    print("written:", save_figures("speed_crowd", figures, {"set": options.set, "poses": len(database)}))


SIX = ((-1.5, 0.0), (-0.9, -0.8), (-0.3, 0.2), (0.4, -0.6), (0.9, 0.3), (1.6, -0.4))
"""Places of six people on the floor, metres."""


@dataclass(frozen=True)
class LargeKinect(KinectV1):
    """Kinect of 640x480 pixels."""

    camera: ClassVar = Camera(571.26, 571.26, 319.5, 239.5, 640, 480)


def six_in_a_room(path: Path, frames: int) -> None:
    """Return six people who move in an office, seen by a camera 1.9 m above the floor that looks down."""
    people = []
    for k, (place, motion) in enumerate(zip(SIX, cycle(SUBJECT_MOTIONS), strict=False)):
        body = subject_body("neutral", seed=k)
        poses = suite.cut(suite.motion_of(f"bundled_{motion}", body, seed=k).poses, 0.0, frames, frames)
        people.append(SimulatedPerson(PoseClip(motion, suite.in_place(poses), suite.RATE, ""), body, place))
    shot = CaptureSettings(
        sensor=LargeKinect(), distance=4.2, height=1.9, tilt=13.0, background=False, room="office:53"
    )
    simulate_scene(people, path, shot)


CLASSROOM = ROOMS / "um"
"""Room with up to six people who sit, if its data is here."""
MADE: dict[str, tuple[Callable[[Path, int], None], int, int]] = {
    "one": (lambda path, frames: write_recording(path, PIXELS, frames), 300, 600),
    "six": (six_in_a_room, 60, 150),
}
"""Recordings by the number of people, with the frames of a short and of a long one."""
PASSES = {"two": (), "one": ("--online",)}
TYPED_FRAMES = 76
"""Frames of the recording of the first and second command: those of a recording of UTD-MHAD."""


def passes(parser: argparse.ArgumentParser) -> None:
    """Measure the command in new processes, print, write JSON."""
    parser.add_argument("database", type=Path)
    options = parser.parse_args()
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        track = partial(tracked, database=options.database)
        figures["typed"] = typed(folder, track)
        print("first and second command over 76 frames:", figures["typed"])
        for people, (make, *lengths) in MADE.items():
            paths = [folder / f"{people}_{frames}.npz" for frames in lengths]
            for path, frames in zip(paths, lengths, strict=True):
                make(path, frames)
            figures[people] = {}
            everyone = ("--people", "1" if people == "one" else "all")
            track(paths[0], output=folder / f"first_{people}", options=everyone)  # compiles what is not compiled yet
            for number, extra in PASSES.items():
                runs = [folder / f"{path.stem}_{number}" for path in paths]
                (_, short), (peak, long) = (
                    track(p, output=r, options=(*everyone, *extra)) for p, r in zip(paths, runs, strict=True)
                )
                each = (long - short) / (lengths[1] - lengths[0])
                found = [len(person_runs(run)) for run in runs]
                row = {"frame_ms": 1000 * each, "fixed_s": short - lengths[0] * each, "peak_mb": peak, "found": found}
                figures[people][number] = row
                print(people, "people,", number, "passes:", row)
            figures[people]["ratio"] = figures[people]["two"]["frame_ms"] / figures[people]["one"]["frame_ms"]
        if CLASSROOM.is_dir():
            figures["classroom"] = {
                number: classroom(folder / number, track, extra) for number, extra in PASSES.items()
            }
            print("classroom:", figures["classroom"])
    print("written:", save_figures("speed_passes", figures, {name: lengths for name, (_, *lengths) in MADE.items()}))


def typed(folder: Path, track: Callable[..., tuple[float, float]]) -> dict[str, Any]:
    """Return processor seconds and peak memory of a first command, with no kernel compiled, and of the second one."""
    path, found = folder / "typed.npz", {}
    write_recording(path, PIXELS, TYPED_FRAMES)
    for number in ("first", "second"):
        peak, seconds = track(path, output=folder / f"typed_{number}", cache=folder / "cache")
        found[number] = {"processor_s": round(seconds, 2), "peak_mb": round(peak)}
    return found


def classroom(run: Path, track: Callable[..., tuple[float, float]], extra: Sequence[str]) -> dict[str, Any]:
    """Return the processor seconds of the classroom for each frame in which a person is in view."""
    camera = ",".join(map(str, annotations_of(CLASSROOM.name)["intrinsics"]))
    words = ("--people", "all", "--intrinsics", camera, "--frame-rate", str(RATES[CLASSROOM.name]), *extra)
    peak, seconds = track(CLASSROOM, output=run, options=words)
    seen = sum(int((Track.load(folder).state != EMPTY).sum()) for folder in person_runs(run))
    return {"processor_s": round(seconds, 2), "seen": seen, "each_s": seconds / seen, "peak_mb": round(peak)}


def main() -> None:
    """Run the named part."""
    run_part(__doc__, {"hybrid": hybrid, "crowd": crowd, "passes": passes, "swarm": swarm})


if __name__ == "__main__":
    main()
