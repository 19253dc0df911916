"""People seen from the waist up: `depthmocap bench upper PART`, which is one of

- `track [--split report] [--rows hybrid,lopez2011]`: the takes of `tests/support/upper.py` (truncated by the
  image, behind a desk, on a chair, near the camera, wide, turned). Trackers get no other input. Errors are of head,
  shoulders, elbows and hands, seen or not, in pixels of a 640x480 image (at most 120) and in millimetres (at most 1 m);
  frames before the person is found count. First are the first tracked frames. `--recovery` hangs both arms down, or
  raises them, at frame 30 of each take, and counts frames until the mean error of the seven joints is below 60 mm for 5
  frames. `--real` tracks the 8 stills of Skeltrack, each on its own, and the seated man of `realsense`, against the
  annotations in `benchmarks/annotations/`.
- `speed`: frames a second of `lopez2011` by particles and image width (Table 1 of the paper), on a repeated still.
"""

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks._record import benchmark, script
from benchmarks._rows import DATABASE, TAKES, poses_of
from tests.support.scenes import record_scene
from tests.support.solo import Solo
from tests.support.upper import GROUPS, upper_scenes
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline.trackers import TrackerRecipe
from toolkit.body import skeleton
from toolkit.datasets.folder import data_folder
from toolkit.io.errors import DepthMocapError
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording
from toolkit.tracking.state import Previous
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import TRACKED, FrameResult

NAMES = ("head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_hand", "right_hand")
JOINTS: np.ndarray = np.array([skeleton.REPORTED.index(name) for name in NAMES])
"""Rows of the seven joints among the reported ones."""
HANDS = slice(5, 7)
"""Indices of the hands among the seven joints."""
COLUMNS = 640
"""Width of the image in which pixels are counted."""
THRESHOLDS = tuple(range(0, 61, 10))
"""Thresholds of the success rate in pixels (Fig. 10)."""
BAD = 60.0
"""Mean error of a wrong frame, pixels."""
FAR = 100.0
"""Error of a lost hand, pixels."""


class UpperScore(NamedTuple):
    """Errors (T, 7) of one recording, in pixels of 640x480 and mm, NaN for unknown truth; `tracked` is bool (T,)."""

    pixels: np.ndarray
    mm: np.ndarray
    tracked: np.ndarray


def pixel_errors(found: np.ndarray, truth_pixels: np.ndarray, camera: Camera) -> np.ndarray:
    """Return distances (T, 7) of joints (T, 7, 3), camera frame, from image points (T, 7, 2), in pixels of 640x480."""
    pixels = camera.project(found.reshape(-1, 3)).reshape(truth_pixels.shape)
    return np.linalg.norm(np.nan_to_num(pixels, nan=1e4) - truth_pixels, axis=-1) * COLUMNS / camera.width


def upper_figures(scores: Sequence[UpperScore]) -> dict[str, Any]:
    """Return figures over recordings, by name: means over the recordings, `first_px` of their first tracked frames."""
    if not scores:
        return {}
    pixels = np.concatenate([score.pixels for score in scores])
    first = [score.pixels[int(np.argmax(score.tracked))] for score in scores if score.tracked.any()]
    wrong = np.concatenate([np.nanmean(score.pixels, axis=1) > BAD for score in scores])
    tracked = np.concatenate([score.tracked for score in scores])
    return {
        "upper_px": float(np.mean([np.nanmean(score.pixels) for score in scores])),
        "median_px": float(np.nanmedian(pixels)),
        "hands_px": float(np.mean([np.nanmean(score.pixels[:, HANDS]) for score in scores])),
        "upper_mm": float(np.mean([score.mm.mean() for score in scores])),
        "first_px": float(np.nanmean(first)) if first else None,
        "hands_near": float(np.mean(pixels[:, HANDS] <= FAR)),
        "wrong_tracked": float(tracked[wrong].mean()) if wrong.any() else 0.0,
        "curve": {"px": THRESHOLDS, "share": [float(np.mean(pixels <= limit)) for limit in THRESHOLDS]},
    }


