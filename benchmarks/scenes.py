"""People as they are recorded: `depthmocap bench scenes [--split report] [--groups waist,seated]`.

The scenes are described in `tests/support/scenes.py`: from the waist up, seated, behind furniture, several people,
children and tilted cameras, clothes, rooms without people. `--rooms` takes the seven groups of furnished rooms
instead: people who enter and leave, carry things, embrace and hand over, crowds of four to six, cameras from 0.8 to
2.5 m above the floor, stills of one frame, and ten rooms of 300 frames without people. Every recording is tracked with
`--people all` and no segmentation option; one that cannot be tracked counts as one in which no person was found. Seen
joints are those of `visible_joints`; a missed person counts 1 m. Identities are CLEAR MOT counts (gate 0.5 m).
Unobserved joints are those that are not seen. Results of a part of the suite go to files ending in `_part`.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import RESULTS, benchmark, save_jpeg, script
from benchmarks._rows import DATABASE, TAKES, poses_of, track_each
from tests.support.scene_scores import SceneScore, scene_figures, score_scene
from tests.support.scenes import GROUPS, ROOM_GROUPS, chosen_scenes, record_scene
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline import TrackerRecipe
from toolkit.app.pipeline.joint_choice import JointChoice
from toolkit.output.rendering import style
from toolkit.output.rendering.film import contact_sheet
from toolkit.output.rendering.overlay import color_depth, draw_points, draw_skeleton
from toolkit.recordings.opening import open_recording
from toolkit.sensing.recording import Recording
from toolkit.tracks import EMPTY, TRACK_FILE, Track
from toolkit.tracks.runs import person_runs

WIDTH, HEIGHT = 640, 480
"""Size of a picture, pixels, filled as far as the recording's proportions allow."""
TRUTH = (255, 0, 160)
"""Colour of true joints."""
LINES = {
    "waist up and seated": ("waist", "seated"),
    "behind furniture": ("behind",),
    "clothes": ("clothes",),
    "children, tilted": ("children",),
    "several people": ("several",),
    "all people": GROUPS[:-1],
    "empty rooms": ("empty",),
    "enter and leave": ("enter",),
    "carry": ("carry",),
    "hug and hand over": ("together",),
    "four to six people": ("crowd",),
    "furnished rooms": ("rooms",),
    "stills": ("stills",),
    "all in rooms": ROOM_GROUPS[:-1],
    "rooms without people": ("vacant",),
}
"""Rows of the table with their groups."""
WORST = 12
"""Recordings on the contact sheet."""


def frame_picture(
    recording: Recording, frame: int, people: Sequence[tuple[np.ndarray, np.ndarray]], pixels: np.ndarray, title: str
) -> np.ndarray:
    """Return one frame as uint8 (HEIGHT, WIDTH, 3) with skeletons and true joints.

    Parameters
    ----------
    people : joints (20, 3), camera frame, metres, and observed joints, bool (20,), of each person
    pixels : true joints in the image (N, 2)
    """
    import cv2

    depth = recording.depth(frame)
    factor = min(WIDTH / recording.camera.width, HEIGHT / recording.camera.height)
    measured = depth[depth > 0] / 1000.0
    near, far = np.percentile(measured, [1, 99]) if measured.size else (1.0, 4.0)
    colored = color_depth(depth, np.ones(depth.shape, dtype=bool), float(near), float(far))
    shown = cv2.resize(colored, None, fx=factor, fy=factor, interpolation=cv2.INTER_NEAREST)
    picture = np.full((HEIGHT, WIDTH, 3), style.PAPER, dtype=np.uint8)
    picture[: shown.shape[0], : shown.shape[1]] = shown
    camera = recording.camera.scaled(factor)
    for joints, observed in people:
        draw_skeleton(picture, camera.project(joints.astype(np.float64)), observed)
    for shift in np.ndindex(3, 3):
        draw_points(picture, factor * pixels.reshape(-1, 2) + shift, TRUTH)
    style.write(picture, title, 6, 4)
    return picture


def tracks_of(run: Path) -> list[Track]:
    """Return the tracks of all people in a run; empty if it has none."""
    return [Track.load(person) for person in person_runs(run) if (person / TRACK_FILE).exists()]


def badness(score: SceneScore) -> float:
    """Return the mean error of the visible joints, metres; in an empty room the fraction of frames with a person."""
    return float(score.errors[score.seen].mean()) if score.seen.any() else float(score.tracked.mean())


def worst_frame(recording: Recording, tracks: Sequence[Track], score: SceneScore) -> np.ndarray:
    """Return the frame of a recording with the largest error, truth as points, tracks as skeletons."""
    per_frame = np.where(score.seen, np.nan_to_num(score.errors), 0.0).sum(axis=(1, 2))
    frame = int(np.argmax(per_frame / np.maximum(score.seen.sum(axis=(1, 2)), 1) + 1e-6 * score.tracked))
    truth = recording.joints if recording.joints.ndim == 4 else recording.joints[None]
    pixels = np.array([recording.camera.project(person) for person in truth[:, frame]])
    title = f"{recording.name.rsplit('_', 1)[0]}  frame {frame}  {1000 * badness(score):.0f} mm"
    present = [track for track in tracks if frame < len(track) and track.state[frame] != EMPTY]
    people = [(track.joints[frame], track.observed[frame]) for track in present]
    return frame_picture(recording, frame, people, pixels, title)


def write_sheet(runs: Mapping[Path, tuple[Path, Any]], scores: Mapping[str, SceneScore], path: Path) -> None:
    """Write pictures of the worst recordings, worst first."""
    order = sorted(runs, key=lambda run: -badness(scores[run.name]))[:WORST]
    pictures = [
        worst_frame(open_recording(runs[run][0]), tracks_of(run), scores[run.name])
        for run in order
        if badness(scores[run.name]) > 0
    ]
    if pictures:
        save_jpeg(path, contact_sheet(pictures, columns=4))


@benchmark(
    TAKES, DATABASE, frames={"type": int}, rooms=False, joints=("none", "colour"),
    groups={"help": "comma-separated, out of: " + ", ".join((*GROUPS, *ROOM_GROUPS))},
)  # fmt: skip
def scenes(options: argparse.Namespace) -> tuple[str, Any]:
    """Track and score the scenes, and write the contact sheet."""
    all_groups = ROOM_GROUPS if options.rooms else GROUPS
    groups = tuple(options.groups.split(",")) if options.groups else all_groups
    colour = options.joints == "colour"
    recorded = {
        record_scene(scene, options.work, options.frames, color=colour): scene
        for scene in chosen_scenes(options.split, groups, options.takes)
    }
    tracker = TrackerRecipe(overrides=parse_overrides(options.set), database=poses_of(options)).build()
    runs: dict[Path, Any] = {options.work / "runs" / "scenes" / path.stem: (path, {}) for path in recorded}
    failed = track_each(runs, tracker, people=None, joints=JointChoice(options.joints))
    scores = {run.name: score_scene(open_recording(path), tracks_of(run)) for run, (path, _) in runs.items()}
    lines = {
        line: scene_figures(own)
        for line, named in LINES.items()
        if (own := [scores[path.stem] for path, scene in recorded.items() if scene.group in named])
    }
    stem = f"scenes{'_rooms' * options.rooms}_{options.split}{'_colour' * colour}"
    write_sheet(runs, scores, RESULTS / f"{stem}{options.suffix}.jpg")
    recordings = {name: scene_figures([score]) for name, score in scores.items()}
    return stem, {"lines": lines, "recordings": recordings, "failed": {run.name: why for run, why in failed.items()}}


main = script(__name__, __doc__, scenes)
