import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.landmark_helpers import body_cloud, cloud_of, figure, paint
from toolkit.body.shape import load_body
from toolkit.body.skeleton import POSE_NAMES, POSE_SIZE
from toolkit.io.errors import SegmentationError
from toolkit.landmarks.centre import HALF_HEIGHT, HALF_WIDTH, cloud_centre
from toolkit.landmarks.facing import FacingEstimate, camera_yaw, estimate_facing, smoothed_facing
from toolkit.landmarks.landmark_settings import LandmarkSettings

SETTINGS = LandmarkSettings()
PLANE = LandmarkSettings(chest_height=0.0, turn_gain=1.0)
"""Plane fit of the paper."""
CHEST = np.array([0.3, 0.0, -2.5])
YAWS = np.radians([-60, -45, -20, 0, 20, 45, 60])


def turned(points: np.ndarray, yaw: float) -> np.ndarray:
    c, s = np.cos(yaw), np.sin(yaw)
    return points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T


def chest(rng: np.random.Generator, yaw: float, noise: float = 0.0, lean: float = 0.0) -> np.ndarray:
    """Return the front of a curved torso about (0.3, 0, -2.5) with a heading `yaw` and a forward lean, radians."""
    x, y = rng.uniform(-0.2, 0.2, 3000), rng.uniform(-0.3, 0.3, 3000)
    points = np.stack([x, y, -(x**2) / 0.8 + rng.normal(0.0, noise, 3000) if noise else -(x**2) / 0.8], axis=1)
    c, s = np.cos(lean), np.sin(lean)
    points = points @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    return (turned(points, yaw) + [0.3, 0.0, -2.5]).astype(np.float32)


def degrees_between(a: float, b: float) -> float:
    return float(np.degrees(abs((a - b + np.pi) % (2 * np.pi) - np.pi)))


def plain_mean_shift(points: np.ndarray, centre: np.ndarray, axes: np.ndarray) -> np.ndarray:
    for _ in range(30):
        inside = (((points - centre) / axes) ** 2).sum(axis=1) <= 1.0
        step = points[inside].mean(axis=0) - centre
        centre = centre + step
        if np.linalg.norm(step) < 1e-3:
            break
    return centre


@pytest.mark.parametrize("seed", range(5))
def test_the_mean_shift_is_that_of_plain_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal([0.5, 0.2, -2.0], [0.3, 0.5, 0.1], (2000, 3)).astype(np.float32)
    start = np.array([0.4, 0.0, -2.0])
    axes = np.array([HALF_WIDTH, HALF_HEIGHT, HALF_WIDTH])
    assert cloud_centre(points, start) == pytest.approx(plain_mean_shift(points.astype(float), start, axes), abs=1e-6)


@pytest.mark.parametrize("arms", ["both", "left", "forward"])
def test_outstretched_arms_hardly_move_the_centre(arms: str) -> None:
    rest = figure()
    rest[:, : 160 - 25] = 0.0
    rest[:, 160 + 25 :] = 0.0
    moved = rest.copy()
    if arms == "both":
        moved = figure()
    elif arms == "left":
        paint(moved, (0.2, 0.18), (0.75, 0.28), 2.6)
    else:
        for z in np.arange(2.0, 2.6, 0.01):
            paint(moved, (0.1, 0.18), (0.2, 0.28), float(z))
    step = cloud_centre(cloud_of(moved).points) - cloud_centre(cloud_of(rest).points)
    assert np.linalg.norm(step) < 0.04
    assert np.abs(step[[0, 2]]).max() < 0.01  # the mean of the cloud moves by 5 cm to the side of a stretched left arm


def test_the_centre_follows_a_person_from_the_frame_before_and_finds_one_who_has_jumped_away() -> None:
    points = cloud_of(figure()).points
    cold = cloud_centre(points)
    assert cloud_centre(points, cold + [0.1, -0.1, 0.1]) == pytest.approx(cold, abs=0.01)
    assert cloud_centre(points, cold + [0.0, 0.0, 3.0]) == pytest.approx(cold, abs=1e-9)


def test_the_centre_and_the_torso_grow_with_the_scale_of_the_person() -> None:
    points = cloud_of(figure()).points
    child = (0.6 * points).astype(np.float32)
    assert cloud_centre(child, scale=0.6) == pytest.approx(0.6 * cloud_centre(points), abs=2e-3)
    centre = cloud_centre(points)
    adult, small = estimate_facing(points, centre), estimate_facing(child, 0.6 * centre, scale=0.6)
    assert small.weight == pytest.approx(adult.weight, abs=1e-3)


def test_a_cloud_without_points_has_no_centre() -> None:
    with pytest.raises(SegmentationError, match="no points"):
        cloud_centre(np.zeros((0, 3), dtype=np.float32))


