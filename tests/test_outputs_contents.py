"""What files and pages say about tracks, without their makers: report, film of motions, coordinates, JSON, changes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.retrieval_motions import random_motion
from tests.run_helpers import TURN, write_people, write_run
from toolkit.app.stabilise.result_page import APART, SHOWN, largest_changes
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.database.canonical import mirrored
from toolkit.io.errors import UsageError
from toolkit.motion.angles import COLUMNS, joint_angles
from toolkit.motion.opensim_coordinates import coordinates
from toolkit.output.export.angles import marker_set
from toolkit.output.export.document import DECIMALS, export_json
from toolkit.output.export.origin import origin_of
from toolkit.output.rendering import motions
from toolkit.output.report.content import describe_run
from toolkit.tracks import Track
from toolkit.tracks.runs import Person, load_persons

BODY = load_body("neutral")
RATE = 25.0


def poses_of(count: int, seed: int = 0) -> np.ndarray:
    """Poses (count, P) within half of the limits, about 2.5 m before the camera."""
    rng = np.random.default_rng(seed)
    low, high = 0.5 * skeleton.POSE_LIMITS.T
    poses = rng.uniform(np.where(np.isfinite(low), low, 0.0), np.where(np.isfinite(high), high, 0.0), (count, len(low)))
    poses[:, :3] = [0.1, -0.2, -2.5] + rng.normal(scale=0.1, size=(count, 3))
    poses[:, 3:6] = rng.uniform(-0.4, 0.4, (count, 3))
    return poses


# The report.


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two people, the second from the second frame on, whose recording is gone."""
    return write_people(tmp_path_factory.mktemp("report") / "run", poses_of(6))


def test_a_report_says_where_the_joints_are_in_millimetres_and_null_where_no_person_is(people: Path) -> None:
    data, persons = describe_run(people, "a").data, load_persons(people)
    for own, person in zip(data["people"], persons, strict=True):
        for found, joints, there in zip(own["joints"], person.track.joints, person.there, strict=True):
            if there:
                np.testing.assert_allclose(np.reshape(found, (-1, 3)), 1000 * joints @ TURN, atol=0.51)
            else:
                assert found is None
    assert data["people"][1]["joints"][0] is None and data["people"][0]["joints"][0] is not None
    assert len({own["color"] for own in data["people"]}) == 2
    assert data["times"] == pytest.approx(np.arange(6) / RATE, abs=1e-4)


def test_a_report_s_view_looks_at_the_people_from_before_them_and_the_floor_is_under_their_feet(people: Path) -> None:
    data, persons = describe_run(people, "a").data, load_persons(people)
    joints = np.concatenate([person.joints_level[person.there] for person in persons])
    pelvis = joints[:, skeleton.REPORTED.index("pelvis")]
    target = np.array(data["view"]["target"])
    assert (target >= pelvis.min(axis=0) - 1e-3).all() and (target <= pelvis.max(axis=0) + 1e-3).all()
    assert data["view"]["from"][2] > target[2] + 1, "nearer to the camera than they are"
    feet = joints[:, [skeleton.REPORTED.index(f"{side}_foot") for side in ("left", "right")], 1]
    assert feet.min() - 0.06 < data["floor"] < np.median(feet)


def test_stages_of_a_report_are_stacked_over_all_people(tmp_path: Path) -> None:
    run, rng = write_people(tmp_path / "run", poses_of(6)), np.random.default_rng(0)
    spent = rng.uniform(1.0, 9.0, (2, 6, 3)).astype(np.float32)
    for name, own in zip(("person_01", "person_02"), spent, strict=True):
        track = Track.load(run / name)
        replace(track, stage_ms=own, stage_names=("prepare", "fit", "select")).save(run / name)
    plot = next(plot for plot in describe_run(run, "a").data["plots"] if plot["title"].startswith("time"))
    assert [series["name"] for series in plot["series"]] == ["prepare", "fit", "select"]
    for k, series in enumerate(plot["series"]):
        np.testing.assert_allclose(series["low"], spent.sum(axis=0)[:, :k].sum(axis=1), atol=0.011)
        np.testing.assert_allclose(series["values"], spent.sum(axis=0)[:, : k + 1].sum(axis=1), atol=0.011)


