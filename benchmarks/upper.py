"""People seen from the waist up: `depthmocap bench upper PART`, which is one of

- `track [--split report] [--rows hybrid,lopez2011,particles]`: the takes of `tests/support/upper.py` (cut by
  the image, behind a desk, on a chair, near the camera, wide, turned). Trackers get no other input. Errors are of head,
  shoulders, elbows and hands, seen or not, in pixels of a 640x480 image (at most 120) and in millimetres (at most 1 m);
  frames before the person is found count. First are the first tracked frames. `--recovery` hangs both arms down, or
  raises them, at frame 30 of each take, and counts frames until the mean error of the seven joints is below 60 mm for 5
  frames. `--real` tracks the 8 stills of Skeltrack, each on its own, and the seated man of `realsense`, against the
  annotations in `benchmarks/annotations/`.
- `speed`: frames a second of `lopez2011` by particles and image width (Table 1 of the paper), on a repeated still.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _upper as upper
from benchmarks._record import RESULTS, run_part, save_figures, save_jpeg
from benchmarks._rows import add_database_options, poses_of
from tests.support.scenes import record_scene
from tests.support.solo import Solo
from tests.support.upper import GROUPS, MORE, upper_scenes
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline.trackers import TrackerRecipe
from toolkit.body import skeleton
from toolkit.datasets.folder import data_folder
from toolkit.fitting.arms import SIDES, entries_of
from toolkit.io.errors import DepthMocapError
from toolkit.io.files import save_bytes
from toolkit.io.html import png_of
from toolkit.output.rendering.film import contact_sheet
from toolkit.output.rendering.overlay import color_depth, draw_points, draw_skeleton
from toolkit.recordings.opening import open_recording
from toolkit.sensing.recording import Recording
from toolkit.tracking.state import Previous
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import TRACKED

ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "hybrid": ("hybrid", {}),
    "hybrid alone": ("hybrid", {"hypotheses": ["local", "extrema", "joints", "arms"]}),
    "lopez2011": ("lopez2011", {}),
    "lopez2011 64": ("lopez2011", {"particles.count": 64}),
    "particles": ("particles", {}),
    "particles 192": ("particles", {"particles.count": 192}),
}
"""Name of the row, settings that it starts from, and overrides. `hybrid alone` is the hybrid tracker without the
filter's first poses, `particles` lets local optimisation compete, numbers are particles in each layer."""


DEPTH = data_folder() / "depth"
ANNOTATIONS = Path(__file__).parent / "annotations"
STILL_CAMERA = (575.0, 575.0, 320.0, 240.0)
SEATED = "seed:263,271"
"""Chest of the seated man in the first frame; another man stands beside him."""
DISTURBED, WITHIN, LASTING, WAITED = 30, 60.0, 5, 30
"""Frame at which arms are set wrong; millimetres, consecutive frames and maximum frames of a recovery."""
DEFAULT_ROWS = "hybrid,lopez2011,particles"
COLUMNS = (
    ("upper_px", "px", 1.0),
    ("median_px", "median", 1.0),
    ("hands_px", "hands px", 1.0),
    ("upper_mm", "mm", 1.0),
    ("first_px", "first px", 1.0),
    ("hands_near", "hands < 100 %", 100.0),
    ("tracked", "tracked %", 100.0),
    ("wrong_tracked", "wrong tracked %", 100.0),
    ("frame_rate", "frames/s", 1.0),
    ("recovered", "recovered %", 100.0),
    ("recovery_frames", "median frames", 1.0),
)


def tracker_of(row: str, options: argparse.Namespace, **sensing: str) -> Tracker:
    """Return the tracker of a row; `sensing` are settings of the segmentation."""
    config, own = ROWS[row]
    overrides = parse_overrides(options.set) | own | {f"sensing.{name}": value for name, value in sensing.items()}
    return TrackerRecipe(config, overrides, poses_of(options) if config == "hybrid" else None).build()


def score_take(solo: Solo, recording: Recording, frames: int) -> tuple[upper.UpperScore, float]:
    """Return the score of a take, and seconds of processor time per frame without reading and learning."""
    joints, states, spent = [], [], 0.0
    for i in range(min(frames, len(recording))):
        depth, begun = recording.depth(i), time.process_time()
        result = solo.step(depth, float(recording.timestamps[i]))
        spent += time.process_time() - begun
        joints.append(result.joints)
        states.append(result.state)
    truth = recording.joints[: len(joints)]
    score = upper.score_upper(recording.name, np.array(joints), np.array(states), truth, recording.camera)
    return score, spent / len(joints)


