"""What each part of telling people from rooms is worth: `depthmocap bench ablation [--rows "one pass"] [--takes 1]`.

The hybrid tracker, whole and without one part, is let loose on the real rooms of `bench rooms`, on the
scenes of `bench scenes` with and without `--rooms`, and on the clean suite of `bench accuracy`: of the last three some
recordings of each group of the report split, their first 60 frames. The rows are

- `whole`: nothing is left out;
- `first frame`: the room and its people are told by the first frame, not by frames from all over the recording;
- `no rooms`: the joint regressor was trained on people alone, so that it takes nothing for furniture;
- `no floor`: how high a person is above the floor says nothing of their size;
- `one pass`: each frame is done with as it comes (`--online`);
- `colour`: nothing is left out, and joints are found in the colour beside the depth; real rooms alone have any.

Every row but `no rooms` has the same database; that row's holds the same poses.
"""

from __future__ import annotations

import argparse
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks import rooms
from benchmarks._record import save_figures
from benchmarks._rows import add_database_options, poses_of, settings_of, track_each
from benchmarks.scenes import tracks_of
from database_builder.regressor import RegressorSettings
from database_builder.views import ViewSettings
from toolkit.config import parse_overrides
from toolkit.database.database import PoseDatabase
from toolkit.hybrid.tracker import HybridTracker
from toolkit.people import survey
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import Camera
from toolkit.testing.scene_scores import scene_figures, score_scene
from toolkit.testing.scenes import GROUPS, ROOM_GROUPS, chosen_scenes, record_scene
from toolkit.testing.suite import chosen_takes, database
from toolkit.tracking.learning import FollowedBody

LONGEST = 60
"""Frames of a simulated recording."""
ROWS = ("whole", "first frame", "no rooms", "no floor", "one pass", "colour")


class FloorlessTracker(HybridTracker):
    """The hybrid tracker, to whom the floor does not tell how tall somebody is."""

    def learner(self, camera: Camera, level_rotation: np.ndarray, floor: float | None = None) -> FollowedBody:
        """See `Tracker.learner`."""
        return super().learner(camera, level_rotation, None)


class Ablation:
    """One tracker after the other on the same recordings.

    Parameters
    ----------
    options : of the command
    """

    def __init__(self, options: argparse.Namespace) -> None:
        self._options, self._score = options, rooms.scorer(options.rooms)
        chosen = {
            "scenes": chosen_scenes("report", GROUPS, options.takes),
            "furnished": chosen_scenes("report", ROOM_GROUPS, options.takes),
            "clean": chosen_takes("report", (), options.takes),
        }
        self._paths = {
            kind: [record_scene(scene, options.work, LONGEST) for scene in scenes] for kind, scenes in chosen.items()
        }

    def figures(self, row: str) -> dict[str, Any]:
        """What a row makes of real rooms, scenes, furnished rooms and the clean suite."""
        options = self._options
        database = without_rooms(options) if row == "no rooms" else poses_of(options)
        settings = settings_of("one pass" if row == "one pass" else "hybrid", parse_overrides(options.set))
        kind = FloorlessTracker if row == "no floor" else HybridTracker
        tracker = kind(PoseDatabase.load(database), settings, database_path=str(database))
        folder = options.work / "runs" / "ablation" / row.replace(" ", "_")
        # The first of the frames that are spread over a recording is its first one.
        with patch.object(survey, "SAMPLES", 1) if row == "first frame" else nullcontext():
            found = {"rooms": self._real(tracker, folder, "colour" if row == "colour" else "none")}
            if row != "colour":
                found |= {part: self._simulated(part, tracker, folder / part) for part in self._paths}
        return found

    def _real(self, tracker: HybridTracker, folder: Path, joints: str) -> dict[str, Any]:
        """The script's counts over all real rooms."""
        runs, failed = rooms.track_rooms(list(rooms.RATES), self._options.rooms, folder / "rooms", tracker, joints)
        total: dict[str, Any] = {}
        for name, run in runs.items():
            tracks = self._score.load_run(run) if name not in failed else []
            self._score.add(
                total, rooms.scored(self._score, rooms.annotations_of(self._options.rooms, name), tracks)["counts"]
            )
        self._score.show("rooms", total)
        return total

    def _simulated(self, part: str, tracker: HybridTracker, folder: Path) -> dict[str, Any]:
        """Figures of one part of what is simulated."""
        runs: dict[Path, tuple[Path, dict[str, Any]]] = {folder / path.stem: (path, {}) for path in self._paths[part]}
        for run, reason in track_each(runs, tracker, people=1 if part == "clean" else None).items():
            print(f"{run.name} was not tracked: {reason}")
        found = scene_figures([score_scene(open_recording(path), tracks_of(run)) for run, (path, _) in runs.items()])
        print(part, *(f"{name} {found[name]}" for name in ("error_mm", "a100", "switches", "misses", "false")))
        return found


def without_rooms(options: argparse.Namespace) -> Path:
    """The suite's own database with a regressor of people alone; made if it is not there yet."""
    parts = RegressorSettings(images=options.images, views=ViewSettings(rooms=0.0))
    return database(options.work, options.threshold, parts)


def main() -> None:
    """Track and score row after row, and write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", default=",".join(ROWS), help="comma-separated, out of: " + ", ".join(ROWS))
    parser.add_argument("--takes", type=int, default=1, help="at most so many simulated recordings of each group")
    parser.add_argument("--rooms", type=Path, default=rooms.ROOMS, help="folder of the real rooms")
    add_database_options(parser)
    options = parser.parse_args()
    ablation, figures = Ablation(options), {}
    for row in options.rows.split(","):
        print(f"\n{row}", flush=True)
        figures[row] = ablation.figures(row)
    name = "ablation" if options.rows == ",".join(ROWS) and not options.set else "ablation_part"
    print("written:", save_figures(name, figures, {"takes": options.takes, "set": options.set}))


if __name__ == "__main__":
    main()