def test_confidence_of_a_report_is_that_of_the_mean_and_of_the_least_sure_joint(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", poses_of(4), absent=1)
    track = Track.load(run)
    sure = np.tile(np.linspace(0.2, 0.9, 20, dtype=np.float32), (4, 1))
    replace(track, confidence=sure).save(run)
    (plot,) = (p for p in describe_run(run, "a").data["plots"] if p["title"].startswith("confidence"))
    mean, least = (series["values"] for series in plot["series"])
    assert mean == [None, *[pytest.approx(0.55, abs=1e-3)] * 3] and least == [None, *[pytest.approx(0.2)] * 3]


def test_a_report_says_what_it_leaves_out_and_names_its_blocks_by_its_key(people: Path) -> None:
    content = describe_run(people, "third", frames=range(2, 5))
    assert content.data["note"].startswith("Frames 3 to 5 of 6 are shown. No film, points or errors: ")
    assert content.data["recorded"] == 6 and content.data["first"] == 2 and len(content.data["times"]) == 3
    assert list(content.blocks) == ["third-glb"] and content.data["glb"] == "third-glb"
    assert content.blocks["third-glb"].startswith(b"glTF") and content.data["film"] is None
    facts = dict(content.data["facts"])
    assert facts["frames"] == "6" and facts["database"] == "none" and "person_02: stature" in facts
    assert facts["person_01: frames"].startswith("100.0 % tracked")
    assert content.data["config"] == "no config.yaml beside the track"


# A film of motions.


@pytest.fixture
def pictures(monkeypatch: pytest.MonkeyPatch) -> list[np.ndarray]:
    """What a film would hold."""
    shown: list[np.ndarray] = []

    class Film:
        def __init__(self, path: Path, rate: float) -> None:
            assert rate == motions.RATE

        def write(self, frames: object) -> None:
            shown.extend(frames)  # type: ignore[call-overload]

    monkeypatch.setattr(motions, "FilmWriter", Film)
    return shown


def test_motions_begin_at_once_and_those_that_end_first_wait(pictures: list[np.ndarray], tmp_path: Path) -> None:
    longer, shorter = random_motion(1, seconds=0.6), random_motion(2, seconds=0.3)
    motions.film_of_motions(tmp_path / "hits.webm", [("long", longer), ("short", shorter)])
    assert len(pictures) == len(longer.at_rate(motions.RATE)) + motions.HOLD
    last = len(shorter.at_rate(motions.RATE)) - 1
    width = motions.PANEL[0]
    left, right = (np.array([picture[:, side] for picture in pictures]) for side in (slice(width), slice(-width, None)))
    assert (right[last] != right[last - 1]).any() and (right[last:] == right[last]).all()
    assert (left[last] != left[last + 1]).any() and (left[-motions.HOLD :] == left[-1]).all()


def test_a_motion_is_drawn_on_its_feet_in_the_middle_wherever_it_goes(
    pictures: list[np.ndarray], tmp_path: Path
) -> None:
    """Turned and moved over the ground it is the same film."""
    motion = random_motion(3, seconds=0.2)
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    moved = replace(motion, joints=motion.joints @ turn.T + [3.0, 0.0, -1.0])
    for each in (motion, moved):
        motions.film_of_motions(tmp_path / "hits.webm", [("one", each)])
    first, again = np.split(np.array(pictures, dtype=int), 2)
    assert (np.abs(first - again).max(axis=3) > 40).mean() < 0.002, "but for rounding"
    drawn = (first[0] != first[0, 150, 2]).any(axis=2)
    drawn[:40] = False  # the title
    columns = np.flatnonzero(drawn[100:250].any(axis=0))
    assert columns.min() > 20 and columns.max() < motions.PANEL[0] - 20


# Coordinates of OpenSim's model, and JSON.


def person_of(run: Path) -> Person:
    return load_persons(run)[0]


TURNED = {"pelvis_list", "pelvis_rotation", "pelvis_tz", "lumbar_bending", "lumbar_rotation"}
"""Coordinates whose sign is the other one in a mirror."""


def test_coordinates_in_a_mirror_are_those_of_the_other_side(tmp_path: Path) -> None:
    poses, rows = poses_of(20), np.arange(20)
    own, other = (
        coordinates(person_of(write_run(tmp_path / name, each, shape=0.0)), rows)
        for name, each in (("own", poses), ("other", mirrored(poses)))
    )
    for name, values in own.items():
        swapped = {"_r": "_l", "_l": "_r"}.get(name[-2:])
        partner = name if swapped is None else name[:-2] + swapped
        np.testing.assert_allclose(other[partner], (-1 if name in TURNED else 1) * values, atol=1e-6, err_msg=name)
    assert TURNED < set(own) and np.std([own[name] for name in TURNED], axis=1).min() > 0.01


@pytest.mark.parametrize(
    ("name", "angle", "sign"),
    [
        ("knee_angle_r", "right_knee_flexion_ZXY_deg", 1),
        ("hip_flexion_l", "left_hip_flexion_ZXY_deg", 1),
        ("hip_adduction_r", "right_hip_adduction_ZXY_deg", 1),
        ("elbow_flex_l", "left_elbow_flexion_ZXY_deg", 1),
        ("ankle_angle_l", "left_ankle_dorsiflexion_ZXY_deg", 1),
        ("pelvis_tilt", "pelvis_backward_tilt_ZXY_deg", 1),
        ("lumbar_extension", "trunk_flexion_ZXY_deg", -1),
        ("lumbar_bending", "trunk_lateral_bending_right_ZXY_deg", 1),
    ],
)
def test_coordinates_with_an_isb_angle_of_their_own_are_that_angle(
    name: str, angle: str, sign: int, tmp_path: Path
) -> None:
    person = person_of(write_run(tmp_path / "run", poses_of(12), shape=0.0))
    found = joint_angles(person.body, person.track.pose, person.there).degrees[:, COLUMNS.index(angle)]
    np.testing.assert_allclose(coordinates(person, np.arange(12))[name], sign * found, atol=1e-6)
    assert found.std() > 1.0


def test_every_reported_joint_is_a_marker_and_left_ones_lie_to_the_left() -> None:
    lines = marker_set().splitlines()
    places = {
        line.split('"')[1]: [float(v) for v in lines[k + 2].split(">")[1].split("<")[0].split()]
        for k, line in enumerate(lines)
        if "<Marker name" in line
    }
    assert list(places) == list(skeleton.REPORTED)
    for name, (x, y, z) in places.items():
        if name.startswith("left_"):
            assert places[name.replace("left", "right")] == [x, y, -z]
    assert places["left_hip"][2] < 0 and places["left_shoulder"][2] < 0, "the model's z leads to the right"


def test_json_says_what_the_track_says_and_null_where_no_person_is(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", poses_of(5), absent=2)
    person = person_of(run)
    export_json(tmp_path / "track.json", [person], origin_of([person], "camera"))
    document = json.loads((tmp_path / "track.json").read_text())
    (own,) = document["people"]
    assert own["state"] == ["empty", "empty", "tracked", "tracked", "tracked"]
    for name in ("joints", "pose", "confidence", "observed", "contact"):
        assert own[name][:2] == [None, None]
        np.testing.assert_allclose(own[name][2:], getattr(person.track, name)[2:], atol=0.6 * 10.0**-DECIMALS)
    assert own["source"] == ["local"] * 5 and own["timestamps"] == person.track.timestamps.tolist()
    assert document["joint_names"] == list(skeleton.REPORTED) and document["units"]["length"] == "m"


# Changes by stabilising.


def moved_by(metres: dict[int, float]) -> list[int]:
    before, after = (np.zeros((100, 20, 3), np.float32) for _ in range(2))
    for frame, far in metres.items():
        after[frame, 7] = [far, 0.0, 0.0]
    still, sure = np.zeros((100, skeleton.POSE_SIZE)), np.ones((100, 20), np.float32)
    state, times, spent = np.zeros(100, np.uint8), np.arange(100.0), np.zeros((100, 1), np.float32)
    before_and_after = (
        Track(joints, still, sure, state, state, times, spent, sure > 0, ("local",), ("fit",))
        for joints in (before, after)
    )
    return largest_changes(*before_and_after)


def test_the_largest_changes_are_shown_apart_from_each_other_and_no_more_than_there_are() -> None:
    assert moved_by({}) == [] and moved_by({4: 0.1}) == [4]
    assert moved_by({10: 0.3, 10 + APART - 1: 0.2, 10 + APART: 0.1}) == [10, 10 + APART]
    assert moved_by({k: 0.01 * k for k in range(5, 100, 30)}) == [95, 65, 35] and SHOWN == 3


def test_a_film_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is no film"):
        motions.film_of_motions(tmp_path / "hits.txt", [("one", random_motion(1, seconds=0.2))])
