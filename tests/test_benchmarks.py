"""The benchmarks run, on a suite of a few frames."""

from __future__ import annotations

import json
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from benchmarks import (
    _movement,
    _qammaz_tables,
    _record,
    _speed_wings,
    _swarm_runs,
    _takes,
    ablation,
    accuracy,
    real,
    recovery,
    regressor,
    speed,
    stabilise,
    swarm,
    upper,
)
from benchmarks._rows import WatchedTracker, swarm_settings
from database_builder.build import Sampling, build_database
from database_builder.regressor import RegressorSettings
from tests.support import suite
from tests.support.casting import listed
from tests.support.misled import wrong_pose
from tests.support.scenes import chosen_scenes, people_of, record_scene
from tests.support.solo import Solo
from tests.support.suite import GROUPS, chosen_takes, takes
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.database.database import PoseDatabase
from toolkit.mocap.procedural import procedural_clips
from toolkit.people import survey
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera
from toolkit.simulation.person import facing_of
from toolkit.trackers.hybrid.tracker import HybridTracker
from toolkit.trackers.qammaz.tracker import SwarmTracker
from toolkit.tracks import Track

QUICK = ("--set", "shape.seconds=0.1", "--set", "sizes=[0.4]")
"""The shape is learnt from two frames only, of one size."""
FEW = [f"--set={name}" for name in ("sizes=[0.4]", "swarm.particles=6", "swarm.generations=4", "shape.seconds=0.1")]
"""The same, by a swarm too small to find much."""


@pytest.fixture(scope="module")
def small_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("database") / "poses.npz"
    clips = procedural_clips(["wave", "squat", "walk"])
    parts = RegressorSettings(images=60, trees=1, depth=8, calibration=20)
    build_database(clips, path, Sampling(0.03, seated=False), parts=parts, workers=1)
    return path


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings that several tests take: each is made once."""
    return tmp_path_factory.mktemp("work")


@pytest.fixture
def bundled(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The suite of bundled motions, with results in a temporary folder, which is returned."""
    monkeypatch.setattr(suite, "MOCAP", tmp_path / "absent")
    for module in (_record, accuracy, _qammaz_tables):
        monkeypatch.setattr(module, "RESULTS", tmp_path)
    return tmp_path


def run(module: object, *arguments: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["bench", *map(str, arguments)])
    module.main()  # type: ignore[attr-defined]


def test_every_split_has_at_least_24_takes_in_five_groups_with_names_of_their_own(bundled: Path) -> None:
    for split in (listed("clean", "tune"), listed("clean", "report"), takes("tune"), takes("report")):
        assert len(split) >= 24
        assert {take.group for take in split} == set(GROUPS)
        assert len({take.name for take in split}) == len(split)


def test_no_actor_of_a_take_is_in_the_database_or_in_the_other_split() -> None:
    splits = [listed("clean", split) for split in ("tune", "report")]
    actors = [{take.actor.clip.split("_")[0] for take in split} for split in splits]
    assert actors == [{"bk"}, {"dg", "02", "49"}]


@pytest.mark.data
def test_the_database_is_made_of_other_actors(data_folder: Path) -> None:
    names = [path.stem for path in suite.database_sources() or []]
    assert names and not any(name.startswith(("02_", "49_", "HDM_bk", "HDM_dg")) for name in names)


@pytest.mark.data
def test_every_motion_of_the_suite_exists(data_folder: Path) -> None:
    for take in takes("tune") + takes("report"):
        assert len(suite.motion_files(take.actor.clip)) == 1, take.name


def test_takes_that_two_benchmarks_need_at_once_are_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Path] = []

    def simulated(people: object, recording: Path, shot: object) -> None:
        time.sleep(0.05)
        made.append(recording)
        recording.touch()

    poses = np.zeros((1, skeleton.POSE_SIZE))
    view = SimpleNamespace(up_camera=np.array([0.0, -1.0, 0.0]), to_camera=lambda points: points)
    simulation = SimpleNamespace(performers=[SimpleNamespace(poses=poses, body=None)], view=view)
    monkeypatch.setattr(_movement, "simulate_scene", simulated)
    monkeypatch.setattr(_movement, "tracked_run", lambda recording, run, database: recording.exists())
    monkeypatch.setattr(_movement, "prepare", lambda people, shot: simulation)

    def taken(_: int) -> _movement.Tracked:
        return _movement.tracked_shot(cast(Any, None), cast(Any, None), tmp_path / "walk", tmp_path)

    with ThreadPoolExecutor(2) as pool:
        assert all(found.person for found in pool.map(taken, range(2)))
    assert made == [tmp_path / "walk.npz"]


