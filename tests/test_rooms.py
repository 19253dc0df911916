"""Scores of real rooms against the annotations in the repository."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from benchmarks import _room_scores
from benchmarks import rooms as bench
from toolkit.body import skeleton


def told_track(truth: dict[str, Any], aside: float = 0.0) -> dict[str, Any]:
    """The first person of every frame that has one, all joints at the head, `aside` metres to the right of it."""
    fx, fy, cx, cy = truth["intrinsics"]
    frames = {}
    for key, entry in truth["frames"].items():
        heads = [(p["joints"]["head"], p["depth"]["head"]) for p in entry["people"] if "joints" in p]
        if heads:
            (u, v), z = heads[0]
            point = [(u - cx) / fx * z + aside, (v - cy) / fy * z, z]
            frames[int(key)] = np.tile(point, (len(skeleton.REPORTED), 1))
    return {"name": "person_01", "stature": 1.75, "names": list(skeleton.REPORTED), "frames": frames}


def perfect_tracks(
    truth: dict[str, Any], shift: float = 0.0, stature: float = 1.75, number: Callable[[int, int], int] = lambda i, f: i
) -> list[dict[str, Any]]:
    """Return tracks on the annotated joints, `shift` metres to the right; `number(id, frame)` names them."""
    fx, fy, cx, cy = truth["intrinsics"]
    names = list(skeleton.REPORTED)
    tracks: dict[int, dict[str, Any]] = {}
    for key, entry in truth["frames"].items():
        for person in (person for person in entry["people"] if "joints" in person):
            own = number(person["id"], int(key))
            track = tracks.setdefault(own, {"name": f"p{own}", "stature": stature, "names": names, "frames": {}})
            points = {
                joint: np.array([(u - cx) / fx * z, (v - cy) / fy * z, z])
                for (joint, (u, v)), z in zip(person["joints"].items(), person["depth"].values(), strict=True)
            }
            joints = np.tile(points["head"] + [0.0, 0.4, 0.0], (len(names), 1))
            points |= {"neck": points["head"] + [0.0, 0.2, 0.0], "pelvis": points["head"] + [0.0, 0.75, 0.0]}
            for joint, point in points.items():
                joints[names.index(joint)] = point
            track["frames"][int(key)] = joints + [shift, 0.0, 0.0]
    return list(tracks.values())


@pytest.mark.parametrize("name", ["filinha", "um", "lab2_cam1", "lab2_cam2"])
def test_annotated_joints_score_as_perfect_and_no_track_as_all_missed(name: str) -> None:
    truth = bench.annotations_of(name)
    people = [p for frame in truth["frames"].values() for p in frame["people"] if "joints" in p]
    optional = sum(bool(person.get("edge")) for person in people)
    required = len(people) - optional
    counts = _room_scores.score(truth, perfect_tracks(truth))
    assert counts["heads"] == [required, required] and counts["optional"] == [optional, optional]
    assert sum(counts["false"].values()) == counts["switches"] == counts["handed"] == 0
    assert all(within == count for _, within, _, _, count in counts["joints"].values())
    shifted = _room_scores.score(truth, perfect_tracks(truth, shift=0.12))
    assert shifted["heads"][0] == required
    assert all(near <= 0.3 * count + 1 and far == count for near, far, _, _, count in shifted["joints"].values())
    assert _room_scores.score(truth, [])["heads"] == [0, required]
    assert _room_scores.score(truth, perfect_tracks(truth, stature=1.1))["stature"][0] == 0


def test_two_people_who_exchange_their_tracks_are_two_switches() -> None:
    truth = bench.annotations_of("filinha")
    tracks = perfect_tracks(truth, number=lambda i, frame: {1: 2, 2: 1}.get(i, i) if frame >= 48 else i)
    counts = _room_scores.score(truth, tracks)
    assert counts["switches"] == 2 and counts["handed"] == 2


def test_a_second_track_of_a_person_is_false_on_a_person() -> None:
    truth = bench.annotations_of("filinha")
    tracks = perfect_tracks(truth)
    counts = _room_scores.score(truth, [*tracks, tracks[0] | {"name": "copy"}])
    assert counts["false"]["person"] > 0 and counts["false"]["furniture"] == counts["false"]["elsewhere"] == 0


def test_counts_of_the_frames_add_up_to_those_of_the_sequence_and_misses_are_told() -> None:
    truth = bench.annotations_of("um")
    found = bench.scored(truth, [told_track(truth)])
    heads = found["counts"]["heads"]
    assert heads[0] > 0
    assert heads == np.sum([frame["heads"] for frame in found["frames"].values()], axis=0).tolist()
    events = [event for frame in found["frames"].values() for event in frame["events"]]
    missed = [event for event in events if event.startswith("missed") and "optional" not in event]
    assert len(missed) == heads[1] - heads[0]


def test_a_track_three_metres_beside_everybody_finds_no_head() -> None:
    truth = bench.annotations_of("filinha")
    found = bench.scored(truth, [told_track(truth, aside=3.0)])
    assert found["counts"]["heads"][0] == 0
    assert sum(found["counts"]["false"].values()) > 0
