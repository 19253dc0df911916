"""The suite of scenes, and its benchmark on a few frames."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks import _record
from benchmarks import scenes as bench
from database_builder.build import Sampling, build_database
from database_builder.regressor import RegressorSettings
from tests.support import suite
from tests.support.casting import listed
from tests.support.scenes import EMPTY_ROOMS, GROUPS, VIEWS, chosen_scenes, record_scene, scenes
from toolkit.evaluation.joint_errors import visible_joints
from toolkit.mocap.procedural import procedural_clips
from toolkit.recordings.opening import open_recording
from toolkit.tracks import EMPTY, TRACKED

SIZES = {"waist": 6, "seated": 6, "behind": 4, "several": 6, "children": 4, "clothes": 4, "empty": EMPTY_ROOMS}


@pytest.fixture
def bundled(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The suite of bundled motions, with results in a temporary folder, which is returned."""
    monkeypatch.setattr(suite, "MOCAP", tmp_path / "absent")
    for module in (_record, bench):
        monkeypatch.setattr(module, "RESULTS", tmp_path)
    return tmp_path


@pytest.mark.parametrize("split", ["tune", "report"])
def test_a_split_has_its_groups_and_a_third_of_it_each_way_of_being_cut_out(split: str) -> None:
    found = scenes(split)
    assert {group: sum(scene.group == group for scene in found) for group in GROUPS} == SIZES
    assert [sum(scene.view == view for scene in found if scene.actors) for view in VIEWS] == [10, 10, 10]
    assert {scene.view for scene in found if not scene.actors} == set(VIEWS)
    assert len({scene.name for scene in found}) == len(found)


def test_the_splits_share_neither_actors_nor_adult_bodies_nor_rooms() -> None:
    splits = [listed("recorded", split) for split in ("tune", "report")]
    cast = [[actor for scene in split for actor in scene.actors] for split in splits]
    assert [{actor.clip.split("_")[0] for actor in actors} for actors in cast] == [{"bk"}, {"dg", "02", "49"}]
    bodies = [{actor.body for actor in actors if actor.body != "child"} for actors in cast]
    assert not bodies[0] & bodies[1]
    statures = [{actor.stature for actor in actors if actor.stature} for actors in cast]
    assert not statures[0] & statures[1]
    rooms = [{scene.boxes for scene in scenes(split) if scene.group == "empty"} for split in ("tune", "report")]
    assert len(rooms[0] | rooms[1]) == 2 * EMPTY_ROOMS


@pytest.mark.data
def test_every_motion_of_the_scenes_exists(data_folder: Path) -> None:
    for scene in scenes("tune") + scenes("report"):
        for actor in scene.actors:
            assert len(suite.motion_files(actor.clip)) == 1, actor.clip


def test_from_the_waist_up_the_head_is_seen_and_the_feet_are_not(bundled: Path) -> None:
    recording = open_recording(record_scene(chosen_scenes("tune", ("waist",), 1)[0], bundled, frames=2))
    seen = visible_joints(recording.joints[0], recording.depth(0) / 1000.0, recording.camera)
    assert seen[3] and not seen[[14, 15, 18, 19]].any()


def test_people_of_a_scene_stay_as_long_as_the_longest_unless_they_pass(bundled: Path) -> None:
    crossing = next(s for s in scenes("tune") if [a.path for a in s.actors] == ["passes", "stays"])
    truth = open_recording(record_scene(crossing, bundled, frames=20)).joints
    present = np.isfinite(truth).all(axis=(2, 3))
    assert present[1].all() and not present[0, :10].any() and present[0, 10:].all()


def test_the_benchmark_scores_everybody_and_draws_the_worst(
    bundled: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    database = bundled / "poses.npz"
    parts = RegressorSettings(images=40, trees=1, depth=6, calibration=20)
    build_database(
        procedural_clips(["wave"], variations=1), database, Sampling(0.05, seated=False), parts=parts, workers=1
    )
    quick = ["--set", "shape.seconds=0", "--set", "sizes=[0.4]"]
    arguments = ["--groups", "behind,several,empty", "--takes", 1, "--frames", 3, *quick]
    monkeypatch.setattr(
        sys, "argv", ["bench", *map(str, arguments), "--database", str(database), "--work", str(bundled)]
    )
    bench.main()
    figures = json.loads((bundled / "scenes_tune_part.json").read_text())["figures"]
    lines = ["behind furniture", "several people", "all people", "cut out before", "with empty scene", "empty rooms"]
    assert list(figures["lines"]) == [*lines, "behind", "several", "empty"]
    assert figures["lines"]["all people"]["frames"] == 6 and len(figures["recordings"]) == 3
    assert figures["lines"]["empty rooms"]["error_mm"] is None
    assert (bundled / "scenes_tune_part.png").exists()
    assert "behind furniture" in capsys.readouterr().out
    runs = bundled / "runs" / "scenes"
    monkeypatch.setattr(sys, "argv", [*sys.argv, "--runs", str(runs)])
    bench.main()
    assert json.loads((bundled / "scenes_tune_part.json").read_text())["figures"]["lines"] == figures["lines"]
    assert "ms per frame:" in capsys.readouterr().out


def test_times_are_counted_by_how_many_people_are_tracked() -> None:
    class Told(SimpleNamespace):
        def __len__(self) -> int:
            return len(self.state)

    def told(states: list[int], ms: float) -> Any:
        return Told(state=np.array(states), stage_ms=np.full((len(states), 2), ms / 2))

    alone, pair = [told([TRACKED] * 3, 4.0)], [told([TRACKED] * 3, 6.0), told([EMPTY, TRACKED], 1.0)]
    assert bench.frame_times([alone, pair, []]) == {1: 4.0, 2: 7.0}
