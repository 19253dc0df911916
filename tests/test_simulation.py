"""Simulated recordings: exact truth, sensor models, camera placement, files, and colour."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.poses import entry
from tests.support.dual_quaternions import dual_skinning
from tests.support.sequences import SEQUENCES, performed, record_sequence, sequence_body
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body, subject_body
from toolkit.io.errors import BodyError, UsageError
from toolkit.mocap.clip import PoseClip
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.recording import Recording
from toolkit.simulation.appearance import Appearance, vertex_colors
from toolkit.simulation.person import SimulatedPerson
from toolkit.simulation.raycast import cast, render_depth
from toolkit.simulation.scene import place_camera
from toolkit.simulation.sensors import KinectV1, Sensor, Surface, TimeOfFlight, make_sensor
from toolkit.simulation.simulate import CaptureSettings, Simulation, prepare, simulate_recording, simulate_scene


def waving(frames: int = 6, facing: float = 0.0) -> PoseClip:
    """Return a standing person, right arm down, who raises the left arm."""
    poses = np.zeros((frames, skeleton.POSE_SIZE))
    poses[:, 1] = 0.9
    poses[:, entry("root_ry")] = facing
    poses[:, entry("right_shoulder_rz")] = 1.2
    poses[:, entry("left_shoulder_rz")] = np.linspace(-1.2, 0.8, frames)
    return PoseClip("waving", poses, 30.0, "test")


def alone(clip: PoseClip | Path, *, body: str | Body = "neutral", yaw: float = 0.0, **shot: Any) -> Simulation:
    """Return one person in front of the camera."""
    return prepare([SimulatedPerson(clip, body, yaw=yaw)], CaptureSettings(**shot))


def wall(sensor: Sensor, depth: float, cosine: float = 1.0) -> Surface:
    """Return a wall parallel to the image with a given cosine of incidence."""
    shape = sensor.camera.scaled(sensor.rays_per_side).shape
    return Surface(np.full(shape, depth, np.float32), np.full(shape, cosine, np.float32), np.full(shape, -1, np.int16))


def step_edge(sensor: Sensor, front: float, back: float) -> Surface:
    """Return a near surface on the right half of the image in front of a far wall."""
    surface = wall(sensor, back)
    middle = surface.depth.shape[1] // 2 + 1
    surface.depth[:, middle:] = front
    surface.person[:, middle:] = 0
    return surface


def test_a_ray_through_an_integer_pixel_meets_a_plane_where_the_convention_says() -> None:
    camera = Camera(50.0, 60.0, 20.0, 15.0, 41, 31)
    corners = np.array([[-9.0, -9, 2], [9, -9, 4], [9, 9, 4], [-9, 9, 2]])  # z = 3 + x / 9
    hits = cast(corners, np.array([[0, 2, 1], [0, 3, 2]], dtype=np.int32), camera)
    slope = (np.arange(41) - 20.0) / 50.0
    np.testing.assert_allclose(hits.depth, np.broadcast_to(3 / (1 - slope / 9), (31, 41)), rtol=1e-5)
    assert (hits.normals[..., 2] < 0).all()


def test_a_rendered_body_is_where_its_vertices_project() -> None:
    body, camera = load_body(), Camera(285.63, 285.63, 159.0, 120.0, 320, 240)
    rotation = level_rotation(np.array([0.0, -0.95, -0.3]))
    pose = waving().poses[-1].copy()
    pose[:3] = rotation @ [0.1, 0.0, 2.7]
    depth = render_depth(body, pose, camera, rotation)
    vertices = body.vertex_positions(pose) @ rotation
    pixels = np.rint(camera.project(vertices)).astype(int)
    seen = depth[pixels[:, 1], pixels[:, 0]]
    visible = (seen > 0) & (np.abs(seen - vertices[:, 2]) < 0.02)
    assert visible.mean() > 0.3 and (seen > 0).mean() > 0.85
    assert (vertices[seen > 0, 2] > seen[seen > 0] - 0.05).all(), "nothing lies before what is seen"


@pytest.mark.parametrize("sensor", ["tof", "kinect"])
@pytest.mark.parametrize(("yaw", "tilt", "height"), [(0.0, None, 1.0), (60.0, 20.0, 1.9), (-90.0, None, 0.5)])
def test_true_joints_lie_inside_the_silhouette_just_behind_the_surface(
    sensor: str, yaw: float, tilt: float | None, height: float
) -> None:
    simulation = alone(
        waving(),
        body=subject_body("slim_female", seed=3),
        sensor=sensor,
        yaw=yaw,
        tilt=tilt,
        height=height,
        furnished=False,
    )
    for frame in simulation.frames():
        pixels = np.rint(simulation.sensor.camera.project(frame.joints[0])).astype(int)
        window = [(frame.person >= 0)[max(v - 1, 0) : v + 2, max(u - 1, 0) : u + 2] for u, v in pixels]
        assert sum(area.any() for area in window) >= 18
        behind = [
            joint[2] > 1e-3 * frame.depth[v, u] - 0.05
            for joint, (u, v) in zip(frame.joints[0], pixels, strict=True)
            if (frame.person >= 0)[v, u]
        ]
        assert len(behind) >= 12 and sum(behind) >= len(behind) - 1, "joints lie under the skin, but for mixed pixels"


def test_the_left_hand_of_a_person_facing_the_camera_is_at_positive_x() -> None:
    for facing in (0.0, 2.0):
        frame = next(alone(waving(facing=facing), furnished=False).frames())
        joints = dict(zip(skeleton.REPORTED, frame.joints[0], strict=True))
        assert joints["left_hand"][0] > 0.1 > -0.1 > joints["right_hand"][0]
        assert joints["left_foot"][2] < joints["left_ankle"][2], "the toes point at the camera"


@pytest.mark.parametrize("tilt", [-0.3, 0.0, 0.6])
def test_the_vertical_that_is_written_gives_back_the_level_frame(tilt: float) -> None:
    view = place_camera(distance=2.5, height=1.4, tilt=tilt)
    np.testing.assert_allclose(level_rotation(view.up_camera), view.R_level_camera, atol=1e-12)
    np.testing.assert_allclose(-view.position, [0.0, -1.4, -2.5], atol=1e-12)
    forward = view.R_level_camera @ np.array([0.0, 0.0, 1.0])
    assert np.sign(forward[1]) == -np.sign(tilt) or tilt == 0.0, "positive looks down"


def test_the_kinect_resolves_two_and_a_half_centimetres_at_three_metres() -> None:
    sensor = KinectV1(noise=0.0)
    values = []
    for depth in np.arange(2.9, 3.1, 0.001):
        measured, _ = sensor.measure(wall(sensor, depth), np.random.default_rng(0))
        values.append(np.median(measured[measured > 0]))
    steps = np.diff(np.unique(values))
    assert np.all((steps > 22) & (steps < 28))
    fine = [np.median(sensor.measure(wall(sensor, z), np.random.default_rng(0))[0]) for z in (1.5, 1.504, 1.508, 1.512)]
    assert np.ptp(fine) >= 5, "steps shrink with the square of the distance"


def test_time_of_flight_noise_grows_with_distance_and_grazing_angle() -> None:
    sensor, spread = TimeOfFlight(), {}
    for depth, cosine in ((1.5, 1.0), (3.0, 1.0), (3.0, 0.5)):
        measured, _ = sensor.measure(wall(sensor, depth, cosine), np.random.default_rng(0))
        centre = measured[60:84, 70:106].astype(float)
        spread[depth, cosine] = centre.std()
        assert abs(centre.mean() - 1e3 * depth) < 2.0, "the noise has no bias"
    assert spread[3.0, 1.0] == pytest.approx(10.0, rel=0.15)
    assert spread[1.5, 1.0] == pytest.approx(5.0, rel=0.15)
    assert spread[3.0, 0.5] == pytest.approx(14.1, rel=0.15)


def test_time_of_flight_mixes_front_and_back_at_edges() -> None:
    sensor = TimeOfFlight(noise_at_3m=0.0)
    measured, subject = sensor.measure(step_edge(sensor, 2.0, 4.0), np.random.default_rng(0))
    row = measured[72]
    mixed = (row > 2100) & (row < 3900)
    assert 1 <= mixed.sum() <= 2, "flying pixels stand at the edge only"
    assert (subject >= 0).sum(axis=1).min() > 80


def test_a_pixel_is_a_person_s_where_at_least_half_of_its_rays_meet_them() -> None:
    sensor = TimeOfFlight()
    surface = wall(sensor, 2.0)
    surface.person[:, 31:60] = 0  # two of the rays of pixel 10, all of those of pixels 11 to 19
    surface.person[:, 92:100] = 1  # one of pixel 30, all of 31 and 32, one of 33
    _, person = sensor.measure(surface, np.random.default_rng(0))
    assert np.flatnonzero(person[50] == 0).tolist() == list(range(10, 20))
    assert np.flatnonzero(person[50] == 1).tolist() == [31, 32]


def test_the_kinect_casts_a_shadow_to_the_left_of_what_is_near() -> None:
    sensor = KinectV1(ragged=0.0, torn=0.0)
    measured, _ = sensor.measure(step_edge(sensor, 2.0, 4.0), np.random.default_rng(0))
    expected = 285.63 * 0.075 * (1 / 2.0 - 1 / 4.0)
    holes = (measured[100:140, 100:161] == 0).sum(axis=1)
    np.testing.assert_allclose(holes, expected, atol=1.5)
    assert (measured[100:140, 165:] > 0).all(), "no shadow on the right"


def test_a_furnished_recording_differs_from_its_background_where_the_subject_is() -> None:
    simulation = alone(waving(2), furnished=True)
    background = simulation.background()
    assert background is not None and (background > 0).mean() > 0.9
    frame = next(simulation.frames())
    change = np.abs(frame.depth.astype(int) - background) > 60
    assert (change & (frame.person >= 0)).sum() > 0.9 * (frame.person >= 0).sum()
    assert (change & ~(frame.person >= 0)).mean() < 0.02


@pytest.mark.parametrize("furnished", [True, False])
def test_what_is_written_is_read_back(tmp_path: Path, furnished: bool) -> None:
    done: list[tuple[int, int]] = []
    recording = simulate_recording(
        waving(3), tmp_path / "take.npz", body="child", sensor="kinect", tilt=10.0, seed=2, furnished=furnished,
        progress=lambda i, n: done.append((i, n)),
    )  # fmt: skip
    assert done == [(1, 3), (2, 3), (3, 3)]
    again = open_recording(tmp_path / "take.npz")
    simulation = alone(waving(3), body="child", sensor="kinect", tilt=10.0, seed=2, furnished=furnished)
    for i, frame in enumerate(simulation.frames()):
        np.testing.assert_array_equal(again.depth(i), frame.depth)
        np.testing.assert_array_equal(again.joints[i], frame.joints[0])
    np.testing.assert_allclose(again.timestamps, [0.0, 1 / 30, 2 / 30])
    np.testing.assert_allclose(again.up_camera, [0.0, -np.cos(np.deg2rad(10)), -np.sin(np.deg2rad(10))], atol=1e-12)
    assert (recording.background is not None) == furnished


@pytest.mark.data("cmu-mocap")
def test_a_clip_file_is_resampled_to_the_recording_s_frame_rate(data_folder: Path, tmp_path: Path) -> None:
    from toolkit.mocap.read import find_clips, read_clip

    path = next(p for p in find_clips(data_folder / "mocap") if p.suffix == ".bvh")
    simulation = alone(path, body="neutral", frame_rate=30.0)
    assert simulation.frame_rate == pytest.approx(30.0)
    clip = read_clip(path)
    assert simulation.frames_in_all <= 30 * len(clip) / clip.frame_rate + 2


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: make_sensor("lidar"), UsageError, "tof, kinect"),
        (lambda: alone(waving(1), body="giant"), BodyError, "neutral"),
        (lambda: alone(waving(1), body="1,x"), UsageError, "numbers"),
        (lambda: alone(waving(1), distance=0.0), UsageError, "give 0.1 to 60 metres"),
        (lambda: alone(waving(1), yaw=np.nan), UsageError, "give -10000 to 10000 degrees"),
        (lambda: alone(waving(1), frame_rate=0.0), UsageError, "frames a second"),
        (lambda: alone(waving(1), frame_rate=1e9), UsageError, "give 0.1 to 1000 frames a second"),
        (lambda: alone(waving(1), height=-1.0), UsageError, "above the floor"),
        (lambda: alone(waving(1), seed=-1), UsageError, "from 0 on"),
    ],
)
def test_a_bad_argument_is_named_with_the_way_out(call: object, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        call()  # type: ignore[operator]


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
