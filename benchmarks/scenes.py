"""People as they are recorded: `depthmocap bench scenes [--split report] [--groups waist,seated]`.

The scenes are described in `tests/support/scenes.py`: from the waist up, seated, behind furniture, several people,
children and tilted cameras, clothes, rooms without people. `--rooms` takes the seven groups of furnished rooms
instead: people who enter and leave, carry things, embrace and hand over, crowds of four to six, cameras from 0.8 to
2.5 m above the floor, stills of one frame, and ten rooms of 300 frames without people. Every recording is
tracked with `--people all` and no segmentation option; one that cannot be tracked counts as
one in which no person was found. Seen joints are those of `visible_joints`; a missed person counts 1 m.
Identities are CLEAR MOT counts (gate 0.5 m). The calibration error is taken over all joints of all people who were
found; unobserved joints are the ones that are not seen. `--runs FOLDER` scores run folders that were made before,
named after their recordings, of one person (RUN/track.npz) or of several (RUN/people.json).
Results of a part of the suite go to files ending in `_part`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import RESULTS, save_figures, save_jpeg
from benchmarks._rows import add_database_options, poses_of, track_each
from tests.support.casting import Scene
from tests.support.scene_scores import SceneScore, scene_figures, score_scene
from tests.support.scenes import GROUPS, ROOM_GROUPS, chosen_scenes, record_scene, scenes
from tests.support.suite import has_mocap
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline import TrackerRecipe
from toolkit.app.pipeline.joint_choice import JointChoice
from toolkit.output.rendering import style
from toolkit.output.rendering.film import contact_sheet
from toolkit.output.rendering.overlay import color_depth, draw_points, draw_skeleton
from toolkit.recordings.opening import open_recording
from toolkit.sensing.recording import Recording
from toolkit.tracks import EMPTY, TRACK_FILE, TRACKED, Track
from toolkit.tracks.runs import person_runs

WIDTH, HEIGHT = 640, 480
"""Size of a picture, pixels, filled as far as the recording's proportions allow."""
TRUTH = (255, 0, 160)


def frame_picture(
    recording: Recording, frame: int, tracks: Sequence[Track], pixels: np.ndarray, title: str
) -> np.ndarray:
    """Return one frame as uint8 (HEIGHT, WIDTH, 3): all people, and true joints at image `pixels` (N, 2)."""
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
    for track in tracks:
        if frame < len(track) and track.state[frame] != EMPTY:
            draw_skeleton(picture, camera.project(track.joints[frame]), track.observed[frame])
    for shift in np.ndindex(3, 3):
        draw_points(picture, factor * pixels.reshape(-1, 2) + shift, TRUTH)
    style.write(picture, title, 6, 4)
    return picture


def tracks_of(run: Path) -> list[Track]:
    """Return the tracks of all people in a run; empty if it has none."""
    return [Track.load(person) for person in person_runs(run) if (person / TRACK_FILE).exists()]


def frame_times(recordings: Sequence[Sequence[Track]]) -> dict[int, float]:
    """Return milliseconds, median over frames by number of tracked people, without reading.

    Frames are those of recordings with the tracks of all people in them.
    """
    times: dict[int, list[float]] = {}
    for tracks in recordings:
        for frame in range(max(map(len, tracks), default=0)):
            there = [track for track in tracks if frame < len(track)]
            count = sum(bool(track.state[frame] == TRACKED) for track in there)
            times.setdefault(count, []).append(sum(float(track.stage_ms[frame].sum()) for track in there))
    return {count: float(np.median(times[count])) for count in sorted(times) if count}


