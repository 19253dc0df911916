"""Angles, strides, contacts and rises of motions with exact truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.feet import sliding_mm
from tests.poses import pose_at
from tests.run_helpers import write_run
from tests.support.plain_gait import planned_walk, walk_on_ground
from tests.support.walking import Rising, Walk, rising, walking
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.body.sole import soles
from toolkit.motion.angles import joint_angles, sequence_angles
from toolkit.motion.contact import contacts_of_soles, ground_height
from toolkit.motion.gait import walk_of
from toolkit.motion.resting import at_rest
from toolkit.motion.rising import rises_of
from toolkit.tracks.runs import load_persons

BODY = load_body("neutral")
RATE = 30.0


def posed(**angles: float) -> np.ndarray:
    return pose_at(**{name: np.radians(degrees) for name, degrees in angles.items()})[None]


def angle(name: str, pose: np.ndarray) -> float:
    return float(joint_angles(BODY, pose, np.ones(len(pose), dtype=bool)).of(name)[0])


@pytest.mark.parametrize(
    ("pose", "name", "degrees"),
    [
        ({"left_hip_rx": -40}, "left_hip_flexion", 40),  # the thigh comes forwards
        ({"right_hip_rx": -40}, "right_hip_flexion", 40),
        ({"left_hip_rz": 20}, "left_hip_adduction", -20),  # the left thigh goes to the left
        ({"right_hip_rz": -20}, "right_hip_adduction", -20),
        ({"left_hip_ry": -15}, "left_hip_internal_rotation", 15),  # the left toes go to the right
        ({"right_hip_ry": 15}, "right_hip_internal_rotation", 15),
        ({"left_knee_rx": 70}, "left_knee_flexion", 70),
        ({"right_ankle_rx": -12}, "right_ankle_dorsiflexion", 12),
        ({"left_elbow_ry": -80}, "left_elbow_flexion", 80),
        ({"right_elbow_ry": 80}, "right_elbow_flexion", 80),
        ({}, "left_shoulder_elevation", 90),  # a T-pose
        ({}, "right_shoulder_elevation", 90),
        ({}, "right_shoulder_plane_of_elevation", 0),  # in the plane of abduction
        ({"left_shoulder_ry": -90}, "left_shoulder_plane_of_elevation", 90),  # arms held forwards
        ({"right_shoulder_ry": 90}, "right_shoulder_plane_of_elevation", 90),
        ({"lumbar_rx": 20, "thorax_rx": 10}, "trunk_flexion", 30),
        ({"lumbar_rz": 20}, "trunk_lateral_bending_right", 20),
        ({"lumbar_ry": 25}, "trunk_rotation_left", 25),
    ],
)
def test_a_movement_has_the_name_and_the_sign_of_the_isb(pose: dict[str, float], name: str, degrees: float) -> None:
    assert angle(name, posed(**pose)) == pytest.approx(degrees, abs=1e-6)


@pytest.mark.parametrize("sequence", ["ZXY", "YXY"])
def test_the_angles_make_the_rotation_again(sequence: str) -> None:
    rotations = Rotation.random(200, random_state=1).as_matrix()
    for single in rotations:
        angles, locked = sequence_angles(single[None], sequence, np.array([True]))
        if not locked[0]:
            again = Rotation.from_euler(sequence, angles[0]).as_matrix()
            np.testing.assert_allclose(again, single, atol=1e-9)


def test_angles_are_continuous_and_marked_through_gimbal_lock() -> None:
    steps = np.linspace(-60.0, 60.0, 121)
    turned = Rotation.from_euler("YXY", np.column_stack([np.full(121, 30.0), -np.abs(steps), np.full(121, 10.0)]), True)
    angles, locked = sequence_angles(turned.as_matrix(), "YXY", np.ones(121, dtype=bool))
    assert locked[60] and not locked[0] and locked.sum() == 15
    assert np.abs(np.diff(np.degrees(angles), axis=0)).max() < 3.0
    np.testing.assert_allclose(np.degrees(angles[[0, -1]]), [[30, -60, 10], [30, -60, 10]], atol=1e-6)


@pytest.mark.parametrize("walk", [Walk(), Walk(0.8, 90.0, 0.2, 0.66), Walk(1.4, 120.0, 0.08, 0.6)])
def test_the_strides_of_a_made_walk_are_found(walk: Walk) -> None:
    poses, _ = walking(BODY, walk, 5.0, RATE)
    found = walk_of(BODY, poses, np.arange(len(poses)) / RATE, np.ones(len(poses), dtype=bool))
    assert len(found.strides) >= 4
    assert found.mean("length") == pytest.approx(walk.stride_length, abs=0.02)
    assert found.cadence == pytest.approx(walk.cadence, abs=1.5)
    assert found.speed == pytest.approx(walk.speed, abs=0.03)
    assert found.mean("width") == pytest.approx(walk.width, abs=0.015)
    assert found.mean("stance") == pytest.approx(walk.stance, abs=0.05)


@pytest.mark.parametrize("walk", [Walk(), Walk(0.8, 90.0, 0.2, 0.66), Walk(1.4, 120.0, 0.08, 0.6)])
def test_what_is_known_of_a_walk_by_where_feet_stay_is_its_plan(walk: Walk) -> None:
    known, plan = walk_on_ground(BODY, walking(BODY, walk, 5.0, RATE)[0], RATE), planned_walk(walk)
    for name, off in {"stride_length_m": 0.01, "stride_time_s": 0.01, "cadence_steps_per_min": 1.0,
                      "speed_m_per_s": 0.01, "step_width_m": 0.01}.items():  # fmt: skip
        assert known[name] == pytest.approx(plan[name], abs=off), name


def test_no_strides_in_a_short_walk_or_while_standing() -> None:
    poses, _ = walking(BODY, Walk(), 0.9, RATE)
    for rows, note in (
        (poses, "no whole stride was walked"),
        (np.repeat(poses[:1], 40, axis=0), "the person does not walk"),
        *((poses[:count], "too short for a stride") for count in (1, 2, 12, 18)),
    ):
        found = walk_of(BODY, rows, np.arange(len(rows)) / RATE, np.ones(len(rows), dtype=bool))
        assert not found.strides and note == found.note
        assert all(np.isnan(v) for k, v in found.figures().items() if k not in ("strides", "walking_s"))
    nobody = walk_of(BODY, poses, np.arange(len(poses)) / RATE, np.zeros(len(poses), dtype=bool))
    assert not nobody.strides and nobody.note == "the person does not walk"


def test_no_stride_spans_an_absence() -> None:
    poses, _ = walking(BODY, Walk(), 6.0, RATE)
    known = np.ones(len(poses), dtype=bool)
    known[80:100] = False
    poses[~known] = 0.0
    found = walk_of(BODY, poses, np.arange(len(poses)) / RATE, known)
    assert any(s.end < 80 / RATE for s in found.strides) and any(s.start > 100 / RATE for s in found.strides)
    assert all(s.end < 80 / RATE or s.start > 99 / RATE for s in found.strides)
    assert found.walking < 5.4 and found.mean("length") == pytest.approx(Walk().stride_length, abs=0.02)


def test_stance_feet_are_separated_from_swinging_feet() -> None:
    poses, truth = walking(BODY, Walk(), 4.0, RATE)
    placed, times = soles(BODY, poses), np.arange(len(poses)) / RATE
    everywhere = np.ones(len(poses), dtype=bool)
    ground = ground_height(placed, times, everywhere)
    assert ground == pytest.approx(0.0, abs=0.01)
    found = contacts_of_soles(placed, times, ground or 0.0, everywhere)
    assert (found == truth).mean() > 0.93


def test_feet_that_slid_are_held_where_they_rest_and_the_rest_of_the_body_stays(tmp_path: Path) -> None:
    true, contact = walking(BODY, Walk(), 3.0, RATE)
    rng, noisy = np.random.default_rng(0), true.copy()
    noisy[:, 3:] += rng.normal(scale=0.015, size=noisy[:, 3:].shape)
    person = load_persons(write_run(tmp_path / "run", noisy, shape=0.0, rate=RATE))[0]
    person = replace(person, body=BODY, track=replace(person.track, contact=contact))
    held = at_rest(person)
    slides = [np.mean(sliding_mm(soles(BODY, found.track.pose), contact)) for found in (person, held)]
    assert slides[1] < 0.4 * slides[0]
    legs = [i for i, name in enumerate(skeleton.POSE_NAMES) if "hip" in name or "knee" in name or "ankle" in name]
    rest = np.setdiff1d(np.arange(skeleton.POSE_SIZE), legs)
    np.testing.assert_allclose(held.track.pose[:, rest], noisy[:, rest], atol=0.02)  # a walking person is not still
    truth = BODY.joint_positions(true)
    feet = [skeleton.REPORTED.index(name) for name in ("left_foot", "right_foot")]
    off = [np.linalg.norm(BODY.joint_positions(p) - truth, axis=2)[:, feet].mean() for p in (noisy, held.track.pose)]
    assert off[1] < off[0]


def test_a_standing_person_is_steadied_and_a_walking_one_unchanged(tmp_path: Path) -> None:
    still = np.repeat(rising(BODY, Rising(count=0, stand=2.0), RATE)[:1], 60, axis=0)
    walk = walking(BODY, Walk(), 2.0, RATE)[0]
    rng, off = np.random.default_rng(0), {}
    for name, true in (("still", still), ("walk", walk)):
        noisy = true.copy()
        noisy[:, 6:] += rng.normal(scale=0.006, size=noisy[:, 6:].shape)
        person = load_persons(write_run(tmp_path / name, noisy, shape=0.0, rate=RATE))[0]
        rested = at_rest(replace(person, body=BODY)).track.pose
        truth = BODY.joint_positions(true)
        off[name] = [np.linalg.norm(BODY.joint_positions(p) - truth, axis=2).mean() for p in (noisy, rested)]
    assert off["still"][1] < 0.5 * off["still"][0]
    assert off["walk"][1] < 1.02 * off["walk"][0]


@pytest.mark.parametrize(("rest", "seated"), [(1.0, True), (0.0, False)])
def test_rises_are_counted_and_timed(rest: float, seated: bool) -> None:
    plan = Rising(count=3, duration=1.2, rest=rest)
    poses = rising(BODY, plan, RATE)
    found = rises_of(BODY, poses, np.arange(len(poses)) / RATE, np.ones(len(poses), dtype=bool))
    assert [rise.seated for rise in found] == [seated] * 3
    expected = plan.duration * (1.0 - 2.0 * np.arccos(1.0 - 2.0 * 0.05) / np.pi)
    for rise in found:
        assert rise.duration == pytest.approx(expected, abs=0.08)
