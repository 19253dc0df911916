"""Time per frame by the number of people, and what unobserved space costs: `depthmocap bench crowd_speed DATABASE`.

Simulated people of about 6,000 pixels each move side by side before one wide camera, already cut out; the image is the
same however many there are. A frame is all that `Crowd.step` does: finding, sharing out, following, with a known body;
the first frames are left out. The excess is the time over N times that of one person. The people of all
counts take their frames in turn, in one pinned process with one thread, so that what else the machine does falls on all
alike.

Unobserved space is timed on one person behind a crate that the empty scene shows: with it, and without
(`no unobserved` of `benchmarks/_rows.py`), frame by frame in turn; the median of the differences counts, and what it
takes to find the pixels that say nothing, which is timed alone.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from benchmarks._rows import make_tracker, settings_of
from benchmarks._timing import pin_to_one_processor
from toolkit.body.shape import load_body, subject_body
from toolkit.config import parse_overrides
from toolkit.database.database import PoseDatabase
from toolkit.hybrid.tracker import HybridTracker
from toolkit.people.survey import find_people
from toolkit.people.visibility import hole_sizes, unobserved_pixels
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording
from toolkit.testing.subjects import DISTANCE, camera_for, draw, moving_poses
from toolkit.tracking.crowd import Crowd
from toolkit.tracking.protocol import Tracker

Figures = dict[str, Any]
PIXELS = 6000
APART = 1.25
"""Metres between two people: with arms stretched out they nearly touch."""
CRATE = 0.55
"""Metres below the camera at which the upper edge of the crate is seen: it hides the shins."""
UP = np.array([0.0, -1.0, 0.0])
RATE = 30.0
WARM_UP = 15
"""Frames that are left out: half a second after everybody was found."""


def wide_camera(people: int) -> Camera:
    """A camera that sees so many people side by side with `PIXELS` pixels each."""
    one = camera_for(PIXELS)
    width = round((people * APART + 0.6) / DISTANCE * one.fx)
    return Camera(one.fx, one.fy, (width - 1) / 2, one.cy, width, one.height)


def row_of_people(people: int, most: int, frames: int) -> np.ndarray:
    """Depth uint16 (T, H, W), millimetres, of the first `people` of a row of `most`."""
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


def behind_a_crate(depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The frames (T, H, W) with a crate before the person's shins and a wall behind, and the empty scene (H, W)."""
    near = DISTANCE - 0.5
    empty = np.full(camera.shape, round(1000 * (DISTANCE + 1.5)), dtype=np.uint16)
    empty[round(camera.cy + CRATE / near * camera.fy) :] = round(1000 * near)
    return np.where((depth > 0) & (depth < empty), depth, empty), empty


def crowd_before(recording: Recording, tracker: Tracker) -> Crowd:
    """Nobody yet, before the camera of a recording."""
    return Crowd(tracker, find_people(recording), recording.up_camera)


def frame_times(crowds: Sequence[Crowd], recordings: Sequence[Recording], counts: Sequence[int]) -> np.ndarray:
    """Milliseconds (C, T) of the frames in which all crowds follow as many people as they should, taken in turn."""
    times = []
    for frames in zip(*(recording.stream() for recording in recordings), strict=True):
        taken = []
        for crowd, frame in zip(crowds, frames, strict=True):
            start = perf_counter()
            crowd.step(frame)
            taken.append(1000 * (perf_counter() - start))
        if all(len(crowd.bodies) == n for crowd, n in zip(crowds, counts, strict=True)):
            times.append(taken)
    if len(times) <= WARM_UP:
        raise SystemExit(f"everybody was followed in {len(times)} frames, {WARM_UP} of them to warm up; ask for more")
    return np.array(times[WARM_UP:]).T


def by_number(database: PoseDatabase, counts: Sequence[int], options: argparse.Namespace, folder: Path) -> Figures:
    """Median milliseconds of a frame by the number of people, and the excess over so many times one person."""
    camera, recordings = wide_camera(max(counts)), []
    for n in counts:
        path = folder / f"people_{n}.npz"
        save(path, row_of_people(n, max(counts), options.frames), camera)
        recordings.append(open_recording(path))
    tracker = HybridTracker(database, settings_of("hybrid", parse_overrides(options.set)), body=load_body("neutral"))
    times = frame_times([crowd_before(recording, tracker) for recording in recordings], recordings, counts)
    median = np.median(times, axis=1)
    rows = {
        str(n): {"median_ms": float(ms), "excess_ms": float(ms - n * median[0])}
        for n, ms in zip(counts, median, strict=True)
    }
    return {"frames": times.shape[1], "people": rows}


def of_unobserved(database: PoseDatabase, options: argparse.Namespace, folder: Path) -> Figures:
    """What it costs to know which pixels say nothing, milliseconds per frame."""
    camera, path = wide_camera(1), folder / "crate.npz"
    depth, empty = behind_a_crate(row_of_people(1, 1, options.frames), camera)
    save(path, depth, camera, empty)
    recording, overrides = open_recording(path), parse_overrides(options.set)
    trackers = [make_tracker(row, database, overrides) for row in ("no unobserved", "hybrid")]
    for tracker in trackers:
        tracker.know(load_body("neutral"))
    times = frame_times([crowd_before(recording, t) for t in trackers], [recording] * 2, (1, 1))
    without, with_ = np.median(times, axis=1)
    more = float(np.median(times[1] - times[0]))
    person = np.where(depth < empty, depth, 0).astype(np.float32) / 1000
    finding = []
    for own, whole in zip(person, depth, strict=True):
        start = perf_counter()
        unobserved_pixels(whole, own, hole_sizes(whole), cut_out=False)
        finding.append(1000 * (perf_counter() - start))
    return {
        "frames": times.shape[1], "with_ms": float(with_), "without_ms": float(without),
        "finding_ms": float(np.median(finding)), "costs_ms": float(more + np.median(finding)),
    }  # fmt: skip


def save(path: Path, depth: np.ndarray, camera: Camera, background: np.ndarray | None = None) -> None:
    """Frames as a recording of a camera that looks horizontally."""
    stamps = np.arange(len(depth)) / RATE
    save_recording(path, depth=iter(depth), camera=camera, timestamps=stamps, background=background, up_camera=UP)


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("database", type=Path)
    parser.add_argument("--people", default="1,2,3,6", help="comma-separated, 1 first")
    parser.add_argument("--frames", type=int, default=100, help="of each recording")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="setting")
    return parser.parse_args()


def main() -> None:
    """Measure, print, write JSON."""
    options = parse()
    pin_to_one_processor()
    database = PoseDatabase.load(options.database)
    counts = [int(n) for n in options.people.split(",")]
    with tempfile.TemporaryDirectory() as folder:
        crowd = by_number(database, counts, options, Path(folder))
        unobserved = of_unobserved(database, options, Path(folder))
    for n, row in crowd["people"].items():
        print(f"{n} people: {row['median_ms']:6.1f} ms, {row['excess_ms']:+.1f} ms over {n} times one")
    print(
        f"unobserved space: {unobserved['costs_ms']:.2f} ms ({unobserved['without_ms']:.2f} ms without, "
        f"{unobserved['with_ms']:.2f} with, {unobserved['finding_ms']:.2f} to find the pixels)"
    )
    described = {"set": options.set, "poses": len(database)}
    print("written:", save_figures("crowd_speed", {"crowd": crowd, "unobserved": unobserved}, described))


if __name__ == "__main__":
    main()