@pytest.mark.parametrize("yaw", YAWS)
@pytest.mark.parametrize("noise", [0.0, 0.005, 0.015])
def test_the_normal_of_the_plane_is_found_at_every_yaw_and_noise(yaw: float, noise: float) -> None:
    points = chest(np.random.default_rng(3), yaw, noise)
    found = estimate_facing(points, CHEST, PLANE)
    assert degrees_between(found.yaw, yaw) < 3.0
    assert found.weight > 0.5


def facing_of_body(name: str, yaw: float, used: LandmarkSettings) -> FacingEstimate:
    body = load_body(name)
    pose = np.zeros(POSE_SIZE)
    pose[:3], pose[4] = (0.3, 0.0, -2.8), yaw
    pose[POSE_NAMES.index("left_shoulder_rz")], pose[POSE_NAMES.index("right_shoulder_rz")] = -1.0, 1.0  # arms down
    points = body_cloud(body, pose).points
    scale = body.height / 1.7
    return estimate_facing(points, cloud_centre(points, scale=scale), used, scale)


@pytest.mark.parametrize("name", ["neutral", "slim_male", "child"])
@pytest.mark.parametrize("yaw", np.radians([-45, -30, -15, 0, 15, 30, 45]))
def test_the_facing_of_a_body_is_found_within_three_tenths_of_its_turn(name: str, yaw: float) -> None:
    found = facing_of_body(name, yaw, SETTINGS)
    assert degrees_between(found.yaw, yaw) < 3.0 + 0.3 * abs(np.degrees(yaw))
    assert found.weight > 0.3 or abs(yaw) > np.radians(40)  # the near arm enters the patch


@pytest.mark.parametrize("name", ["neutral", "heavy_female", "child"])
@pytest.mark.parametrize("yaw", np.radians([-40, 40]))
def test_the_chest_gives_a_better_facing_than_the_belly(name: str, yaw: float) -> None:
    chest_error, belly_error = (degrees_between(facing_of_body(name, yaw, s).yaw, yaw) for s in (SETTINGS, PLANE))
    assert chest_error < 0.75 * belly_error


def test_a_forward_lean_does_not_turn_the_facing() -> None:
    for lean in np.radians([-30, 30, 50]):
        found = estimate_facing(chest(np.random.default_rng(0), 0.4, 0.002, lean), CHEST, PLANE)
        assert degrees_between(found.yaw, 0.4) < 3.0


def test_an_arm_before_the_torso_lowers_the_weight() -> None:
    rng = np.random.default_rng(1)
    points = chest(rng, 0.0, 0.003)
    free = estimate_facing(points, CHEST, PLANE)
    arm = np.abs(points[:, 1]) < 0.05
    points[arm, 2] += 0.12
    occluded = estimate_facing(points, CHEST, PLANE)
    assert free.weight > 0.8
    assert occluded.weight < 0.4 * free.weight


def test_a_person_at_the_image_border_who_faces_the_camera_has_the_yaw_towards_it() -> None:
    assert camera_yaw(np.array([0.0, 0.3, -2.0])) == 0.0
    assert camera_yaw(np.array([1.0, 0.3, -1.0])) == pytest.approx(-np.pi / 4)


def towards(yaw: float) -> np.ndarray:
    return np.array([np.sin(yaw), np.cos(yaw)])


@settings(max_examples=50, deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(-3.1, 3.1), st.floats(0.0, 1.0), st.integers(2, 8))
def test_the_smoothing_does_not_depend_on_the_frame_rate(first: float, then: float, weight: float, parts: int) -> None:
    yaws = []
    for steps in (1, parts):
        direction = towards(first)
        for _ in range(steps):
            direction = smoothed_facing(direction, FacingEstimate(then, weight), 0.2 / steps, np.array([0, 0, -2.0]))
        yaws.append(np.arctan2(*direction))
    assume_far = degrees_between(first, then) < 179.0
    if assume_far:
        assert degrees_between(*yaws) < 1e-5


@pytest.mark.data("utd-mhad")
def test_people_who_face_the_camera_have_a_yaw_near_zero(data_folder) -> None:
    from scipy.io import loadmat

    paths = sorted((data_folder / "depth" / "utd_mhad").glob("a*_depth.mat"))[::9]
    yaws = []
    for path in paths:
        depth = loadmat(path)["d_depth"][:, ::-1, 2].astype(np.float32) / 1000  # a standing start
        points = cloud_of(depth).points
        found = estimate_facing(points, cloud_centre(points))
        if found.weight > 0.5:
            yaws.append(abs(np.degrees(found.yaw)))
    assert len(yaws) > 0.7 * len(paths)
    assert np.median(yaws) < 10
    assert max(yaws) < 30