def wrong_arms(pose: np.ndarray, *, raised: bool) -> np.ndarray:
    """Return the pose (P,) with both arms hanging or raised."""
    wrong = pose.copy()
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        wrong[entries_of(side)] = 0.0
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
        error = 1000.0 * np.linalg.norm(joints[upper.ROWS] - recording.joints[i][upper.ROWS], axis=1).mean()
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


def picture_of(recording: Recording, frame: int, joints: np.ndarray, observed: np.ndarray, truth: np.ndarray) -> Any:
    """Return a frame with a skeleton (20, 3) and the annotated points (7, 2)."""
    depth = recording.depth(frame)
    near, far = np.percentile(depth[depth > 0] / 1000.0, [1, 90])
    picture = np.ascontiguousarray(color_depth(depth, np.ones(depth.shape, dtype=bool), float(near), float(far)))
    draw_skeleton(picture, recording.camera.project(joints.astype(np.float64)), observed)
    for shift in np.ndindex(4, 4):
        draw_points(picture, truth + shift, (255, 0, 160))
    return picture


def stills(row: str, options: argparse.Namespace) -> tuple[dict[str, Any], list[Any]]:
    """Return figures of the 8 stills, each tracked alone, and pictures."""
    scores, pictures = [], []
    for name, places in annotated("stills.json").items():
        recording = open_recording(DEPTH / "skeltrack" / f"depth-data-{name}", intrinsics=STILL_CAMERA)
        result = Solo(tracker_of(row, options, subject="nearest"), recording).step(recording.depth(0), 0.0)
        errors = upper.pixel_errors(result.joints[None, upper.ROWS].astype(np.float64), places[None], recording.camera)
        scores.append(upper.UpperScore(name, errors, np.full((1, 7), np.nan), np.array([result.state == TRACKED])))
        pictures.append(picture_of(recording, 0, result.joints, result.observed, places))
    return _real_figures(scores), pictures


def seated(row: str, options: argparse.Namespace) -> tuple[dict[str, Any], list[Any]]:
    """Return figures of the seated man in 8 annotated frames of 40, and pictures."""
    recording = open_recording(DEPTH / "realsense" / "images_n40")
    solo = Solo(tracker_of(row, options, segment=SEATED), recording)
    places, pictures, errors, tracked = annotated("seated.json"), [], [], []
    for i in range(len(recording)):
        result = solo.step(recording.depth(i), float(recording.timestamps[i]))
        if str(i) in places:
            truth = places[str(i)]
            found = result.joints[None, upper.ROWS].astype(np.float64)
            errors.append(upper.pixel_errors(found, truth[None], recording.camera)[0])
            tracked.append(result.state == TRACKED)
            pictures.append(picture_of(recording, i, result.joints, result.observed, truth))
    score = upper.UpperScore("seated", np.array(errors), np.full((len(errors), 7), np.nan), np.array(tracked))
    return _real_figures([score]), pictures


def _real_figures(scores: Sequence[upper.UpperScore]) -> dict[str, Any]:
    """Return the figures that need no metres, and the mean of each recording."""
    figures = {name: value for name, value in upper.upper_figures(scores).items() if name != "upper_mm"}
    return figures | {"each": {score.name: [round(float(v), 1) for v in score.pixels.mean(axis=1)] for score in scores}}


def print_table(figures: dict[str, dict[str, Any]]) -> None:
    """Print one line per row."""
    print(f"{'':<16}", *(f"{heading:>{max(len(heading), 7)}}" for _, heading, _ in COLUMNS))
    for row, values in figures.items():
        cells = []
        for name, heading, factor in COLUMNS:
            value = values.get(name)
            cells.append(f"{'-' if value is None else format(factor * value, '.1f'):>{max(len(heading), 7)}}")
        print(f"{row:<16}", *cells)


def run_row(row: str, recordings: Sequence[Recording], options: argparse.Namespace) -> dict[str, Any]:
    """Return figures of one tracker over all takes."""
    tracker = tracker_of(row, options)
    scores, seconds, frames = [], [], []
    for recording in recordings:
        try:
            score, spent = score_take(Solo(tracker, recording), recording, options.frames)
        except DepthMocapError as error:
            print(f"{row}: {recording.name}: {error}")
            continue
        scores.append(score)
        seconds.append(spent)
        if options.recovery:
            frames += [recovery(tracker, recording, raised=raised) for raised in (False, True)]
    figures = upper.upper_figures(scores) | {"frame_rate": 1.0 / float(np.median(seconds))}
    if frames:
        taken = [WAITED if n is None else n for n in frames]
        figures |= {
            "recovered": float(np.mean([n is not None for n in frames])),
            "recovery_frames": float(np.median(taken)),
        }
    each = {s.name: {"px": float(s.pixels.mean()), "hands_px": float(s.pixels[:, upper.HANDS].mean())} for s in scores}
    return figures | {"takes": each}


