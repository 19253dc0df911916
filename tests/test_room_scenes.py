"""Scenes in furnished rooms: people who enter, meet and carry, and their recordings."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support import acts, suite
from tests.support.scenes import ROOM_GROUPS, chosen_scenes, record_scene, scenes
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.errors import UsageError
from toolkit.mocap.clip import PoseClip
from toolkit.recordings.opening import open_recording
from toolkit.simulation.holding import HOLDINGS, held_mesh
from toolkit.simulation.interiors.room import named_room
from toolkit.simulation.person import SimulatedPerson, facing_of
from toolkit.simulation.simulate import CaptureSettings, prepare

SIZES = {"enter": 4, "carry": 4, "together": 3, "crowd": 3, "rooms": 6, "stills": 6, "vacant": 10}
LEFT, RIGHT = (skeleton.REPORTED.index(f"{side}_hand") for side in ("left", "right"))


@pytest.fixture
def bundled(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Return a work folder of the suite of bundled motions."""
    monkeypatch.setattr(suite, "MOCAP", tmp_path / "absent")
    return tmp_path


def standing(frames: int) -> np.ndarray:
    """Return poses (T, P) of a person who stands at the origin with the arms out."""
    poses = np.zeros((frames, skeleton.POSE_SIZE))
    poses[:, 1] = 0.9
    return poses


def test_the_splits_have_the_same_groups_and_share_neither_rooms_nor_bodies() -> None:
    found = [scenes(split, ROOM_GROUPS) for split in ("tune", "report")]
    for split in found:
        assert Counter(scene.group for scene in split) == SIZES
        assert all(scene.room and named_room(scene.room) and scene.view == "room" for scene in split)
        assert max(scene.frames for scene in split if scene.actors) <= 120
        assert {len(scene.actors) for scene in split if scene.group == "crowd"} == {4, 5, 6}
        assert {scene.frames for scene in split if not scene.actors} == {300}
    assert len({scene.room for split in found for scene in split}) == 72
    bodies = [{actor.body for scene in split for actor in scene.actors} for split in found]
    assert not bodies[0] & bodies[1]


@pytest.mark.parametrize("kind", acts.PATHS)
def test_who_comes_is_out_of_sight_first_and_faces_where_they_go(kind: str) -> None:
    far = acts.out_of_sight(-1.0, 0.2, 2.8, 0.56)
    assert far[0] < -0.56 * 2.6 - 0.6
    places, yaws = acts.path_of(kind, (0.3, 0.2), far, 90)
    poses = acts.travelled(standing(90), places, yaws)
    assert poses[0, [0, 2]] == pytest.approx(far)
    assert facing_of(poses[5]) == pytest.approx(np.pi / 2, abs=0.05)
    last = {"crosses": -far[0], "comes": 0.3, "visits": far[0]}[kind]
    assert poses[-1, 0] == pytest.approx(last)
    if kind != "crosses":
        assert poses[45, 0] == pytest.approx(0.3) and facing_of(poses[45]) == pytest.approx(0.0, abs=0.3)


@pytest.mark.parametrize("kind", ["hug", "give"])
def test_two_who_meet_come_near_face_each_other_and_part(kind: str) -> None:
    body = load_body("neutral")
    two = [acts.meeting(kind, side, (0.1, -0.2), standing(61)) for side in (-1.0, 1.0)]
    gap = two[1][:, 0] - two[0][:, 0]
    assert (
        gap[30] == pytest.approx({"hug": acts.EMBRACED, "give": acts.WITHIN_REACH}[kind]) and gap[0] > gap[30] < gap[-1]
    )
    assert facing_of(two[0][30]) == pytest.approx(np.pi / 2) and facing_of(two[1][30]) == pytest.approx(-np.pi / 2)
    hands = [body.joint_positions(poses[30])[[LEFT, RIGHT]] for poses in two]
    assert (hands[0][:, 0] > two[0][30, 0] + 0.2).all() and (hands[1][:, 0] < two[1][30, 0] - 0.2).all()


@pytest.mark.parametrize("kind", HOLDINGS)
def test_a_held_object_is_in_the_hands_and_belongs_to_no_person(kind: str) -> None:
    body = load_body("neutral")
    poses = acts.with_arms(standing(3), kind)
    joints = body.joint_positions(poses[0])
    thing = held_mesh(kind, joints)
    middle = 0.5 * (joints[LEFT] + joints[RIGHT]) if kind != "bag" else joints[LEFT] - [0.0, 0.3, 0.0]
    assert np.linalg.norm(thing.vertices.mean(axis=0) - middle) < 0.12
    clip = PoseClip("holds", poses, 30.0, "")
    frames = [
        next(iter(prepare([SimulatedPerson(clip, body, holds=holds)], CaptureSettings(sensor="kinect")).frames()))
        for holds in (None, kind)
    ]
    changed = np.abs(frames[1].depth.astype(int) - frames[0].depth) > 150
    assert changed.sum() > 40 and (frames[1].person[changed] == -1).mean() > 0.8
    late = SimulatedPerson(clip, body, holds=kind, held=(1.0, 2.0))
    assert prepare([late], CaptureSettings()).performers[0].held_thing(0) is None


def test_an_object_that_cannot_be_held_is_rejected() -> None:
    with pytest.raises(UsageError, match="no person can hold 'piano'; use one of box, tablet, bag"):
        prepare([SimulatedPerson(PoseClip("x", standing(2), 30.0, ""), load_body("neutral"), holds="piano")])


def test_scenes_of_rooms_are_recorded_as_they_say(bundled: Path) -> None:
    still = chosen_scenes("tune", ("stills",), 1)[0]
    assert len(open_recording(record_scene(still, bundled))) == 1
    vacant = replace(chosen_scenes("tune", ("vacant",), 1)[0], frames=2)
    recording = open_recording(record_scene(vacant, bundled))
    assert len(recording) == 2 and recording.joints is not None and recording.joints.shape[0] == 0
    hug = replace(next(s for s in chosen_scenes("tune", ("together",)) if s.actors[0].path == "hug"), frames=12)
    truth = open_recording(record_scene(hug, bundled)).joints
    assert truth is not None and truth.shape[:2] == (2, 12) and np.isfinite(truth).all()
    gap = np.linalg.norm(truth[0, :, 0] - truth[1, :, 0], axis=-1)
    assert gap.min() < 0.6 < gap[0]
    crossing = replace(chosen_scenes("tune", ("enter",), 1)[0], frames=30)
    recording = open_recording(record_scene(crossing, bundled))
    column = recording.camera.project(recording.joints[:, 0].astype(np.float64))[:, 0]
    assert column[0] < 0 and column[-1] > recording.camera.width
