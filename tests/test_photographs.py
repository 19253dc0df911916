"""Photographs in one recording: no frame says anything of the pose in another, and the user is told."""

import warnings
from typing import Any

import numpy as np
import pytest

import depthmocap
from tests.sensing_scenes import KINECT, neutral, scene, standing, up_of_tilt
from toolkit.body.skeleton import POSE_NAMES
from toolkit.io.errors import PlausibilityWarning
from toolkit.people.connection import FASTEST, HELD, VISIBILITY_SHIFT, connected
from toolkit.people.plausibility import are_unconnected, plausibility
from toolkit.people.survey import survey
from toolkit.recordings.opening import UNCONNECTED, recording_of, upright
from toolkit.sensing.camera import level_rotation
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.simulation.raycast import render_depth

CENTRED = (KINECT.fx, KINECT.fy, KINECT.cx, KINECT.cy)
ROTATION = level_rotation(up_of_tilt(0.0))
RAISED = {"left_shoulder_rz": 1.0}, {"right_shoulder_rz": -0.9}, {"left_shoulder_rz": 0.0, "right_shoulder_rz": 0.0}
PLACES = (0.0, 3.0), (-0.9, 2.6), (0.7, 3.6)


def photographs() -> tuple[np.ndarray, np.ndarray]:
    """Return three images of one person at other places in other poses, (3, H, W) in mm, and the joints (3, 20, 3)."""
    body, depth, joints = neutral()[0], [], []
    for place, raised in zip(PLACES, RAISED, strict=True):
        pose = standing(*place, 1.2)
        for name, value in raised.items():
            pose[POSE_NAMES.index(name)] = value
        depth.append(np.rint(1000 * render_depth(body, pose, KINECT, ROTATION)).astype(np.uint16))
        joints.append(body.joint_positions(pose) @ ROTATION)
    return np.stack(depth), np.array(joints)


def tracked(depth: np.ndarray, **options: Any) -> tuple[depthmocap.Track, list[str]]:
    """Return a track, and the texts of the warnings."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        track = depthmocap.track(depth, intrinsics=CENTRED, **options)
    return track, [str(w.message) for w in found if issubclass(w.category, PlausibilityWarning)]


@pytest.mark.parametrize("options", [{}, {"frame_rate": 30}])
def test_photographs_are_tracked_as_if_each_were_alone(options: dict[str, Any]) -> None:
    depth, joints = photographs()
    track, told = tracked(depth, **options)
    assert list(track.state) == ["tracked"] * 3
    errors = 1000 * np.linalg.norm(track.joints - joints, axis=2)
    assert errors.mean(axis=1).max() < 20  # 10 alone; before, the third was lost (1,653)
    assert len(told) == 1
    if options:
        assert "faster than a sprinter between the frames; check --frame-rate" in told[0]
    else:
        assert "each is tracked as a photograph; --frame-rate 30" in told[0]
        assert np.diff(track.timestamps).min() > HELD


def test_the_person_is_detected_again_after_a_cut_in_a_film() -> None:
    depth, joints = photographs()
    track, told = tracked(np.repeat(depth[[0, 2]], 4, axis=0))
    assert told == [] and track.timestamps[1] == pytest.approx(1 / 30)
    errors = 1000 * np.linalg.norm(track.joints - np.repeat(joints[[0, 2]], 4, axis=0), axis=2)
    assert errors.mean(axis=1).max() < 25


@pytest.mark.parametrize("room", [{}, {"wall": 4.5, "floor": True, "height": 1.4}])
def test_a_walk_and_a_sprint_are_films(room: dict[str, Any]) -> None:
    for step in (0.0, 0.05, 0.3):  # metres a frame: 0, 1.5 and 9 m/s
        depth = np.stack([scene(KINECT, ((x * step - 0.6, 3.4),), **room)[0] for x in range(4)])
        assert not are_unconnected(recording_of(depth, intrinsics=CENTRED))


def test_photographs_of_people_in_rooms_are_told_from_a_film() -> None:
    views = [((-1.0, 2.4), 4.5, 1.4), ((1.0, 3.8), 5.5, 1.2), ((-0.9, 3.0), 3.6, 1.0)]
    depth = np.stack(
        [scene(KINECT, (place,), wall=wall, floor=True, height=height)[0] for place, wall, height in views]
    )
    recording = upright_quietly(depth)
    assert recording.options["frame_rate"] == UNCONNECTED and plausibility(recording) == ()
    room = survey(recording, SensingSettings())
    assert not room.known and not room.cut_out  # of one frame, and decided again in the next


def upright_quietly(depth: np.ndarray) -> Any:
    """Return the recording of depth as the library opens it."""
    with pytest.warns(PlausibilityWarning, match="as a photograph"):
        return upright(lambda **more: recording_of(depth, intrinsics=CENTRED, **more))


def test_a_step_of_a_sprinter_connects_and_a_longer_one_does_not() -> None:
    reach = VISIBILITY_SHIFT + FASTEST / 30
    assert connected(np.zeros(3), np.array([reach - 0.01, 0, 0]), 1 / 30)
    assert not connected(np.zeros(3), np.array([0, 0, reach + 0.01]), 1 / 30)
    assert not connected(np.zeros(3), np.zeros(3), HELD + 0.01)