def test_a_turning_subject_turns_by_the_angle_that_the_take_says(bundled: Path) -> None:
    take = next(take for take in takes("tune") if take.actor.spin == 360)
    still = replace(take, actors=(replace(take.actor, spin=0.0),))
    clips = [people_of(scene, 60)[0].clip for scene in (still, take)]
    yaws = [np.unwrap([facing_of(pose) for pose in clip.poses]) for clip in clips]
    np.testing.assert_allclose(np.degrees(yaws[1] - yaws[0])[[0, -1]], [0.0, 360.0], atol=1e-6)


def test_the_whole_subject_stays_in_the_image(bundled: Path, work: Path) -> None:
    take = chosen_takes("tune", ["fast"], 1)[0]
    recording = open_recording(record_scene(take, work, frames=20))
    pixels = recording.camera.project(recording.joints)
    assert (pixels > 0).all()
    assert (pixels < [recording.camera.width - 1, recording.camera.height - 1]).all()


def test_accuracy_compares_trackers_and_writes_figures_and_plots(
    bundled: Path, work: Path, small_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["--rows", "hybrid,local", "--groups", "basic,turn", "--takes", 1, "--frames", 4]
    run(accuracy, *arguments, "--database", small_database, "--work", work, *QUICK, monkeypatch=monkeypatch)
    figures = json.loads((bundled / "accuracy_tune_part.json").read_text())["figures"]
    assert list(figures["rows"]) == ["hybrid", "local"]
    assert set(figures["rows"]["hybrid"]["means"]) == {"basic", "turn", "overall"}
    assert sum(entry["joints"] for entry in figures["confidence"]) == 2 * 4 * 20
    assert all(0 <= wrong["longest"] <= 4 and wrong["frames"] <= 8 for wrong in figures["wrong"].values())
    assert (bundled / "accuracy_tune_part.png").exists()
    assert (bundled / "accuracy_tune_part_confidence.png").exists()


def test_wrong_frames_are_counted_over_all_recordings_and_in_a_row_within_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth = np.zeros((6, len(skeleton.REPORTED), 3))
    tracks = {"a": truth + np.array([1, 0, 0, 1, 1, 0.0])[:, None, None], "b": truth + np.ones(6)[:, None, None]}
    tracks["b"][0] = 0.0
    monkeypatch.setattr(accuracy.Track, "load", lambda run: SimpleNamespace(joints=tracks[run.name]))
    monkeypatch.setattr(accuracy, "open_recording", lambda path: SimpleNamespace(joints=truth))
    assert accuracy.wrong_stretches([Path("a")], [tmp_path]) == {"frames": 3, "longest": 2}
    assert accuracy.wrong_stretches([Path("a"), Path("b")], [tmp_path] * 2) == {"frames": 8, "longest": 5}


def test_what_each_part_of_telling_people_from_rooms_is_worth_is_told_row_by_row(
    bundled: Path, work: Path, small_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ablation.Ablation, "_real", lambda *_: {})
    monkeypatch.setattr(ablation, "chosen_scenes", lambda split, groups, count: chosen_scenes(split, groups[:1], count))
    monkeypatch.setattr(ablation, "chosen_takes", lambda split, groups, count: chosen_takes(split, ["basic"], count))
    monkeypatch.setattr(ablation, "LONGEST", 4)
    monkeypatch.setattr(_record, "commit", lambda: "0123abc")
    surveyed = []
    tracked = ablation.track_each
    monkeypatch.setattr(ablation, "track_each", lambda *a, **k: surveyed.append(survey.SAMPLES) or tracked(*a, **k))
    arguments = ["--rows", "whole,first frame,no floor", "--database", small_database, "--work", work, *QUICK]
    run(ablation, *arguments, monkeypatch=monkeypatch)
    figures = json.loads((bundled / "ablation_part.json").read_text())["figures"]
    assert list(figures) == ["whole", "first frame", "no floor"]
    assert all(set(row) == {"rooms", "scenes", "furnished", "clean"} for row in figures.values())
    assert figures["whole"]["clean"]["basic"] == figures["whole"]["clean"]["all"]
    assert surveyed == 3 * [survey.SAMPLES] + 3 * [1] + 3 * [survey.SAMPLES]
    run(ablation, *arguments, monkeypatch=monkeypatch)
    assert len(surveyed) == 9  # what is measured on this commit is not measured again, ...
    monkeypatch.setattr(_record, "commit", lambda: "0123abc+")
    run(ablation, "--rows", "whole", *arguments[2:], monkeypatch=monkeypatch)
    run(ablation, "--rows", "whole", *arguments[2:], monkeypatch=monkeypatch)
    assert len(surveyed) == 15  # ... but what is changed since is


def test_without_the_floor_nobody_is_sized_by_it(small_database: Path) -> None:
    poses, camera = PoseDatabase.load(small_database), Camera(140.0, 140.0, 80.0, 60.0, 160, 120)
    floors = [kind(poses).learner(camera, np.eye(3), -1.0) for kind in (HybridTracker, ablation.FloorlessTracker)]
    assert [learner.follower.floor for learner in floors] == [-1.0, None]


def test_the_swarm_is_compared_with_its_parts_and_on_first_frames(
    bundled: Path, work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = [
        "--takes",
        1,
        "--frames",
        4,
        "--joints",
        "truth",
        "--rows",
        "swarm,qammaz joints",
        "--work",
        work,
        *FEW,
    ]
    monkeypatch.setattr(_swarm_runs, "EVERY", 2)
    monkeypatch.setattr(swarm, "chosen_takes", lambda split, count: chosen_takes(split, ["basic", "low"], count))
    for more in ([], ["--cold"]):
        run(swarm, "suite", *arguments, *more, monkeypatch=monkeypatch)
        figures = json.loads((bundled / f"swarm_tune_truth{'_cold' if more else ''}_part.json").read_text())["figures"]
        assert list(figures) == ["truth, swarm", "truth, qammaz joints"]
        assert set(figures["truth, swarm"]["groups"]) == {"basic", "low", "overall"}
        assert 0.0 < figures["truth, swarm"]["groups"]["overall"]["delta_mm"] < 1000.0
        assert {"mean", "low", "high"} <= set(figures["truth, qammaz joints"]["worse_mm"])
        counted = sum(entry["joints"] for entry in figures["truth, swarm"]["confidence"])
        assert counted == 2 * (2 if more else 4) * 20


def test_tables_of_the_swarms_paper_are_made_of_short_sequences(
    bundled: Path, work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_qammaz_tables, "scanned", lambda name, work: load_body("neutral"))
    arguments = ["--sequences", "MS_1", "--frames", 3, "--joints", "truth", "--work", work, *FEW]
    for part in swarm.TABLES:
        run(swarm, part, *arguments, monkeypatch=monkeypatch)
        figures = json.loads((bundled / f"qammaz_{part}.json").read_text())["figures"]
        assert all(0.0 < row["delta_mm"] < 1500.0 for row in figures["ours"].values())
        assert (bundled / f"qammaz_{part}.png").exists()
        if part == "models":
            assert "MS_1 with neutral" in figures["ours"] and figures["paper_mm"]["MS_1 with MS_2"] == 103.7


def test_first_frames_are_counted_with_the_swarm_and_without(
    bundled: Path, work: Path, small_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recovery, "chosen_takes", lambda split, count: chosen_takes(split, ["basic", "low"], count))
    arguments = ["--takes", 1, "--frames", 4, "--joints", "truth", "--rows", "hybrid,no swarm", "--every", 2]
    run(recovery, "cold", *arguments, "--database", small_database, "--work", work, *QUICK, monkeypatch=monkeypatch)
    figures = json.loads((bundled / "cold_tune_truth.json").read_text())["figures"]
    assert [figures[row]["overall"]["starts"] for row in ("hybrid", "no swarm")] == [4, 4]
    assert {"mean", "low", "high"} <= set(figures["no swarm"]["fewer_right_points"])


def test_the_swarms_time_is_told_by_stage_and_by_hypothesis(
    bundled: Path, work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_speed_wings, "HYPOTHESES", 4)
    monkeypatch.setattr(_speed_wings, "IMAGES", ((30, 40),))
    run(speed, "swarm", "--frames", 3, "--rows", "swarm", "--work", work, monkeypatch=monkeypatch)
    figures = json.loads((bundled / "speed_swarm.json").read_text())["figures"]
    assert list(figures["times"]) == ["swarm"] and set(figures["hypothesis_us"]) == {"balls", "mesh"}
    assert set(figures["times"]["swarm"]["stages"]) == {"prepare", "landmarks", "local", "swarm", "select"}


def test_recovery_counts_frames_until_the_pose_is_right(
    bundled: Path, work: Path, small_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recovery, "CAP", 3)
    monkeypatch.setattr(_takes, "WITHIN", 0.5)
    arguments = ["--takes", 1, "--frames", 4, "--starts", 5, "--database", small_database, "--work", work]
    run(recovery, "wrong", *arguments, *QUICK, monkeypatch=monkeypatch)
    figures = json.loads((bundled / "recovery_tune_part.json").read_text())["figures"]
    kinds, starts = figures["kinds"], figures["starts"]
    assert kinds["shifted"]["starts"] == sum(start["kind"] == "shifted" for start in starts) > 0
    assert kinds["all"] == recovery.summary(starts)
    assert {start["frames"] for start in starts} <= {1, 2, 3, None}


def test_a_recovery_that_never_came_counts_as_the_longest() -> None:
    found = [{"frames": frames} for frames in (1, 2, 4, None)]
    expected = {"starts": 4, "median": 3.0, "not_recovered": 1}
    assert recovery.summary(found).items() >= expected.items()
    assert recovery.summary([{"frames": None}])["median"] == recovery.CAP
    assert recovery.summary([])["median"] is None


def test_a_turned_pose_and_a_shifted_one_are_wrong_by_180_degrees_and_by_a_metre() -> None:
    rng = np.random.default_rng(0)
    pose = procedural_clips(["wave"])[0].poses[20]
    turned = wrong_pose("turned", pose, pose[None], rng)
    assert abs(np.degrees(facing_of(turned) - facing_of(pose))) == pytest.approx(180.0)
    np.testing.assert_allclose(turned[:3], pose[:3], atol=1e-9)
    shifted = wrong_pose("shifted", pose, pose[None], rng)
    assert np.linalg.norm(shifted[:3] - pose[:3]) == pytest.approx(1.0)
    assert shifted[1] == pose[1]


def test_frames_are_played_on_backwards_at_the_end() -> None:
    numbers = recovery.frames_from(2, 5)
    assert [next(numbers) for _ in range(8)] == [3, 4, 3, 2, 1, 0, 1, 2]


def test_speed_times_every_stage_at_full_and_half_resolution(
    bundled: Path, small_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(speed, "SIZES", (3_000,))
    arguments = ["--frames", 6, "--plain-frames", 0, "--memory-frames", "--max-poses", 300]
    run(speed, "hybrid", small_database, *arguments, monkeypatch=monkeypatch)
    full, half = json.loads((bundled / "speed_part.json").read_text())["figures"]["times"]
    assert (full["half_resolution"], half["half_resolution"]) == (False, True)
    assert set(full["stages"]) == {"prepare", "landmarks", "local", "arms", "lookup", "head_hands", "swarm", "select"}


def test_a_frame_costs_what_a_longer_recording_takes_more_of_the_processor(
    bundled: Path, small_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def tracked(recording: Path, _database: Path, _output: Path, *options: str) -> tuple[float, float]:
        frames, pass_ms = int(recording.stem.split("_")[1]), 10 if "--online" in options else 15
        return 100.0 + frames, 20.0 + frames * pass_ms / 1000

    made = {people: lambda path, frames: path.touch() for people in ("one", "six")}
    monkeypatch.setattr(speed, "MADE", made)
    monkeypatch.setattr(speed, "tracked", tracked)
    monkeypatch.setattr(speed, "person_runs", lambda run: [run])
    run(speed, "passes", small_database, "--frames", "4,9", monkeypatch=monkeypatch)
    figures = json.loads((bundled / "speed_passes.json").read_text())["figures"]
    assert figures["six"]["two"]["frame_ms"] == pytest.approx(15) and figures["six"]["two"]["peak_mb"] == 109
    assert figures["one"]["ratio"] == pytest.approx(1.5)


def test_six_people_are_recorded_by_a_camera_of_its_own_size(tmp_path: Path) -> None:
    speed.six_in_a_room(tmp_path / "six.npz", 2)
    recording = open_recording(tmp_path / "six.npz")
    assert recording.depth(1).shape == (480, 640)


@pytest.mark.data
def test_real_recordings_are_measured(
    cut_recordings: Path, bundled: Path, work: Path, small_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["--recordings", cut_recordings, "--stride", 2, "--database", small_database, "--work", work]
    run(real, "tracked", *arguments, *QUICK, monkeypatch=monkeypatch)
    mean = json.loads((bundled / "real_part.json").read_text())["figures"]["hybrid"]["mean"]
    assert 0 < mean["overlap"] <= 1


def test_the_watched_local_hypothesis_is_the_one_that_competes(bundled: Path, work: Path, small_database: Path) -> None:
    path = record_scene(chosen_takes("tune", ["fast"], 1)[0], work, 20)
    recording = open_recording(path)
    tracker = WatchedTracker(PoseDatabase.load(small_database))
    solo = Solo(tracker, recording)
    results = [solo.step(frame.depth_mm, frame.timestamp) for frame in recording.stream()]
    won = [i for i, result in enumerate(results) if tracker.source_names[result.source] == "local"]
    assert len(won) > 5
    for i in won:
        assert np.array_equal(tracker.local_joints[i].astype(np.float32), results[i].joints)


def test_the_regressor_is_judged_by_view_with_what_it_knows_of_the_view(
    bundled: Path, work: Path, small_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = ("waist_up", "hidden", "child")
    monkeypatch.setattr(regressor, "takes", lambda split: takes(split)[:2])
    arguments = ["--views", 3, "--database", small_database, "--work", work, "--masked", "--kinds", *kinds]
    run(regressor, "joints", *arguments, monkeypatch=monkeypatch)
    rows = json.loads((bundled / "regressor_tune.json").read_text())["figures"]
    assert [row["view"] for row in rows] == list(kinds)
    assert rows[0]["in_view"] < 0.9 and rows[1]["in_view"] < 1.0 and rows[2]["in_view"] > 0.9
    assert all(0.0 <= row["within_100"] <= row["within_150"] <= 1.0 for row in rows)


def test_calibration_and_ranking_are_those_of_the_textbook() -> None:
    happened = np.arange(100) % 2 == 0
    assert regressor.calibration_error(np.full(100, 0.5), happened) == pytest.approx(0.0)
    assert regressor.calibration_error(np.full(100, 0.9), happened) == pytest.approx(0.4)
    scores = np.array([0.1, 0.4, 0.35, 0.8])
    assert regressor.area_under_roc(scores, np.array([False, False, True, True])) == pytest.approx(0.75)
    assert np.isnan(regressor.area_under_roc(scores, np.ones(4, dtype=bool)))


def test_upper_bodies_are_tracked_and_their_candidates_counted(
    small_database: Path, bundled: Path, work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(upper, "RESULTS", bundled)
    monkeypatch.setitem(upper.ROWS, "hybrid", ("hybrid", {"shape.seconds": 0.1, "sizes": [0.4]}))
    common = ("--takes", 1, "--frames", 3, "--work", work)
    arguments = ("--groups", "cut", "--rows", "lopez2011,hybrid", "--recovery", "--database", small_database)
    run(upper, "track", *arguments, *common, monkeypatch=monkeypatch)
    figures = json.loads((bundled / "upper_tune_part.json").read_text())["figures"]
    assert figures["lopez2011"]["frames"] == 3 and figures["hybrid"]["upper_px"] < 120.0
    run(upper, "candidates", *common, "--stride", 3, monkeypatch=monkeypatch)
    counts = json.loads((bundled / "effectors_tune_part.json").read_text())["figures"]
    assert counts["8 extrema"]["all_three"] >= counts["3 extrema"]["all_three"]


def test_time_by_the_number_of_people_is_told(
    bundled: Path, small_database: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(speed, "SETTLED", 1)
    run(speed, "crowd", small_database, "--people", "1,2", "--frames", 8, monkeypatch=monkeypatch)
    people = json.loads((bundled / "speed_crowd.json").read_text())["figures"]["people"]
    assert list(people) == ["1", "2"] and people["1"]["excess_ms"] == 0.0
    assert people["2"]["excess_ms"] == pytest.approx(people["2"]["median_ms"] - 2 * people["1"]["median_ms"])


def test_of_people_in_a_row_nobody_hides_another() -> None:
    one, two = (speed.row_of_people(n, 2, 1) for n in (1, 2))
    assert (two[one > 0] == one[one > 0]).mean() > 0.99
    assert 0.7 < (two > 0).sum() / 2 / speed.PIXELS < 1.3


def test_the_particle_filters_frames_a_second_are_told(
    bundled: Path, work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_speed_wings, "LEFT_OUT", 1)
    arguments = ("--groups", "cut", "--frames", 3, "--work", work, "--counts", "8", "--columns", "160,80")
    run(speed, "upper", *arguments, monkeypatch=monkeypatch)
    assert json.loads((bundled / "speed_upper_part.json").read_text())["figures"]["8"]["frame_rate"] > 0
    assert "8, 80 wide" in json.loads((bundled / "speed_upper_part.json").read_text())["figures"]


def test_noise_falls_on_what_was_measured_and_on_nothing_else(tmp_path: Path) -> None:
    depth = np.zeros((40, 60, 50), dtype=np.uint16)
    depth[:, 10:40, 10:40] = 2500
    camera = Camera(60.0, 60.0, 25.0, 30.0, 50, 60)
    save_recording(tmp_path / "take.npz", depth=depth, camera=camera, timestamps=np.arange(40) / 30.0)
    assert stabilise.noisy(tmp_path / "take.npz", 0.0) == tmp_path / "take.npz"
    found = np.array([f.depth_mm for f in open_recording(stabilise.noisy(tmp_path / "take.npz", 50.0)).stream()])
    assert not found[depth == 0].any()
    off = found[depth > 0].astype(float) - 2500
    assert abs(off.mean()) < 1.0 and off.std() == pytest.approx(50.0, rel=0.02)


def test_a_tracks_figures_are_those_of_its_frames_and_are_drawn_round_by_round(tmp_path: Path) -> None:
    truth = np.zeros((3, 20, 3))
    found = truth.copy()
    found[1, :, 0], found[2, :, 0] = 0.1, 0.2
    seen, track = np.ones((3, 20), dtype=bool), cast(Track, SimpleNamespace(joints=found))
    figures = dict(zip(stabilise.FIGURES, stabilise.figures_of(track, truth, seen), strict=True))
    assert figures["mean mm"] == pytest.approx(100.0) and figures["largest mm"] == pytest.approx(200.0)
    assert figures["deviation mm"] == pytest.approx(np.std([0.0, 100.0, 200.0]))
    rounds = [np.array([30.0, 90.0]), np.array([20.0, 40.0])]
    stabilise.plot_errors({"kick": rounds, "throw": rounds[:1]}, tmp_path / "frames.png")
    assert (tmp_path / "frames.png").stat().st_size > 5_000


def test_success_within_pixels_is_drawn(tmp_path: Path) -> None:
    upper.plot_success({"hybrid": {"0": 0.0, "10": 0.5, "60": 1.0}}, tmp_path / "success.png")
    assert (tmp_path / "success.png").stat().st_size > 5_000


def test_a_second_phase_goes_on_from_the_solution_by_the_depth_alone(work: Path) -> None:
    few = {
        "swarm.particles": 6,
        "swarm.generations": 4,
        "shape.seconds": 0.0,
        "sizes": [0.4],
        "discrepancy.figure": "balls",
    }
    take = chosen_takes("tune", count=1)[0]
    recording = _takes.prepared(take, "truth", work, 4)
    costs = {}
    for row in ("qammaz", "qammaz two phases"):
        settings = swarm_settings(row, few)
        tracked = swarm.follow(settings, recording, frames=1, kind=swarm.SWARM_KINDS.get(row, SwarmTracker))
        costs[row] = tracked.errors
    assert np.isfinite(costs["qammaz two phases"]).all()
    assert (costs["qammaz"] != costs["qammaz two phases"]).any()


def test_a_benchmark_names_its_parts(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([], ["nothing"], ["--frames"]):
        with pytest.raises(SystemExit):
            run(speed, *arguments, monkeypatch=monkeypatch)
        assert "crowd" in capsys.readouterr().err