LINES = {
    "waist up and seated": ("waist", "seated"),
    "behind furniture": ("behind",),
    "clothes": ("clothes",),
    "children, tilted": ("children",),
    "several people": ("several",),
    "all people": GROUPS[:-1],
    "cut out before": GROUPS[:-1],
    "with empty scene": GROUPS[:-1],
    "with neither": GROUPS[:-1],
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
LINE_VIEWS = {"cut out before": "cut", "with empty scene": "background", "with neither": "room"}
"""Rows of the table with the scenes of one view."""
COLUMNS = (
    ("recordings", "clips", "d", 1.0),
    ("error_mm", "seen mm", ".1f", 1.0),
    ("a100", "A(100) %", ".1f", 100.0),
    ("switches", "switches", "d", 1.0),
    ("misses", "misses", "d", 1.0),
    ("false", "false", "d", 1.0),
    ("found_soon", "found %", ".1f", 100.0),
    ("numbers_right", "number %", ".1f", 100.0),
    ("unobserved_mm", "unobs. mm", ".0f", 1.0),
    ("unobserved_confidence", "its conf.", ".2f", 1.0),
    ("unobserved_sure_a100", "sure: A(100) %", ".1f", 100.0),
    ("ece", "ECE", ".3f", 1.0),
    ("recordings_tracked", "tracked", "d", 1.0),
)
"""Figure, heading, format and factor of the printed table."""
WORST = 12
"""Recordings on the contact sheet."""


def track_scenes(paths: Sequence[Path], options: argparse.Namespace) -> tuple[list[Path], dict[str, str]]:
    """Return run folders of all recordings, and the reasons of failures."""
    tracker = TrackerRecipe(overrides=parse_overrides(options.set), database=poses_of(options)).build()
    runs: dict[Path, tuple[Path, dict[str, Any]]] = {
        options.work / "runs" / "scenes" / path.stem: (path, {}) for path in paths
    }
    failed = track_each(runs, tracker, people=options.people, joints=JointChoice(options.joints))
    return list(runs), {run.name: reason for run, reason in failed.items()}


def table(scores: dict[str, SceneScore], made_from: dict[str, Scene]) -> dict[str, dict[str, Any]]:
    """Return figures of each row with a recording, and of each group, by name; scores and scenes are by recording."""
    names = LINES | {group: (group,) for group in GROUPS}
    found = {}
    for line, groups in names.items():
        view = LINE_VIEWS.get(line)
        own = [
            score
            for name, score in scores.items()
            if made_from[name].group in groups and view in (None, made_from[name].view)
        ]
        if own:
            found[line] = scene_figures(own)
    return found


def print_table(figures: dict[str, dict[str, Any]]) -> None:
    """Print the rows of `LINES` that exist."""
    print(f"{'':<21}", *(f"{heading:>{max(len(heading), 8)}}" for _, heading, _, _ in COLUMNS))
    for line in [line for line in LINES if line in figures]:
        cells = []
        for name, heading, style_, factor in COLUMNS:
            value = figures[line][name]
            text = "-" if value is None else format(factor * value if factor != 1.0 else value, style_)
            cells.append(f"{text:>{max(len(heading), 8)}}")
        print(f"{line:<21}", *cells)


def badness(score: SceneScore) -> float:
    """Return the mean error of the visible joints, metres; in an empty room the fraction of frames with a person."""
    return float(score.errors[score.seen].mean()) if score.seen.any() else float(score.tracked.mean())


def worst_frame(recording: Recording, tracks: Sequence[Track], score: SceneScore) -> np.ndarray:
    """Return the frame of a recording with the largest error, truth as white points, tracks as skeletons."""
    per_frame = np.where(score.seen, np.nan_to_num(score.errors), 0.0).sum(axis=(1, 2))
    frame = int(np.argmax(per_frame / np.maximum(score.seen.sum(axis=(1, 2)), 1) + 1e-6 * score.tracked))
    truth = recording.joints if recording.joints.ndim == 4 else recording.joints[None]
    pixels = np.array([recording.camera.project(person) for person in truth[:, frame]])
    title = f"{recording.name.rsplit('_', 1)[0]}  frame {frame}  {1000 * badness(score):.0f} mm"
    return frame_picture(recording, frame, tracks, pixels, title)


def write_sheet(paths: Sequence[Path], runs: Sequence[Path], scores: dict[str, SceneScore], path: Path) -> None:
    """Write pictures of the worst recordings, worst first."""
    order = sorted(range(len(paths)), key=lambda i: -badness(scores[paths[i].stem]))[:WORST]
    pictures = [
        worst_frame(open_recording(paths[i]), tracks_of(runs[i]), scores[paths[i].stem])
        for i in order
        if badness(scores[paths[i].stem]) > 0
    ]
    if pictures:
        save_jpeg(path, contact_sheet(pictures, columns=4))


def _people(text: str) -> int | None:
    return None if text == "all" else int(text)


def parse() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--rooms", action="store_true", help="the groups of furnished rooms")
    groups = ", ".join((*GROUPS, *ROOM_GROUPS))
    parser.add_argument("--groups", help=f"comma-separated, out of: {groups}; all without --rooms are the first seven")
    parser.add_argument("--takes", type=int, help="at most so many scenes of each group")
    parser.add_argument("--frames", type=int, help="at most so many frames of each scene")
    parser.add_argument("--people", type=_people, default=None, metavar="all|N", help="as of `depthmocap track`")
    parser.add_argument(
        "--joints", default="none", help="in the image, as of `depthmocap track`; colour makes scenes in colour"
    )
    parser.add_argument("--runs", type=Path, help="score the run folders in here instead of tracking")
    add_database_options(parser)
    return parser.parse_args()


def main() -> None:
    """Track missing runs, score, print, write JSON and the contact sheet."""
    options = parse()
    all_groups = ROOM_GROUPS if options.rooms else GROUPS
    groups = tuple(options.groups.split(",")) if options.groups else all_groups
    chosen = chosen_scenes(options.split, groups, options.takes)
    print(f"{len(chosen)} scenes of the {options.split} split, from {'mocap' if has_mocap() else 'bundled motions'}")
    paths = [record_scene(scene, options.work, options.frames, color=options.joints == "colour") for scene in chosen]
    failed: dict[str, str] = {}
    if options.runs is None:
        runs, failed = track_scenes(paths, options)
    else:
        runs = [options.runs / path.stem for path in paths]
    scores = {
        path.stem: score_scene(open_recording(path), tracks_of(run)) for path, run in zip(paths, runs, strict=True)
    }
    figures = table(scores, {path.stem: scene for path, scene in zip(paths, chosen, strict=True)})
    print_table(figures)
    for name, reason in failed.items():
        print(f"{name} was not tracked: {reason}")
    complete = len(chosen) == len(scenes(options.split, all_groups)) and options.frames is None
    plain = options.people is None and options.joints in ("none", "colour")
    whole = complete and plain and not options.set
    told = "_colour" if options.joints == "colour" else ""
    stem = f"scenes{'_rooms' if options.rooms else ''}_{options.split}{told}{'' if whole else '_part'}"
    recordings = {name: scene_figures([score]) for name, score in scores.items()}
    times = frame_times([tracks_of(run) for run in runs])
    print("ms per frame:", ", ".join(f"{count} people {ms:.1f}" for count, ms in times.items()))
    content = {"lines": figures, "recordings": recordings, "failed": failed, "frame_ms": times}
    described = {name: getattr(options, name) for name in ("set", "frames", "groups")}
    described |= {"mocap": has_mocap(), "people": options.people or "all"}
    print("written:", save_figures(stem, content, described))
    write_sheet(paths, runs, scores, RESULTS / f"{stem}.jpg")


if __name__ == "__main__":
    main()
