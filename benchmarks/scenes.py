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
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from benchmarks._record import benchmark, script
from benchmarks._rows import DATABASE, TAKES, poses_of, track_each
from tests.support.scene_scores import SceneScore, scene_figures, score_scene
from tests.support.scenes import GROUPS, ROOM_GROUPS, chosen_scenes, record_scene
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline import TrackerRecipe
from toolkit.app.pipeline.image_joints import JointChoice
from toolkit.recordings.opening import open_recording
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import TRACK_FILE, Track
from toolkit.tracks.runs import person_runs

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


def tracked_scores(
    paths: Iterable[Path], tracker: Tracker, folder: Path, people: int | None = None, joints: str = "none"
) -> tuple[dict[Path, SceneScore], dict[str, str]]:
    """Track recordings into `folder`; return the score of each, and the reasons of failures by name."""
    runs: dict[Path, Any] = {folder / path.stem: (path, {}) for path in paths}
    failed = track_each(runs, tracker, people=people, joints=JointChoice(joints))
    scores = {}
    for run, (path, _) in runs.items():
        tracks = [Track.load(person) for person in person_runs(run) if (person / TRACK_FILE).exists()]
        scores[path] = score_scene(open_recording(path), tracks)
    return scores, {run.name: why for run, why in failed.items()}


@benchmark(
    TAKES, DATABASE, frames={"type": int}, rooms=False, joints=("none", "colour"),
    groups={"help": "comma-separated, out of: " + ", ".join((*GROUPS, *ROOM_GROUPS))},
)  # fmt: skip
def scenes(options: argparse.Namespace) -> tuple[str, Any]:
    """Track and score the scenes."""
    all_groups = ROOM_GROUPS if options.rooms else GROUPS
    groups = tuple(options.groups.split(",")) if options.groups else all_groups
    colour = options.joints == "colour"
    recorded = {
        record_scene(scene, options.work, options.frames, color=colour): scene
        for scene in chosen_scenes(options.split, groups, options.takes)
    }
    tracker = TrackerRecipe(overrides=parse_overrides(options.set), database=poses_of(options)).build()
    scores, failed = tracked_scores(recorded, tracker, options.work / "runs" / "scenes", joints=options.joints)
    lines = {
        line: scene_figures(own)
        for line, named in LINES.items()
        if (own := [scores[path] for path, scene in recorded.items() if scene.group in named])
    }
    stem = f"scenes{'_rooms' * options.rooms}_{options.split}{'_colour' * colour}"
    recordings = {path.stem: scene_figures([score]) for path, score in scores.items()}
    return stem, {"lines": lines, "recordings": recordings, "failed": failed}


main = script(__name__, __doc__, scenes)
