"""Held objects of simulated people."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support import acts
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.io.errors import UsageError
from toolkit.mocap.clip import PoseClip
from toolkit.simulation.holding import HOLDINGS, held_mesh
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, prepare

LEFT, RIGHT = (skeleton.REPORTED.index(f"{side}_hand") for side in ("left", "right"))


def standing(frames: int) -> np.ndarray:
    """Return poses (T, P) of a person who stands at the origin with the arms out."""
    poses = np.zeros((frames, skeleton.POSE_SIZE))
    poses[:, 1] = 0.9
    return poses


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
