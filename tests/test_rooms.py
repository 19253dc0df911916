"""The benchmark of real rooms: the script beside the annotations is asked in place, frame by frame."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from benchmarks import rooms as bench
from toolkit import skeleton

pytestmark = pytest.mark.shared_data


def annotated(name: str) -> dict[str, Any]:
    return json.loads((bench.ROOMS / "annotations" / f"{name}.json").read_text(encoding="utf-8"))  # type: ignore[no-any-return]


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


def test_counts_of_the_frames_add_up_to_those_of_the_sequence_and_misses_are_told() -> None:
    truth, score = annotated("um"), bench.scorer(bench.ROOMS)
    found = bench.scored(score, truth, [told_track(truth)])
    heads = found["counts"]["heads"]
    assert heads[0] > 0
    assert heads == np.sum([frame["heads"] for frame in found["frames"].values()], axis=0).tolist()
    events = [event for frame in found["frames"].values() for event in frame["events"]]
    missed = [event for event in events if event.startswith("missed") and "optional" not in event]
    assert len(missed) == heads[1] - heads[0]


def test_a_track_three_metres_beside_everybody_finds_no_head() -> None:
    truth, score = annotated("filinha"), bench.scorer(bench.ROOMS)
    found = bench.scored(score, truth, [told_track(truth, aside=3.0)])
    assert found["counts"]["heads"][0] == 0
    assert sum(found["counts"]["false"].values()) > 0
