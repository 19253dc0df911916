"""Image joints: stored, flipped, rotated, undistorted, assigned to people and lifted into space."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.body import skeleton
from toolkit.io.errors import RecordingError
from toolkit.people.joint_masks import GivenJoints
from toolkit.people.sighting import Sighting
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.joints2d import Joints2D, lift
from toolkit.sensing.stream import Frame

CAMERA = Camera(60.0, 60.0, 31.0, 23.5, 64, 48)
LEFT_HAND, RIGHT_HAND = skeleton.REPORTED.index("left_hand"), skeleton.REPORTED.index("right_hand")
LEFT_KNEE = skeleton.REPORTED.index("left_knee")


def rows_at(u: float, v: float, confidence: float = 0.9) -> np.ndarray:
    """Return all joints near one pixel, (20, 3)."""
    rows = np.full((20, 3), confidence)
    rows[:, 0], rows[:, 1] = u + 0.1 * np.arange(20), v
    return rows


def stored(path: Path, rows: np.ndarray | None, camera: Camera = CAMERA, count: int = 3) -> Path:
    """Write a small recording with joints."""
    depth = np.zeros((count, *camera.shape), dtype=np.uint16)
    depth[:, 10:40, 20:30] = 2000
    save_recording(path, depth=depth, camera=camera, timestamps=np.arange(count) / 30, joints_2d=rows)
    return path


def test_joints_of_a_recording_come_back_as_they_were_written(tmp_path: Path) -> None:
    rows = np.stack([rows_at(20 + i, 15) for i in range(3)]).astype(np.float32)
    rows[1, LEFT_KNEE] = np.nan
    recording = open_recording(stored(tmp_path / "take.npz", rows))
    for i in range(3):
        (joints,) = recording.joints_2d(i)
        np.testing.assert_array_equal(joints.rows, rows[i])
    (middle,) = recording.joints_2d(1)
    assert middle.confidence[LEFT_KNEE] == 0 and np.isnan(middle.pixels[LEFT_KNEE]).all()
    assert [len(frame.joints) for frame in recording.stream()] == [1, 1, 1]


def test_joints_of_several_people_come_back(tmp_path: Path) -> None:
    rows = np.stack([np.stack([rows_at(u, 15)] * 3) for u in (10, 40)])
    rows[1, 0] = np.nan
    recording = open_recording(stored(tmp_path / "take.npz", rows))
    assert [len(recording.joints_2d(i)) for i in range(3)] == [1, 2, 2]


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (np.zeros((3, 19, 3)), "expected numbers"),
        (np.zeros((2, 20, 3)), "expected numbers"),
        (np.zeros((3, 20, 2)), "expected numbers"),
        (np.full((3, 20, 3), "x"), "numbers"),
        (np.full((3, 20, 3), 2.0), "confidence of 2"),
        (np.full((3, 20, 3), -0.5), "confidence of -0.5"),
    ],
)
def test_joints_of_wrong_shape_type_or_range_are_refused(tmp_path: Path, rows: np.ndarray, said: str) -> None:
    path = stored(tmp_path / "take.npz", None)
    with np.load(path) as archive:
        np.savez(tmp_path / "bad.npz", **archive, joints_2d=rows)
    with pytest.raises(RecordingError, match=said):
        open_recording(tmp_path / "bad.npz")


def test_a_mirrored_stream_flips_the_pixels_and_swaps_the_names(tmp_path: Path) -> None:
    rows = np.stack([rows_at(20, 15)] * 3)
    rows[:, LEFT_HAND, :2] = 5.0, 30.0
    recording = open_recording(stored(tmp_path / "take.npz", rows), mirrored=True)
    (joints,) = recording.joints_2d(0)
    np.testing.assert_allclose(joints.pixels[RIGHT_HAND], (CAMERA.width - 1 - 5.0, 30.0))


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_turned_images_turn_their_joints_with_the_depth(tmp_path: Path, degrees: int) -> None:
    rows, depth = np.stack([rows_at(20, 15)]), np.zeros((1, *CAMERA.shape), dtype=np.uint16)
    rows[0, LEFT_HAND, :2] = 50.0, 7.0
    depth[0, 7, 50] = 2000
    path = tmp_path / "take.npz"
    save_recording(path, depth=depth, camera=CAMERA, timestamps=[0.0], joints_2d=rows)
    recording = open_recording(path, rotate=degrees)
    u, v = recording.joints_2d(0)[0].pixels[LEFT_HAND].astype(int)
    assert recording.depth(0)[v, u] == 2000


def sighting(number: int, columns: slice, camera: Camera = CAMERA) -> Sighting:
    """Return a person 2 m away in some columns of the image."""
    depth = np.zeros(camera.shape, dtype=np.float32)
    depth[5:45, columns] = 2.0
    return Sighting(number, depth, None, camera)


def person_at(u: float) -> Joints2D:
    """Return a person's joints around one column."""
    return Joints2D.of_rows(rows_at(u, 20))


