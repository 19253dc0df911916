"""Time of the swarm tracker: `depthmocap bench swarm_speed [--frames 60] [--threads 1,2]`.

A simulated Kinect take of the tuning split with joints that are given: milliseconds per frame and stage of
`configs/swarm.yaml` and `configs/qammaz.yaml`, where the swarm's poses are divided among one and two threads (the
paper: 111 ms on a GPU, 5.3 s with serial drawing on it). Then what one hypothesis costs, microseconds: a body made of
balls, a mesh of about 360 vertices, and the whole mesh, in images of several sizes; every pose is another one. With
`--network` the stages of finding joints in the shaded depth image as well, for which the pose model is needed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from benchmarks._swarm_rows import settings_of
from benchmarks._takes import joints_of, prepared
from benchmarks._timing import percentiles
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.detector.pose_model import Crop, PoseModel
from toolkit.detector.shaded import ENLARGED, shaded
from toolkit.people.lone import LonePerson
from toolkit.qammaz.discrepancy import FIGURES, Discrepancy, DiscrepancySettings, small_image
from toolkit.qammaz.tracker import SwarmTracker
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.sensing.settings import SensingSettings
from toolkit.testing.suite import WORK, takes
from toolkit.tracking.solo import Solo

SIZES = ((30, 40), (45, 60), (60, 80), (90, 120))
"""Width and height of the small image, pixels."""
POSES = 1024
"""Hypotheses that are timed at once."""
SPREAD = 0.2
"""Radians and metres by which they are apart."""
TAKE = "fast_bk_kick_009_athletic_male_kinect"
"""Of the tuning split."""
UNLEARNT = {"shape.seconds": 0.0, "sizes": [0.0]}
"""The body is neither learnt nor looked for among several, which takes the first seconds twice."""


def stages(row: str, threads: int, recording: Recording, frames: int) -> dict[str, Any]:
    """Milliseconds per frame and per stage, without the first frame, which compiles and looks everywhere."""
    tracker = SwarmTracker(settings_of(row, {"discrepancy.threads": threads, **UNLEARNT}))
    solo, spent = Solo(tracker, recording), []
    for i in range(min(frames, len(recording))):
        result = solo.step(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i))
        spent.append(result.stage_ms)
    table = np.array(spent[1:])
    each = {name: percentiles(table[:, k]) for k, name in enumerate(tracker.stage_names)}
    return {"frame": percentiles(table.sum(axis=1)), "stages": each}


def hypothesis_us(body: Body, figure: str, size: tuple[int, int], recording: Recording) -> float:
    """Microseconds of one thread for one pose: placed, skinned, drawn and compared."""
    finder = LonePerson(recording.camera, recording.background, SensingSettings(), recording.up_camera)
    (sighting,) = finder.find(recording.depth(0), 0.0, {})
    cloud = Cloud.from_depth(sighting.depth, sighting.camera, np.diag((1.0, -1.0, -1.0)))
    settings = DiscrepancySettings(figure=figure, width=size[0], height=size[1])
    image = small_image(cloud.depth, sighting.unobserved, cloud.camera.intrinsics, size[::-1], settings.margin)
    pose = np.zeros(43)
    pose[:3] = np.median(cloud.points, axis=0)
    costs = Discrepancy(body, image, None, cloud.rotation, pose, settings)
    rng = np.random.default_rng(0)
    positions = costs.position_of(pose + SPREAD * rng.standard_normal((POSES, len(pose))))
    return 1e6 * _shortest(lambda: costs(positions)) / POSES


def network_ms(recording: Recording, frames: int) -> dict[str, dict[str, float]]:
    """Milliseconds of shading a frame, and of finding the points in it."""
    finder = LonePerson(recording.camera, recording.background, SensingSettings(), recording.up_camera)
    model, spent = PoseModel.load(), []
    for i in range(min(frames, len(recording))):
        (sighting,) = finder.find(recording.depth(i), float(recording.timestamps[i]), {})
        begun = time.perf_counter()
        picture = shaded(sighting.depth, sighting.camera)
        between = time.perf_counter()
        model.find(picture, Crop.around(sighting.depth > 0).scaled(float(ENLARGED)))
        spent.append((between - begun, time.perf_counter() - between))
    table = 1000.0 * np.array(spent[1:])
    return {name: percentiles(table[:, k]) for k, name in enumerate(("shading", "network"))}


def _shortest(call: Callable[[], Any], times: int = 5) -> float:
    """Seconds of the fastest of some calls, after one that is not counted."""
    spent = []
    for _ in range(times + 1):
        begun = time.perf_counter()
        call()
        spent.append(time.perf_counter() - begun)
    return min(spent[1:])


def main() -> None:
    """Measure, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--threads", default="1,2", help="with commas between them")
    parser.add_argument("--rows", default="swarm,qammaz", help="see `bench swarm`")
    parser.add_argument("--network", action="store_true", help="also the joints in the shaded depth")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    take = next((take for take in takes("tune") if take.name == TAKE), takes("tune")[1])
    recording = prepared(take, "truth", options.work, options.frames)
    figures: dict[str, Any] = {"times": {}, "hypothesis_us": {}}
    for row in options.rows.split(","):
        for threads in map(int, options.threads.split(",")):
            found = stages(row, threads, recording, options.frames)
            figures["times"][f"{row}, {threads}"] = found
            parts = ", ".join(f"{name} {part['median_ms']:.1f}" for name, part in found["stages"].items())
            frame = found["frame"]
            print(f"{row}, {threads} threads: {frame['median_ms']:.1f} ms, p99 {frame['p99_ms']:.1f} ({parts})")
    for figure in FIGURES:
        row = {f"{w}x{h}": hypothesis_us(load_body("neutral"), figure, (w, h), recording) for w, h in SIZES}
        figures["hypothesis_us"][figure] = row
        print(f"{figure:8}", ", ".join(f"{size} {value:.1f} us" for size, value in row.items()))
    if options.network:
        figures["network"] = network_ms(recording, options.frames)
        print(", ".join(f"{name} {part['median_ms']:.1f} ms" for name, part in figures["network"].items()))
    settings = {"rows": options.rows, "threads": options.threads, "frames": options.frames}
    print("written:", save_figures("swarm_speed", figures, settings))


if __name__ == "__main__":
    main()