ROWS = "hybrid,lopez2011"
"""Names of settings."""
DEPTH = data_folder() / "depth"
ANNOTATIONS = Path(__file__).parent / "annotations"
STILL_CAMERA = (575.0, 575.0, 320.0, 240.0)
SEATED = "seed:263,271"
"""Chest of the seated man in the first frame; another man stands beside him."""
DISTURBED, WITHIN, LASTING, WAITED = 30, 60.0, 5, 30
"""Frame at which arms are set wrong; millimetres, consecutive frames and maximum frames of a recovery."""


def tracker_of(row: str, options: argparse.Namespace, **sensing: str) -> Tracker:
    """Return the tracker of a row; `sensing` are settings of the segmentation."""
    overrides = parse_overrides(options.set) | {f"sensing.{name}": value for name, value in sensing.items()}
    return TrackerRecipe(row, overrides, poses_of(options) if row == "hybrid" else None).build()


def score_take(solo: Solo, recording: Recording, frames: int) -> UpperScore:
    """Return the score of a take; all seven joints count.

    A joint is off by `BAD` pixels at most twice over, so that a person not yet found does not decide alone.
    """
    moments = recording.timestamps[:frames].tolist()
    results = [solo.step(recording.depth(i), moment) for i, moment in enumerate(moments)]
    found = np.array([result.joints for result in results])[:, JOINTS].astype(np.float64)
    known, camera = recording.joints[:frames, JOINTS].astype(np.float64), recording.camera
    pixels = camera.project(known.reshape(-1, 3)).reshape(*known.shape[:2], 2)
    mm = 1000.0 * np.linalg.norm(found - known, axis=-1)
    capped = np.minimum(pixel_errors(found, pixels, camera), 2 * BAD)
    return UpperScore(capped, np.minimum(mm, 1000.0), np.array([result.state == TRACKED for result in results]))


def wrong_arms(pose: np.ndarray, *, raised: bool) -> np.ndarray:
    """Return the pose (P,) with both arms hanging or raised."""
    wrong = pose.copy()
    for side, entries, sign in zip(skeleton.SIDES, skeleton.ARM_ENTRIES, (1.0, -1.0), strict=True):
        wrong[entries] = 0.0
        wrong[skeleton.POSE_NAMES.index(f"{side}_shoulder_rz")] = sign * (1.2 if raised else -1.1)
    return wrong


def recovery(tracker: Tracker, recording: Recording, *, raised: bool) -> int | None:
    """Return frames until the arms are correct again; None for more than `WAITED`, or if the person was not tracked."""
    solo, right = Solo(tracker, recording), 0
    for i in range(min(DISTURBED + WAITED + LASTING, len(recording))):
        if i == DISTURBED:
            state = solo.follower.state
            if state.previous is None:
                return None
            wrong = wrong_arms(state.pose, raised=raised)
            memory = {name: dict(kept) for name, kept in state.memory.items()}
            for kept in memory.values():
                if "poses" in kept:
                    kept["poses"] = np.repeat(wrong[None], len(kept["poses"]), axis=0)
            changed = replace(state, pose=wrong, previous=Previous.of_pose(state.body, wrong), memory=memory)
            solo.follower.state = changed
        joints = solo.step(recording.depth(i), float(recording.timestamps[i])).joints
        error = 1000.0 * np.linalg.norm(joints[JOINTS] - recording.joints[i][JOINTS], axis=1).mean()
        right = right + 1 if i >= DISTURBED and error < WITHIN else 0
        if right == LASTING:
            return i - DISTURBED - LASTING + 2
    return None


def annotated(file: str) -> dict[str, np.ndarray]:
    """Return image points (7, 2) by name: the mean of both readings."""
    content = json.loads((ANNOTATIONS / file).read_text(encoding="utf-8"))
    found = {name: np.array(places, dtype=np.float64) for name, places in content["first"].items()}
    for name, others in content["second"].items():
        for joint, place in others.items():
            row = content["joints"].index(joint)
            found[name][row] = 0.5 * (found[name][row] + place)
    return found


Shown = tuple[Recording, FrameResult, np.ndarray]
"""Recording, result of a frame and its annotated points (7, 2)."""


def stills(row: str, options: argparse.Namespace) -> dict[str, list[Shown]]:
    """Return each of the 8 stills, tracked alone, by name."""
    found = {}
    for name, places in annotated("stills.json").items():
        recording = open_recording(DEPTH / "skeltrack" / f"depth-data-{name}", intrinsics=STILL_CAMERA)
        result = Solo(tracker_of(row, options, subject="nearest"), recording).step(recording.depth(0), 0.0)
        found[name] = [(recording, result, places)]
    return found


