"""Scenes as they are listed: who and what is told where, and what all of a suite share."""

from __future__ import annotations

import pytest
import yaml

from tests.support import casting
from tests.support.casting import Actor, Scene, listed
from toolkit.simulation.furniture import Box


@pytest.fixture
def listing(monkeypatch: pytest.MonkeyPatch) -> None:
    entries = [
        {"clip": "wave", "body": "child", "at": [0, 1.5], "distance": 2.0, "boxes": [[[0, 0, 0], [1, 2, 3]]]},
        {"sensor": "kinect", "actors": [{"clip": "a", "body": "b"}, {"clip": "c", "body": "d", "holds": "box"}]},
    ]
    suites = {
        "made": {"defaults": {"sensor": "tof", "distance": 3.0}, "tune": {"waist": entries, "empty": [{"actors": []}]}}
    }
    monkeypatch.setattr(casting, "_suites", lambda: suites)


def test_one_person_is_told_beside_the_scene_and_several_are_actors(listing: None) -> None:
    alone, together, _ = listed("made", "tune")
    wave = Actor("wave", "child", at=(0, 1.5))
    assert alone == Scene("waist", (wave,), "tof", 2.0, boxes=(Box((0, 0, 0), (1, 2, 3)),)) and alone.actor == wave
    assert together.actors == (Actor("a", "b"), Actor("c", "d", holds="box"))


def test_what_a_suite_shares_holds_unless_the_scene_says_otherwise(listing: None) -> None:
    alone, together, _ = listed("made", "tune")
    assert (alone.sensor, alone.distance) == ("tof", 2.0)
    assert (together.sensor, together.distance) == ("kinect", 3.0)


def test_a_scene_is_called_by_who_is_in_it_or_by_its_seed(listing: None) -> None:
    alone, together, _ = listed("made", "tune")
    assert alone.name == "waist_wave_child_tof" and together.name == "waist_000_cut"


@pytest.mark.parametrize("suite", ["clean", "recorded", "rooms", "upper"])
def test_every_suite_has_two_splits_of_the_same_groups_and_as_many_scenes_in_each(suite: str) -> None:
    tune, report = (listed(suite, split) for split in ("tune", "report"))
    assert [scene.group for scene in tune] == [scene.group for scene in report]
    own = yaml.safe_load(casting.FILE.read_text(encoding="utf-8"))[suite]
    entries = [entry for split in ("tune", "report") for group in own[split].values() for entry in group]
    actors = [actor for entry in entries for actor in entry.get("actors", [entry])]
    assert all({"clip", "body"} <= set(actor) for actor in actors), "no actor is neutral by oversight"