def parse(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--rows", default=DEFAULT_ROWS, help="out of: " + ", ".join(ROWS))
    parser.add_argument("--groups", default=",".join(GROUPS), help="out of: " + ", ".join((*GROUPS, *MORE)))
    parser.add_argument("--takes", type=int, help="at most so many of each group")
    parser.add_argument("--frames", type=int, default=90, help="at most so many of each take")
    parser.add_argument("--recovery", action="store_true")
    parser.add_argument("--real", action="store_true", help="the stills and the seated man instead of the takes")
    add_database_options(parser)
    return parser.parse_args()


def track(parser: argparse.ArgumentParser) -> None:
    """Track missing runs, print, write JSON and contact sheets."""
    options = parse(parser)
    rows = options.rows.split(",")
    figures: dict[str, Any] = {}
    if options.real:
        for row in rows:
            for name, run in (("stills", stills), ("seated", seated)):
                figures[f"{row} {name}"], pictures = run(row, options)
                save_jpeg(RESULTS / f"upper_{name}_{row.replace(' ', '_')}.jpg", contact_sheet(pictures, columns=4))
    else:
        scenes = upper_scenes(options.split, tuple(options.groups.split(",")), options.takes)
        recordings = [open_recording(record_scene(scene, options.work, options.frames)) for scene in scenes]
        for row in rows:
            figures[row] = run_row(row, recordings, options)
    print_table(figures)
    whole = options.takes is None and options.frames >= 90 and not options.set and options.groups == ",".join(GROUPS)
    stem = "upper_real" if options.real else f"upper_{options.split}"
    own = "" if options.rows == DEFAULT_ROWS else "_" + options.rows.replace(",", "_").replace(" ", "_")
    settings = {name: getattr(options, name) for name in ("rows", "frames", "groups", "set")}
    name = stem + (own if whole else "_part")
    plot_success({row: found["curve"] for row, found in figures.items() if "curve" in found}, RESULTS / f"{name}.jpg")
    print("written:", save_figures(name, figures, settings))


def speed(parser: argparse.ArgumentParser) -> None:
    """Measure frames a second; a tile of the paper is a quarter of an image 2.5 times as wide."""
    parser.add_argument("--frames", type=int, default=4, help="after the first, which is not counted")
    options = parser.parse_args()
    name = next(iter(annotated("stills.json")))
    recording = open_recording(DEPTH / "skeltrack" / f"depth-data-{name}", intrinsics=STILL_CAMERA)
    figures: dict[str, float] = {}
    for tile in (64, 128, 256):
        for particles in (64, 256, 1024):
            columns = {f"particles.{kind}_columns": tile * 5 // 2 for kind in ("trunk", "arm")}
            settings = {"particles.count": particles, "sensing.subject": "nearest", **columns}
            solo, spent = Solo(TrackerRecipe("lopez2011", settings).build(), recording), []
            for i in range(options.frames + 1):
                begun = time.process_time()
                solo.step(recording.depth(0), i / 30.0)
                spent.append(time.process_time() - begun)
            figures[f"{tile}x{tile} {particles}x3"] = 1.0 / float(np.median(spent[1:]))
            print(
                f"{tile}x{tile}, {particles} particles: {figures[f'{tile}x{tile} {particles}x3']:.2f} frames/s",
                flush=True,
            )
    print("written:", save_figures("upper_speed", figures, {"frames": options.frames}))


def plot_success(curves: Mapping[str, Mapping[str, float]], path: Path) -> None:
    """Plot the fraction of joints within a number of pixels of a 640x480 image, as in the paper's Fig. 10."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.add_subplot()
    for row, curve in curves.items():
        axes.plot([float(limit) for limit in curve], [100 * share for share in curve.values()], "o-", ms=3, label=row)
    axes.set(xlabel="error, pixels of a 640x480 image", ylabel="joints within, %", xlim=(0, 60), ylim=(0, 101))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    save_bytes(path, png_of(figure))


def main() -> None:
    """Run the named part."""
    run_part(__doc__, {"track": track, "speed": speed})


if __name__ == "__main__":
    main()
