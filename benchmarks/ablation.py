"""Ablation of person detection: `depthmocap bench ablation [--rows "one pass"] [--takes 1]`.

The hybrid tracker is run with and without one part on the real rooms of `bench rooms`, on the scenes of `bench scenes`
with and without `--rooms`, and on the suite of `bench accuracy`; of the last three, the first 45 frames of some
recordings per group of the report split. The rows are

- `whole`: complete tracker;
- `first frame`: background and people from the first frame only;
- `no floor`: no stature from the height above the floor;
- `one pass`: without the second pass (`--online`).
"""

import argparse
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks import rooms
from benchmarks._record import benchmark, script
from benchmarks._rows import DATABASE, poses_of, settings_of
from benchmarks.scenes import tracked_scores
from tests.support.scene_scores import scene_figures
from tests.support.scenes import GROUPS, ROOM_GROUPS, chosen_scenes, record_scene
from tests.support.suite import chosen_takes
from toolkit.app.config import parse_overrides
from toolkit.database.database import PoseDatabase
from toolkit.people import survey
from toolkit.sensing.camera import Camera
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracking.body_learning import FollowedBody

LONGEST = 45
"""Frames of a simulated recording."""
ROWS = ("whole", "first frame", "no floor", "one pass")


class FloorlessTracker(HybridTracker):
    """Hybrid tracker without the floor height."""

    def learner(self, camera: Camera, level_rotation: np.ndarray, floor: float | None = None) -> FollowedBody:
        """See `Tracker.learner`."""
        return super().learner(camera, level_rotation, None)


def figures_of_row(row: str, options: argparse.Namespace) -> dict[str, Any]:
    """Return the scores of a row on real rooms, scenes, furnished rooms and the suite."""
    database = poses_of(options)
    settings = settings_of("one pass" if row == "one pass" else "hybrid", parse_overrides(options.set))
    kind = FloorlessTracker if row == "no floor" else HybridTracker
    tracker = kind(PoseDatabase.load(database), settings, database_path=str(database))
    folder = options.work / "runs" / "ablation" / row.replace(" ", "_")
    scenes = {
        "scenes": chosen_scenes("report", GROUPS, options.takes),
        "furnished": chosen_scenes("report", ROOM_GROUPS, options.takes),
        "clean": chosen_takes("report", (), options.takes),
    }
    # the first of the frames that are spread over a recording is its first one
    with patch.object(survey, "SAMPLES", 1) if row == "first frame" else nullcontext():
        found: dict[str, Any] = {"rooms": real(tracker, folder, options.rooms)}
        for part, own in scenes.items():
            paths = [record_scene(scene, options.work, LONGEST) for scene in own]
            scores, _ = tracked_scores(paths, tracker, folder / part, people=1 if part == "clean" else None)
            found[part] = {"all": scene_figures(list(scores.values()))}
        return found


def real(tracker: HybridTracker, folder: Path, recordings: Path) -> dict[str, Any]:
    """Return the counts over all real rooms."""
    runs, failed = rooms.track_rooms(list(rooms.RATES), recordings, folder, tracker)
    return rooms.added(
        rooms.RoomScorer(rooms.annotations_of(name)).score(rooms.load_run(run) if name not in failed else [])
        for name, run in runs.items()
    )


@benchmark(DATABASE, rows=",".join(ROWS), takes=1, rooms=rooms.ROOMS)
def ablation(options: argparse.Namespace) -> tuple[str, Any]:
    """Track and score row after row."""
    rows = options.rows.split(",")
    name = "ablation" if rows == list(ROWS) else "ablation_rows_part"
    return name, {row: figures_of_row(row, options) for row in rows}


main = script(__name__, __doc__, ablation)
