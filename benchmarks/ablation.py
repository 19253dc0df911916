"""Ablation of person detection: `depthmocap bench ablation [--rows "one pass"] [--takes 1]`.

The hybrid tracker is run with and without one part on the real rooms of `bench rooms`, on the scenes of `bench scenes`
with and without `--rooms`, and on the suite of `bench accuracy`; of the last three, the first 45 frames of some
recordings per group of the report split. The rows are

- `whole`: complete tracker;
- `first frame`: background and people from the first frame only;
- `no floor`: no stature from the height above the floor;
- `one pass`: without the second pass (`--online`).

A row that is done is kept in
`ablation_part.json`, and is not measured again on the same commit; with all of them there the file is `ablation.json`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks import _record, _room_scores, rooms
from benchmarks._record import save_figures
from benchmarks._rows import add_database_options, poses_of, settings_of, track_each
from benchmarks.scenes import tracks_of
from tests.support.scene_scores import SceneScore, scene_figures, score_scene
from tests.support.scenes import GROUPS, ROOM_GROUPS, chosen_scenes, record_scene
from tests.support.suite import chosen_takes
from toolkit.app.config import parse_overrides
from toolkit.database.database import PoseDatabase
from toolkit.people import survey
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import Camera
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.tracking.body_learning import FollowedBody

LONGEST = 45
"""Frames of a simulated recording."""
PART = "ablation_part"
"""Name of the result with the rows measured so far."""
ROWS = ("whole", "first frame", "no floor", "one pass")


class FloorlessTracker(HybridTracker):
    """Hybrid tracker without the floor height."""

    def learner(self, camera: Camera, level_rotation: np.ndarray, floor: float | None = None) -> FollowedBody:
        """See `Tracker.learner`."""
        return super().learner(camera, level_rotation, None)


class Ablation:
    """Runs of one tracker after the other on the same recordings.

    Parameters
    ----------
    options : of the command
    """

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options
        self._scenes = {
            "scenes": chosen_scenes("report", GROUPS, options.takes),
            "furnished": chosen_scenes("report", ROOM_GROUPS, options.takes),
            "clean": chosen_takes("report", (), options.takes),
        }

    def figures(self, row: str) -> dict[str, Any]:
        """Return the scores of a row on real rooms, scenes, furnished rooms and the suite."""
        options = self._options
        database = poses_of(options)
        settings = settings_of("one pass" if row == "one pass" else "hybrid", parse_overrides(options.set))
        kind = FloorlessTracker if row == "no floor" else HybridTracker
        tracker = kind(PoseDatabase.load(database), settings, database_path=str(database))
        folder = options.work / "runs" / "ablation" / row.replace(" ", "_")
        # the first of the frames that are spread over a recording is its first one
        with patch.object(survey, "SAMPLES", 1) if row == "first frame" else nullcontext():
            simulated = {part: self._simulated(part, tracker, folder / part) for part in self._scenes}
            return {"rooms": self._real(tracker, folder), **simulated}

    def _real(self, tracker: HybridTracker, folder: Path) -> dict[str, Any]:
        """Return the script's counts over all real rooms."""
        runs, failed = rooms.track_rooms(list(rooms.RATES), self._options.rooms, folder, tracker)
        total: dict[str, Any] = {}
        for name, run in runs.items():
            tracks = _room_scores.load_run(run) if name not in failed else []
            _room_scores.add(total, rooms.scored(rooms.annotations_of(name), tracks)["counts"])
        _room_scores.show("rooms", total)
        return total

    def _simulated(self, part: str, tracker: HybridTracker, folder: Path) -> dict[str, Any]:
        """Return figures of each group of one simulated part, and of all groups."""
        made = {record_scene(scene, self._options.work, LONGEST): scene for scene in self._scenes[part]}
        runs: dict[Path, tuple[Path, dict[str, Any]]] = {folder / path.stem: (path, {}) for path in made}
        for run, reason in track_each(runs, tracker, people=1 if part == "clean" else None).items():
            print(f"{run.name} was not tracked: {reason}")
        groups: dict[str, list[SceneScore]] = {}
        for run, (path, _) in runs.items():
            score = score_scene(open_recording(path), tracks_of(run))
            groups.setdefault(made[path].group, []).append(score)
            groups.setdefault("all", []).append(score)
        found = {group: scene_figures(scores) for group, scores in groups.items()}
        print(part, {group: round(figures["error_mm"] or 0.0, 1) for group, figures in found.items()})
        return found


def main() -> None:
    """Track and score row after row, and write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", default=",".join(ROWS), help="comma-separated, out of: " + ", ".join(ROWS))
    parser.add_argument("--takes", type=int, default=1, help="at most so many simulated recordings of each group")
    parser.add_argument("--rooms", type=Path, default=rooms.ROOMS, help="folder of the real rooms")
    add_database_options(parser)
    options = parser.parse_args()
    wanted = options.rows.split(",")
    told = ("takes", "set", "database", "threshold")
    ablation, described = Ablation(options), {name: getattr(options, name) for name in told}
    figures = _kept(described)
    for row in [row for row in wanted if row not in figures]:
        print(f"\n{row}", flush=True)
        figures[row] = ablation.figures(row)
        figures = _kept(described) | figures
        print("written:", save_figures(PART, figures, described))
        if set(figures) == set(ROWS) and not options.set:
            print("written:", save_figures("ablation", {name: figures[name] for name in ROWS}, described))


def _kept(described: Mapping[str, Any]) -> dict[str, Any]:
    """Return the rows measured on this commit without changes, by description."""
    path = _record.RESULTS / f"{PART}.json"
    told: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    commit, settings = _record.commit(), {name: _record.portable(value) for name, value in described.items()}
    same = not commit.endswith("+") and (told.get("commit"), told.get("settings")) == (commit, settings)
    return dict(told["figures"]) if same else {}


if __name__ == "__main__":
    main()
