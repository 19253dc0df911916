"""Time per frame of the swarm tracker: a part of `depthmocap bench speed`.

`swarm [--frames 30]`: a simulated Kinect recording with given joints. Measured are milliseconds per frame and stage of
`configs/swarm.yaml` and `configs/qammaz.yaml` (the paper: 111 ms on a GPU, 5.3 s with serial drawing), and microseconds
per hypothesis with balls and with the mesh in images of several sizes. `--network` also times the pose network.
"""

import argparse
import time
from typing import Any

import numpy as np

from benchmarks._record import benchmark, milliseconds_of, percentiles
from benchmarks._rows import swarm_settings
from benchmarks._takes import joints_of, prepared
from tests.support.solo import Solo
from tests.support.suite import WORK, takes
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.people.image_joints.pose_model import Crop, PoseModel
from toolkit.people.image_joints.shaded import ENLARGED, shaded
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.trackers.qammaz.discrepancy import FIGURES, Discrepancy, DiscrepancySettings, small_image
from toolkit.trackers.qammaz.tracker import SwarmTracker

IMAGES = ((30, 40), (45, 60), (60, 80), (90, 120))
"""Width and height of the small image, pixels."""
HYPOTHESES = 1024
"""Hypotheses timed together."""
SPREAD = 0.2
"""Spread of these hypotheses, radians and metres."""
TAKE = "fast_bk_kick_009_athletic_male_kinect"
"""Recording of the tuning split."""
UNLEARNT = {"shape.seconds": 0.0, "sizes": [0.0]}
"""Settings without body learning and without several sizes, which process the first seconds twice."""


def stages(row: str, recording: Recording, frames: int) -> dict[str, Any]:
    """Return milliseconds per frame and stage, without the first frame, which compiles and searches globally."""
    tracker = SwarmTracker(swarm_settings(row, UNLEARNT))
    solo, spent = Solo(tracker, recording), []
    for i in range(min(frames, len(recording))):
        result = solo.step(recording.depth(i), float(recording.timestamps[i]), joints_of(recording, i))
        spent.append(result.stage_ms)
    table = np.array(spent[1:])
    each = {name: percentiles(table[:, k]) for k, name in enumerate(tracker.stage_names)}
    return {"frame": percentiles(table.sum(axis=1)), "stages": each}


def hypothesis_us(body: Body, figure: str, size: tuple[int, int], recording: Recording) -> float:
    """Return microseconds per pose: placed, skinned, drawn and compared."""
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
    return 1e3 * min(milliseconds_of(lambda: costs(positions), 6)[1:]) / HYPOTHESES


def network_ms(recording: Recording, frames: int) -> dict[str, dict[str, float]]:
    """Return milliseconds of shading a frame, and of finding its keypoints."""
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


@benchmark(frames=30, network=False, work=WORK)
def swarm(options: argparse.Namespace) -> tuple[str, Any]:
    """Time frames, hypotheses, and the network if asked for."""
    take = next((take for take in takes("tune") if take.name == TAKE), takes("tune")[1])
    recording, body = prepared(take, "truth", options.work, options.frames), load_body("neutral")
    figures: dict[str, Any] = {"times": {row: stages(row, recording, options.frames) for row in ("swarm", "qammaz")}}
    figures["hypothesis_us"] = {
        figure: {f"{w}x{h}": hypothesis_us(body, figure, (w, h), recording) for w, h in IMAGES} for figure in FIGURES
    }
    if options.network:
        figures["network"] = network_ms(recording, options.frames)
    return "speed_swarm", figures
