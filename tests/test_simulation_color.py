"""Colour of simulated recordings: registered to the depth, equal for equal seeds, with separable skin and front."""

from pathlib import Path

import numpy as np

from tests.support.dual_quaternions import dual_skinning
from tests.support.sequences import SEQUENCES, performed, record_sequence, sequence_body
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import subject_body
from toolkit.mocap.clip import PoseClip
from toolkit.recordings.opening import open_recording
from toolkit.sensing.recording import Recording
from toolkit.simulation.appearance import Appearance, vertex_colors
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.simulate import CaptureSettings, simulate_scene

LOOK = Appearance((200, 150, 120), (20, 20, 20), (0, 0, 250), (0, 0, 250), (0, 250, 0), (250, 0, 0), True, False)


def standing(count: int = 2) -> PoseClip:
    """Return a person who stands with the arms half down."""
    poses = np.zeros((count, skeleton.POSE_SIZE))
    poses[:, skeleton.POSE_NAMES.index("left_shoulder_rz")] = -0.9
    poses[:, skeleton.POSE_NAMES.index("right_shoulder_rz")] = 0.9
    return PoseClip("standing", poses, 30.0, "test")


def recorded(path: Path, yaw: float = 0.0, **shot: object) -> Recording:
    """Return a recording of the standing subject in colour."""
    return simulate_scene([SimulatedPerson(standing(), yaw=yaw)], path, CaptureSettings(color=True, **shot))  # type: ignore[arg-type]


def test_colour_is_registered_to_the_depth(tmp_path: Path) -> None:
    clip = standing()
    clip.poses[1, 0] = 0.9
    recording = simulate_scene(
        [SimulatedPerson(clip)], tmp_path / "take.npz", CaptureSettings(color=True, furnished=False)
    )
    first, second = recording.color(0), recording.color(1)
    assert first is not None and second is not None and first.shape == (*recording.camera.shape, 3)
    somebody = (recording.depth(0) > 0) != (recording.depth(1) > 0)
    changed = np.abs(first.astype(int) - second).sum(axis=-1) > 40
    assert np.count_nonzero(changed & somebody) > 0.85 * np.count_nonzero(somebody)
    assert np.count_nonzero(changed & ~somebody) < 0.15 * np.count_nonzero(somebody)


def test_colour_changes_nothing_in_the_depth(tmp_path: Path) -> None:
    with_color = recorded(tmp_path / "a.npz")
    without = simulate_scene([SimulatedPerson(standing())], tmp_path / "b.npz", CaptureSettings())
    np.testing.assert_array_equal(with_color.depth(1), without.depth(1))
    assert without.color(0) is None


def test_clothes_face_and_hair_are_where_they_belong() -> None:
    body = subject_body("average_male")
    colors, part = vertex_colors(body, LOOK), body.part
    names = skeleton.JOINT_NAMES
    assert (colors[part == names.index("thorax")] == LOOK.shirt).all()
    assert (colors[part == names.index("left_elbow")] == LOOK.shirt).all()
    assert (colors[part == names.index("left_wrist")] == LOOK.skin).all()
    assert (colors[part == names.index("right_knee")] == LOOK.trousers).all()
    assert (colors[part == names.index("right_ankle")] == LOOK.shoes).all()
    head = part == names.index("cervical")
    hair = head & (colors == LOOK.hair).all(axis=1)
    assert body.vertices[hair, 2].mean() < body.vertices[head & ~hair, 2].mean() - 0.03
    assert body.vertices[head, 1].max() == body.vertices[hair, 1].max()


def test_a_twist_in_dual_quaternions_is_another_surface_of_the_same_joints(tmp_path: Path) -> None:
    clip = standing()
    clip.poses[:, skeleton.POSE_NAMES.index("thorax_ry")] = 0.6
    linear, dual = (
        simulate_scene(
            [SimulatedPerson(clip)], tmp_path / f"{name}.npz", CaptureSettings(skinning=skinning, furnished=False)
        )
        for name, skinning in (("linear", Body.vertex_positions), ("dual", dual_skinning))
    )
    np.testing.assert_array_equal(linear.joints, dual.joints)
    off = np.abs(linear.depth(0).astype(int) - dual.depth(0))[(linear.depth(0) > 0) & (dual.depth(0) > 0)]
    assert off.any() and np.percentile(off, 90) < 50


def test_the_four_sequences_are_one_motion_on_four_bodies(tmp_path: Path) -> None:
    path = record_sequence("FS_1", tmp_path, frames=3)
    recording = open_recording(path)
    assert len(recording) == 3 and recording.color(2) is not None and recording.background is not None
    assert record_sequence("FS_1", tmp_path, frames=3) == path
    poses = [performed(sequence_body(name), 90).poses for name in SEQUENCES]
    assert all(np.abs(p[:, 6:] - poses[0][:, 6:]).mean() < 0.1 for p in poses)