def seated(row: str, options: argparse.Namespace) -> dict[str, list[Shown]]:
    """Return the 8 annotated frames of 40 of the seated man."""
    recording = open_recording(DEPTH / "realsense" / "images_n40")
    solo, places = Solo(tracker_of(row, options, segment=SEATED), recording), annotated("seated.json")
    results = [solo.step(recording.depth(i), float(recording.timestamps[i])) for i in range(len(recording))]
    return {"seated": [(recording, results[int(i)], place) for i, place in places.items()]}


def real_figures(found: Mapping[str, Sequence[Shown]]) -> dict[str, Any]:
    """Return the figures that need no metres."""
    scores = []
    for frames in found.values():
        joints = np.array([result.joints[JOINTS] for _, result, _ in frames], dtype=np.float64)
        truth, camera = np.array([places for *_, places in frames]), frames[0][0].camera
        tracked = np.array([result.state == TRACKED for _, result, _ in frames])
        errors = pixel_errors(joints, truth, camera)
        scores.append(UpperScore(errors, np.full_like(errors, np.nan), tracked))
    return {name: value for name, value in upper_figures(scores).items() if name != "upper_mm"}


def take_figures(row: str, recordings: Sequence[Recording], options: argparse.Namespace) -> dict[str, Any]:
    """Return figures of one tracker over all takes."""
    tracker, scores, frames = tracker_of(row, options), [], []
    for recording in recordings:
        try:
            scores.append(score_take(Solo(tracker, recording), recording, options.frames))
        except DepthMocapError as error:
            print(f"{row}: {recording.name}: {error}")
            continue
        if options.recovery:
            frames += [recovery(tracker, recording, raised=raised) for raised in (False, True)]
    figures = upper_figures(scores)
    if frames:
        taken = [WAITED if n is None else n for n in frames]
        figures |= {"recovered": float(np.mean([n is not None for n in frames]))}
        figures |= {"recovery_frames": float(np.median(taken))}
    return figures


@benchmark(TAKES, DATABASE, frames=90, rows=ROWS, groups=",".join(GROUPS), recovery=False, real=False)
def track(options: argparse.Namespace) -> tuple[str, Any]:
    """Track the takes, or with `--real` the stills and the seated man."""
    rows, figures = options.rows.split(","), dict[str, dict[str, Any]]()
    if options.real:
        for row in rows:
            for name, run in (("stills", stills), ("seated", seated)):
                figures[f"{row} {name}"] = real_figures(run(row, options))
    else:
        scenes = upper_scenes(options.split, tuple(options.groups.split(",")), options.takes)
        recordings = [open_recording(record_scene(scene, options.work, options.frames)) for scene in scenes]
        figures = {row: take_figures(row, recordings, options) for row in rows}
    own = "" if options.rows == ROWS else "_" + options.rows.replace(",", "_")
    name = ("upper_real" if options.real else f"upper_{options.split}") + own
    return name, figures


@benchmark(frames=4)
def speed(options: argparse.Namespace) -> tuple[str, Any]:
    """Measure frames a second; a tile of the paper is a quarter of an image 2.5 times as wide."""
    name = next(iter(annotated("stills.json")))
    recording = open_recording(DEPTH / "skeltrack" / f"depth-data-{name}", intrinsics=STILL_CAMERA)
    figures: dict[str, float] = {}
    for tile, particles in product((64, 128, 256), (64, 256, 1024)):
        settings = {"particles.count": particles, "particles.columns": tile * 5 // 2, "sensing.subject": "nearest"}
        solo, seconds = Solo(TrackerRecipe("lopez2011", settings).build(), recording), []
        for i in range(options.frames + 1):
            begun = time.process_time()
            solo.step(recording.depth(0), i / 30.0)
            seconds.append(time.process_time() - begun)
        figures[f"{tile}x{tile} {particles}x3"] = 1.0 / float(np.median(seconds[1:]))
    return "upper_speed", figures


main = script(__name__, __doc__, {"track": track, "speed": speed})
