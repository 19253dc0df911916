"""The ground height of a track comes from the camera, from the feet or from an assumption."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.motion.contact import ground_of
from toolkit.tracks import LOST, TRACKED

BODY = load_body("neutral")
STANDING_HIPS = -float(BODY.vertices[:, 1].min())


def somebody(height: float | None, *, feet: bool = True, there: bool = True, state: int = TRACKED) -> Any:
    poses = np.zeros((30, skeleton.POSE_SIZE))
    poses[:, 1] = 0.2
    track = SimpleNamespace(
        pose=poses,
        timestamps=np.arange(30) / 30,
        state=np.full(30, state),
        observed=np.full((30, len(skeleton.REPORTED)), feet),
    )
    return SimpleNamespace(camera_height=height, track=track, body=BODY, there=np.full(30, there))


def test_the_ground_is_where_the_camera_saw_it_else_where_feet_rest_else_guessed() -> None:
    below = 0.2 - STANDING_HIPS
    assert ground_of([somebody(None), somebody(1.3)]) == (-1.3, "seen by the camera")
    height, how = ground_of([somebody(None)])
    assert height == pytest.approx(below, abs=0.02) and how == "where the feet rest"
    for person in (somebody(None, feet=False), somebody(None, state=LOST)):
        height, how = ground_of([person])
        assert height == pytest.approx(below, abs=0.02) and how == "guessed"
    assert ground_of([somebody(None, feet=False, there=False)]) == (0.0, "guessed")
