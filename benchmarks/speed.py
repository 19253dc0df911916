"""Time per frame: `depthmocap bench speed PART`, which is one of

- `hybrid DATABASE [--frames 1050]`: a rendered subject moves before cameras that see it with 3,000, 6,000 and 16,000
  pixels. Times are those of the stages, without reading the file, in one pinned process with one thread; the first 50
  frames, in which code is compiled, are left out. The same follows at half resolution, the error beside both; then the
  whole frame against the plain pipeline (`tests/support/plain_pipeline.py`) in the same run; and the peak memory of
  `depthmocap track` over a short and a long recording.
- `crowd DATABASE [--frames 120]`: simulated people of about 6,000 pixels each move side by side before one wide
  camera, already cut out; the image is the same for every count. A frame is one `MultiPersonTracker.step` with a known
  body. The excess is the time over N times that of one person. All counts take their frames in turn, under equal load.
- `passes DATABASE`: `depthmocap track` as a command, in two passes and in one (`--online`), of one person of about
  6,000 pixels who is cut out (300 and 600 frames), of six in a furnished room before a Kinect of 640x480 pixels (120
  and 300 frames; the body is learnt in the first 90), and of the classroom of `bench rooms` where its data is.
  Processor time, at real-time priority where permitted. A frame costs what the longer recording takes more than the
  shorter one; the rest is the fixed cost. First and second command: 76 frames in new processes, at first not compiled.
- `swarm [--frames 30] [--network]`: a simulated Kinect recording with given joints. Milliseconds per frame and stage of
  `configs/swarm.yaml` and `configs/qammaz.yaml` (the paper: 111 ms on a GPU, 5.3 s with serial drawing), microseconds
  per hypothesis with balls and with the mesh in images of several sizes, and the time of the pose network.
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import cycle
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from benchmarks._record import benchmark, command_cost, milliseconds_of, percentiles, pin_to_one_processor, script
from benchmarks._rows import DATABASE, settings_of, swarm_settings
from benchmarks._takes import joints_of, prepared
from benchmarks.rooms import RATES, ROOMS, annotations_of
from tests.support import suite
from tests.support.plain_pipeline import PlainTracker
from tests.support.solo import Solo
from tests.support.subjects import DISTANCE, camera_for, draw, moving_poses, write_recording
from tests.support.suite import WORK, takes
from toolkit.app.config import load_settings, parse_overrides
from toolkit.body.body import Body
from toolkit.body.shape import load_body, subject_body
from toolkit.database.database import PoseDatabase
from toolkit.evaluation.joint_errors import frame_errors, joint_errors
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.procedural import SUBJECT_MOTIONS
from toolkit.people.image_joints.detected_joints import ENLARGED, shaded
from toolkit.people.image_joints.pose_model import Crop, PoseModel
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.people.survey import find_people
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.cloud import Cloud
from toolkit.sensing.recording import Recording
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.sensors import KinectV1
from toolkit.simulation.simulate import CaptureSettings, simulate_scene
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.trackers.qammaz.discrepancy import Discrepancy, DiscrepancySettings, small_image
from toolkit.trackers.qammaz.tracker import SwarmTracker
from toolkit.tracking.multi_person import MultiPersonTracker
from toolkit.tracks import EMPTY, Track
from toolkit.tracks.runs import person_runs
from training.interiors.room import around_people

ONE_THREAD = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
SIZES = (3_000, 6_000, 16_000)
WARM_UP = 50
"""Frames without times: the shape is learnt from 45."""
PLAIN_FRAMES, MEMORY_FRAMES, POSES = 120, (200, 2000), 25_000
"""Frames compared with the plain pipeline, frames of the recordings for peak memory, poses of the database."""


def in_turn(trackers: Sequence[HybridTracker], recording: Recording, frames: int) -> tuple[np.ndarray, np.ndarray, Any]:
    """Track a recording by several trackers, frame by frame in turn.

    Returns milliseconds (T, trackers, stages) without the first `WARM_UP` frames, joints (T, trackers, 20, 3) in
    metres, camera frame, and the sources of each frame and tracker.
    """
    people = [Solo(tracker, recording) for tracker in trackers]
    moments = recording.timestamps[:frames].tolist()
    results = [[p.step(recording.depth(i), moment) for p in people] for i, moment in enumerate(moments)]
    spent, joints, sources = (
        [[getattr(result, name) for result in row] for row in results] for name in ("stage_ms", "joints", "source")
    )
    warm = min(WARM_UP, len(results) // 2)
    return np.array(spent, dtype=np.float64)[warm:], np.array(joints, dtype=np.float64), sources


def timed(recording: Recording, database: PoseDatabase, settings: HybridSettings) -> dict[str, Any]:
    """Return times of each stage and of the whole frame, and the error, of one recording."""
    tracker = HybridTracker(database, settings)
    stage_ms, joints, _ = in_turn([tracker], recording, len(recording))
    errors = joint_errors(joints[:, 0], recording.joints)
    return {
        "pixels": float(np.mean([(frame.depth_mm > 0).sum() for frame in recording.stream()])),
        "half_resolution": settings.sensing.half_resolution,
        "frame": percentiles(stage_ms.sum(axis=2)),
        "stages": {name: percentiles(stage_ms[:, 0, s]) for s, name in enumerate(tracker.stage_names)},
        "error_mm": 1000 * float(np.nanmean(frame_errors(errors))),
    }


def compare(recording: Recording, database: PoseDatabase, settings: HybridSettings, frames: int) -> dict[str, Any]:
    """Return how often faster the compiled tracker is than the plain one, and the distance of their joints."""
    trackers = [HybridTracker(database, settings), PlainTracker(database, settings)]
    stage_ms, joints, sources = in_turn(trackers, recording, frames)
    compiled, plain = stage_ms.sum(axis=2).T
    apart = 1000.0 * np.linalg.norm(joints[:, 0] - joints[:, 1], axis=2).max(axis=1)
    return {
        "faster": float(np.median(plain) / np.median(compiled)),
        "apart_mm": {"max": float(apart.max())},
        "equal_sources": float(np.mean([first == second for first, second in sources])),
    }


def tracked(
    recording: Path, database: Path, output: Path, options: Sequence[str] = (), cache: Path | None = None
) -> tuple[float, float]:
    """Return peak memory, megabytes, and processor time, seconds, of `depthmocap track` over a recording into `output`.

    `cache` is the folder of compiled kernels; default: that of the user.
    """
    kernels = {} if cache is None else {"NUMBA_CACHE_DIR": str(cache)}
    words = ["track", recording, "--database", database, "--output", output, *options]
    return command_cost(words, **ONE_THREAD, **kernels)


@benchmark(database=Path, frames=1050)
def hybrid(options: argparse.Namespace) -> tuple[str, Any]:
    """Time the hybrid tracker and the plain pipeline, and measure peak memory."""
    pin_to_one_processor()
    database = PoseDatabase.load(options.database).limited(POSES)
    settings = load_settings(HybridSettings, "hybrid")
    half = load_settings(HybridSettings, "hybrid", {"sensing.half_resolution": True})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for size in SIZES:
            write_recording(folder / f"{size}.npz", size, options.frames)
        recordings = [open_recording(folder / f"{size}.npz") for size in SIZES]
        figures: dict[str, Any] = {
            "times": [timed(own, database, chosen) for own in recordings for chosen in (settings, half)],
            "plain": [compare(own, database, settings, PLAIN_FRAMES) for own in recordings],
        }
        figures["memory"] = []
        for n in MEMORY_FRAMES:
            path = folder / f"memory_{n}.npz"
            write_recording(path, SIZES[1], n)
            peak, _ = tracked(path, options.database, folder / f"run_{n}")
            figures["memory"].append({"frames": n, "peak_mb": peak})
    return "speed", figures


PIXELS, COUNTS = 6000, (1, 2, 3, 6)
"""Pixels of a person, and numbers of people side by side."""
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


def frame_times(crowds: Sequence[MultiPersonTracker], recordings: Sequence[Recording]) -> np.ndarray:
    """Return milliseconds (C, T) of the frames in which all groups track all their people, in turn."""
    times = []
    for frames in zip(*(recording.stream() for recording in recordings), strict=True):
        taken = []
        for crowd, frame in zip(crowds, frames, strict=True):
            start = perf_counter()
            crowd.step(frame)
            taken.append(1000 * (perf_counter() - start))
        if all(len(crowd.bodies) == n for crowd, n in zip(crowds, COUNTS, strict=True)):
            times.append(taken)
    if len(times) <= SETTLED:
        raise SystemExit(f"all people were tracked in {len(times)} frames, {SETTLED} of them to warm up; ask for more")
    return np.array(times[SETTLED:]).T


@benchmark(database=Path, frames=120, set=DATABASE["set"])
def crowd(options: argparse.Namespace) -> tuple[str, Any]:
    """Time people side by side: the median of a frame by their number, and the excess over the multiple of one."""
    pin_to_one_processor()
    database, camera = PoseDatabase.load(options.database), wide_camera(max(COUNTS))
    stamps = np.arange(options.frames) / RATE
    with tempfile.TemporaryDirectory() as folder:
        recordings = []
        for n in COUNTS:
            path = Path(folder) / f"people_{n}.npz"
            depth = row_of_people(n, max(COUNTS), options.frames)
            save_recording(path, depth=iter(depth), camera=camera, timestamps=stamps, up_camera=UP)
            recordings.append(open_recording(path))
        settings = settings_of("hybrid", parse_overrides(options.set))
        tracker = HybridTracker(database, settings, body=load_body("neutral"))
        crowds = [MultiPersonTracker(tracker, find_people(own), own.up_camera) for own in recordings]
        times = frame_times(crowds, recordings)
    median = np.median(times, axis=1)
    rows = zip(COUNTS, median.tolist(), strict=True)
    return "speed_crowd", {"people": {str(n): {"median_ms": ms, "excess_ms": ms - n * median[0]} for n, ms in rows}}


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
        sensor=LargeKinect(), distance=4.2, height=1.9, tilt=13.0, background=False, room=around_people("office:53")
    )
    simulate_scene(people, path, shot)


CLASSROOM = ROOMS / "um"
"""Room with up to six people who sit, if its data is here."""
MADE: dict[str, tuple[Callable[[Path, int], None], int, int]] = {
    "one": (lambda path, frames: write_recording(path, PIXELS, frames), 300, 600),
    "six": (six_in_a_room, 120, 300),
}
"""Recordings by the number of people, with the frames of a short and of a long one."""
PASSES = {"two": (), "one": ("--online",)}


@benchmark(database=Path)
def passes(options: argparse.Namespace) -> tuple[str, Any]:
    """Measure the command in new processes."""
    with tempfile.TemporaryDirectory() as name:
        folder, track = Path(name), partial(tracked, database=options.database)
        figures = {"typed": typed(folder, track)} | {people: by_passes(people, folder, track) for people in MADE}
        if CLASSROOM.is_dir():
            figures["classroom"] = {way: classroom(folder / way, track, extra) for way, extra in PASSES.items()}
    return "speed_passes", figures


def by_passes(people: str, folder: Path, track: Callable[..., tuple[float, float]]) -> dict[str, Any]:
    """Return time of a frame, fixed cost and peak memory of two passes and of one."""
    make, *lengths = MADE[people]
    paths, found = [folder / f"{people}_{frames}.npz" for frames in lengths], {}
    for path, frames in zip(paths, lengths, strict=True):
        make(path, frames)
    everyone = ("--people", "1" if people == "one" else "all")
    track(paths[0], output=folder / f"first_{people}", options=everyone)  # compiles what is not compiled yet
    for way, extra in PASSES.items():
        (_, short), (peak, long) = (
            track(path, output=folder / f"{path.stem}_{way}", options=(*everyone, *extra)) for path in paths
        )
        each = (long - short) / (lengths[1] - lengths[0])
        found[way] = {"frame_ms": 1000 * each, "fixed_s": short - lengths[0] * each, "peak_mb": peak}
    return found


def typed(folder: Path, track: Callable[..., tuple[float, float]]) -> dict[str, Any]:
    """Return processor seconds and peak memory of a first command, with no kernel compiled, and of the second one."""
    path, found = folder / "typed.npz", {}
    write_recording(path, PIXELS, 76)  # frames, as many as a recording of UTD-MHAD has
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


def hypothesis_us(body: Body, figure: Any, size: tuple[int, int], recording: Recording) -> float:
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
        figure: {f"{w}x{h}": hypothesis_us(body, figure, (w, h), recording) for w, h in IMAGES}
        for figure in ("balls", "mesh")
    }
    if options.network:
        figures["network"] = network_ms(recording, options.frames)
    return "speed_swarm", figures


main = script(__name__, __doc__, {"hybrid": hybrid, "crowd": crowd, "passes": passes, "swarm": swarm})
