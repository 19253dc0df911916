"""Time per frame of the swarm tracker and of the particle filter: two parts of `depthmocap bench speed`.

- `swarm [--frames 60]`: a simulated Kinect take with joints that are given: milliseconds per frame and
  stage of `configs/swarm.yaml` and `configs/qammaz.yaml` (the paper: 111 ms on a GPU, 5.3 s with serial drawing on it).
  Then what one hypothesis costs, microseconds: a body made of balls and the mesh, in images of several
  sizes. With `--network` the stages of finding joints in the shaded depth image as well, for which
  the pose model is needed.
- `upper [--counts 64,192,256] [--columns 160,320,640]`: frames a second of the particle filter as a whole. One take of
  each group, its depth doubled to 640x480, by `configs/lopez2011.yaml`: the whole step from the depth image to the row,
  cutting out the person included, in images of three sizes as in the paper's Table 1. First poses need no fork here, so
  that every take is followed; frames in which one is looked for are counted apart. To quote them, ask for a core:
  `chrt -f 10 taskset -c 1 depthmocap bench speed upper`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import percentiles, pin_to_one_processor, save_figures
from benchmarks._rows import swarm_settings
from benchmarks._takes import joints_of, prepared
from tests.support.scenes import record_scene
from tests.support.solo import Solo
from tests.support.suite import WORK, takes
from tests.support.upper import GROUPS, upper_scenes
from toolkit.app.pipeline.trackers import TrackerRecipe
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.people.image_joints.pose_model import Crop, PoseModel
from toolkit.people.image_joints.shaded import ENLARGED, shaded
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import RecordingWriter
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.trackers.lopez2011.tracker import DETECTED, ParticleTracker
from toolkit.trackers.qammaz.discrepancy import FIGURES, Discrepancy, DiscrepancySettings, small_image
from toolkit.trackers.qammaz.tracker import SwarmTracker

IMAGES = ((30, 40), (45, 60), (60, 80), (90, 120))
"""Width and height of the small image, pixels."""
HYPOTHESES = 1024
"""Hypotheses that are timed at once."""
SPREAD = 0.2
"""Radians and metres by which they are apart."""
TAKE = "fast_bk_kick_009_athletic_male_kinect"
"""Of the tuning split."""
UNLEARNT = {"shape.seconds": 0.0, "sizes": [0.0]}
"""The body is neither learnt nor looked for among several, which takes the first seconds twice."""


def stages(row: str, recording: Recording, frames: int) -> dict[str, Any]:
    """Milliseconds per frame and per stage, without the first frame, which compiles and looks everywhere."""
    tracker = SwarmTracker(swarm_settings(row, UNLEARNT))
    solo, spent = Solo(tracker, recording), []
    for i in range(min(frames, len(recording))):
        result = solo.step(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i))
        spent.append(result.stage_ms)
    table = np.array(spent[1:])
    each = {name: percentiles(table[:, k]) for k, name in enumerate(tracker.stage_names)}
    return {"frame": percentiles(table.sum(axis=1)), "stages": each}


def hypothesis_us(body: Body, figure: str, size: tuple[int, int], recording: Recording) -> float:
    """Microseconds for one pose: placed, skinned, drawn and compared."""
    finder = SinglePersonSegmenter.of(recording)
    (sighting,) = finder.find(recording.depth(0), 0.0, {})
    cloud = Cloud.from_depth(sighting.depth, sighting.camera, np.diag((1.0, -1.0, -1.0)))
    settings = DiscrepancySettings(figure=figure, width=size[0], height=size[1])
    image = small_image(cloud.depth, sighting.unobserved, cloud.camera.intrinsics, size[::-1])
    pose = np.zeros(43)
    pose[:3] = np.median(cloud.points, axis=0)
    costs = Discrepancy(body, image, None, cloud.rotation, pose, settings)
    rng = np.random.default_rng(0)
    positions = costs.position_of(pose + SPREAD * rng.standard_normal((HYPOTHESES, len(pose))))
    return 1e6 * _shortest(lambda: costs(positions)) / HYPOTHESES


def network_ms(recording: Recording, frames: int) -> dict[str, dict[str, float]]:
    """Milliseconds of shading a frame, and of finding the points in it."""
    finder = SinglePersonSegmenter.of(recording)
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


def swarm(parser: argparse.ArgumentParser) -> None:
    """Measure, print, write JSON."""
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--rows", default="swarm,qammaz", help="see `bench swarm`")
    parser.add_argument("--network", action="store_true", help="also the joints in the shaded depth")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    take = next((take for take in takes("tune") if take.name == TAKE), takes("tune")[1])
    recording = prepared(take, "truth", options.work, options.frames)
    figures: dict[str, Any] = {"times": {}, "hypothesis_us": {}}
    for row in options.rows.split(","):
        found = figures["times"][row] = stages(row, recording, options.frames)
        parts = ", ".join(f"{name} {part['median_ms']:.1f}" for name, part in found["stages"].items())
        frame = found["frame"]
        print(f"{row}: {frame['median_ms']:.1f} ms, p99 {frame['p99_ms']:.1f} ({parts})")
    for figure in FIGURES:
        row = {f"{w}x{h}": hypothesis_us(load_body("neutral"), figure, (w, h), recording) for w, h in IMAGES}
        figures["hypothesis_us"][figure] = row
        print(f"{figure:8}", ", ".join(f"{size} {value:.1f} us" for size, value in row.items()))
    if options.network:
        figures["network"] = network_ms(recording, options.frames)
        print(", ".join(f"{name} {part['median_ms']:.1f} ms" for name, part in figures["network"].items()))
    settings = {"rows": options.rows, "frames": options.frames}
    print("written:", save_figures("speed_swarm", figures, settings))


WIDTH = 160
"""Pixels of the image in which the trackers weigh arms."""
LEFT_OUT = 5
"""Frames of a take that are left out."""
HEADINGS = ("columns", "count", "frames", "median ms", "99 % ms", "frames/s", "first ms")


def doubled(recording: Recording, path: Path, frames: int) -> Recording:
    """The first frames of a recording with every pixel four times."""

    def large(image: np.ndarray) -> np.ndarray:
        return np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)

    background = None if recording.background is None else large(recording.background)
    with RecordingWriter(
        path, recording.camera.scaled(2.0), background=background, up_camera=recording.up_camera
    ) as writer:
        for i in range(min(frames, len(recording))):
            writer.append(large(recording.depth(i)), float(recording.timestamps[i]))
    return open_recording(path)


def step_times(tracker: ParticleTracker, recording: Recording) -> tuple[list[float], list[float], np.ndarray]:
    """Milliseconds of frames that were followed, and of first ones; and the mean of each stage of the former."""
    solo, followed, first, stages = Solo(tracker, recording), [], [], []
    for i in range(len(recording)):
        depth = recording.depth(i)
        fresh = solo.follower.state.previous is None
        begun = time.perf_counter()
        result = solo.step(depth, float(recording.timestamps[i]))
        spent = 1000.0 * (time.perf_counter() - begun)
        if fresh or result.source == DETECTED:
            first.append(spent)
        elif i >= LEFT_OUT:
            followed.append(spent)
            stages.append(result.stage_ms)
    return followed, first[1:] or first, np.mean(stages, axis=0)


def upper(parser: argparse.ArgumentParser) -> None:
    """Time, print, write JSON."""
    parser.add_argument("--counts", default="64,192,256", help="particles in each of the three layers")
    parser.add_argument("--columns", default="160", help="width, pixels, of the images that arms are weighed in")
    parser.add_argument("--groups", default=",".join(GROUPS))
    parser.add_argument("--frames", type=int, default=90, help="length of each take, at most")
    parser.add_argument("--first", type=int, default=40, help="frames of each take that are timed, at most")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    pin_to_one_processor()
    scenes = upper_scenes("tune", tuple(options.groups.split(",")), 1)
    recordings = []
    for scene in scenes:
        recording = open_recording(record_scene(scene, options.work, options.frames))
        recordings.append(doubled(recording, options.work / f"doubled_{scene.name}.npz", options.first))
    figures: dict[str, Any] = {}
    print(*(f"{heading:>10}" for heading in HEADINGS))
    sizes = product(map(int, options.columns.split(",")), map(int, options.counts.split(",")))
    for columns, count in sizes:
        images = {"particles.trunk_columns": columns, "particles.arm_columns": columns}
        overrides = {"particles.count": count, "initial.unlabelled": True, **images}
        tracker = TrackerRecipe("lopez2011", overrides).build()
        assert isinstance(tracker, ParticleTracker)
        measured = [step_times(tracker, recording) for recording in recordings]
        followed = [value for own, _, _ in measured for value in own]
        values: dict[str, Any] = percentiles(followed)
        values |= {"frames": len(followed), "frame_rate": 1000.0 / values["median_ms"]}
        values["first_ms"] = float(np.median([value for _, first, _ in measured for value in first]))
        stages: np.ndarray = np.mean([stage for _, _, stage in measured], axis=0)
        values["stages_ms"] = dict(zip(tracker.stage_names, np.round(stages, 2).tolist(), strict=True))
        figures[f"{count}" if columns == WIDTH else f"{count}, {columns} wide"] = values
        print(f"{columns:>10}{count:>10}{len(followed):>11}{values['median_ms']:>11.1f}{values['p99_ms']:>11.1f}"
              f"{values['frame_rate']:>11.1f}{values['first_ms']:>11.1f}  {values['stages_ms']}")  # fmt: skip
    whole = options.groups == ",".join(GROUPS)
    print("written:", save_figures(f"speed_upper{'' if whole else '_part'}", figures, {"first": options.first}))
