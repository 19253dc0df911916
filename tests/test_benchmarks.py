"""Each benchmark starts; the evaluation splits share no person; the scores of real rooms fit the annotations."""

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks import rooms as rooms_benchmark
from benchmarks._keyframe_corpus import Truth, load_all
from benchmarks.keyframes import MANUAL
from benchmarks.rooms import RoomScorer, RoomTrack
from tests.support import suite
from tests.support.casting import listed
from tests.support.scenes import scenes
from tests.support.suite import takes
from toolkit.app.cli.bench import benchmarks
from toolkit.body import skeleton
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.relational import FeatureMatrix
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import load_queries
from toolkit.retrieval.search.find import HitRanges, find


@pytest.mark.parametrize("name", sorted(benchmarks()))
def test_a_benchmark_prints_its_help(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["bench", "--help"])
    with pytest.raises(SystemExit) as end:
        importlib.import_module(f"benchmarks.{name}").main()
    assert end.value.code == 0 and "usage" in capsys.readouterr().out


@pytest.mark.quick
@pytest.mark.parametrize("name", ["clean", "recorded"])
def test_the_splits_share_no_actor(name: str) -> None:
    splits = [listed(name, split) for split in ("tune", "report")]
    actors = [{actor.clip.split("_")[0] for scene in split for actor in scene.actors} for split in splits]
    assert actors == [{"bk"}, {"dg", "02", "49"}]


@pytest.mark.data("cmu-mocap", "hdm05")
def test_the_database_holds_no_actor_of_a_split(data_folder: Path) -> None:
    names = [path.stem for path in suite.database_sources() or []]
    assert names and not any(name.startswith(("02_", "49_", "HDM_bk", "HDM_dg")) for name in names)


@pytest.mark.data("cmu-mocap", "hdm05")
def test_every_motion_of_the_suites_exists(data_folder: Path) -> None:
    for scene in takes("tune") + takes("report") + scenes("tune") + scenes("report"):
        for actor in scene.actors:
            assert len(suite.motion_files(actor.clip)) == 1, actor.clip


def perfect_tracks(truth: dict[str, Any], shift: float = 0.0) -> list[RoomTrack]:
    """Return one track for each annotated person, with the annotated joints `shift` metres to the right."""
    fx, fy, cx, cy = truth["intrinsics"]
    names = list(skeleton.REPORTED)
    tracks: dict[int, RoomTrack] = {}
    for key, entry in truth["frames"].items():
        for person in (person for person in entry["people"] if "joints" in person):
            number = person["id"]
            track = tracks.setdefault(number, RoomTrack(f"p{number}", 1.75, {}))
            points = {
                joint: np.array([(u - cx) / fx * z, (v - cy) / fy * z, z])
                for (joint, (u, v)), z in zip(person["joints"].items(), person["depth"].values(), strict=True)
            }
            joints = np.tile(points["head"] + [0.0, 0.4, 0.0], (len(names), 1))
            points |= {"neck": points["head"] + [0.0, 0.2, 0.0], "pelvis": points["head"] + [0.0, 0.75, 0.0]}
            for joint, point in points.items():
                joints[names.index(joint)] = point
            track.frames[int(key)] = joints + [shift, 0.0, 0.0]
    return list(tracks.values())


def heads(counts: dict[str, Any]) -> list[int]:
    """Return the numbers of found and of annotated heads."""
    return np.sum([counts[kind] for kind in ("clear", "occluded", "small")], axis=0).tolist()


@pytest.mark.parametrize("name", ["filinha", "lab2_cam1"])
def test_annotated_joints_get_the_full_score_and_no_track_misses_everything(name: str) -> None:
    truth = rooms_benchmark.annotations_of(name)
    people = [p for frame in truth["frames"].values() for p in frame["people"] if "joints" in p]
    required = sum(not person.get("edge") for person in people)
    counts = RoomScorer(truth).score(perfect_tracks(truth))
    assert heads(counts) == [required, required]
    assert sum(counts["false"].values()) == counts["switches"] == counts["handed"] == 0
    assert all(within == count for within, _, count in counts["joints"].values())
    assert heads(RoomScorer(truth).score([])) == [0, required]
    beside = RoomScorer(truth).score(perfect_tracks(truth, shift=3.0))
    assert heads(beside)[0] == 0 and sum(beside["false"].values()) > 0


@pytest.mark.data("cmu-mocap", "hdm05")
def test_hand_written_keyframes_find_the_clips_that_they_were_written_for(data_folder: Path) -> None:
    clips = [example for example in load_all(data_folder) if example.person == "bd"]
    queries = {query.label: query for query in load_queries(MANUAL)}
    assert len(queries) == 15 and set(queries) == {clip.label for clip in clips}
    index = KeyframeIndex.build([clip.features for clip in clips])
    found = {(label, int(number)) for label, query in queries.items() for number in find(index, query).documents}
    right = [(clip.label, number) in found for number, clip in enumerate(clips)]
    wrong = [(label, number) in found for label in queries for number, c in enumerate(clips) if c.label != label]
    assert np.mean(right) > 0.9 and np.mean(wrong) < 0.05


@pytest.mark.quick
def test_a_hit_is_right_where_it_overlaps_a_motion_of_the_class() -> None:
    features = FeatureMatrix("document", np.zeros((40, 100), dtype=bool))
    segments = [Segment(1 / 3, 1.0, "kick"), Segment(5 / 3, 7 / 3, "squat"), Segment(8 / 3, 3.0, "kick")]
    document: Any = SimpleNamespace(features=features, segments=segments)
    truth = Truth([document], "kick")
    found = HitRanges(np.zeros(3, int), np.array([25, 40, 60]), np.array([35, 45, 80]))
    assert truth.relevant == pytest.approx(0.3) and truth.precision(found) == pytest.approx(1 / 3)
    assert truth.quality([found]) == pytest.approx((0.35, 0.5, 0.0))