def given_to(people: tuple[Joints2D, ...], sightings: list[Sighting]) -> tuple[Sighting, ...]:
    """Return the joints of a frame as assigned."""
    frame = Frame(np.zeros(CAMERA.shape, dtype=np.uint16), 0.0, people)
    return GivenJoints(CAMERA).add(frame, sightings)


def test_each_person_gets_the_joints_on_its_mask() -> None:
    one, two = given_to((person_at(41), person_at(11)), [sighting(1, slice(8, 20)), sighting(2, slice(38, 50))])
    assert one.joints is not None and two.joints is not None
    assert abs(one.joints.pixels[0, 0] - 11) < 1e-4 and abs(two.joints.pixels[0, 0] - 41) < 1e-4


def test_joints_of_an_undetected_person_are_unassigned() -> None:
    (alone,) = given_to((person_at(55),), [sighting(1, slice(8, 20))])
    assert alone.joints is None


def test_joints_are_undistorted_and_halved_as_the_depth_is() -> None:
    bent = Camera(60.0, 60.0, 31.0, 23.5, 64, 48, (-0.2, 0.05, 0.002, -0.001, 0.0))
    flat = bent.undistorted().subsampled(2)
    point = np.array([0.4, 0.3, 1.5])
    pixel = cv2.projectPoints(point[None], np.zeros(3), np.zeros(3), bent.matrix, np.array(bent.distortion))[0][0, 0]
    rows = rows_at(31, 24)
    rows[LEFT_HAND, :2] = pixel
    frame = Frame(np.zeros(bent.shape, dtype=np.uint16), 0.0, (Joints2D.of_rows(rows),))
    depth = np.full(flat.shape, 1.5, dtype=np.float32)
    (seen,) = GivenJoints(bent).add(frame, [Sighting(1, depth, None, flat)])
    assert seen.joints is not None
    np.testing.assert_allclose(seen.joints.pixels[LEFT_HAND], flat.project(point), atol=0.01)
    lifted = lift(seen.joints, depth, flat)
    np.testing.assert_allclose(lifted.points[LEFT_HAND, :2] / lifted.points[LEFT_HAND, 2], point[:2] / 1.5, atol=1e-3)


def test_lifted_joints_lie_half_a_limb_behind_the_median_of_what_is_measured() -> None:
    depth = np.zeros(CAMERA.shape, dtype=np.float32)
    depth[19:22, 10:13] = [[2.0, 2.1, 2.2], [0.0, 2.3, 2.4], [0.0, 0.0, 2.6]]
    rows = np.full((20, 3), np.nan)
    rows[LEFT_KNEE] = 11.2, 19.8, 0.7
    lifted = lift(Joints2D.of_rows(rows), depth, CAMERA)
    z = 0.5 * (2.2 + 2.3) + 0.05
    expected = ((11.2 - CAMERA.cx) * z / CAMERA.fx, (19.8 - CAMERA.cy) * z / CAMERA.fy, z)
    np.testing.assert_allclose(lifted.points[LEFT_KNEE], expected, atol=1e-6)
    assert np.isnan(np.delete(lifted.points, LEFT_KNEE, axis=0)).all()
    assert lifted.confidence[LEFT_KNEE] == np.float32(0.7) and np.count_nonzero(lifted.confidence) == 1


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(0, 1))
def test_lifting_never_fails_wherever_a_joint_is(u: float, v: float, confidence: float) -> None:
    depth = np.zeros(CAMERA.shape, dtype=np.float32)
    depth[10:, 10:] = 2.0
    lifted = lift(Joints2D.of_rows(np.tile([u, v, confidence], (20, 1))), depth, CAMERA)
    assert (np.isfinite(lifted.points).all(axis=1) == (lifted.confidence > 0)).all()
