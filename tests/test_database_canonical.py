"""The canonical frame and the common origin of poses and clouds."""

import numpy as np
import pytest

from tests.database_helpers import neutral, random_poses, small_database
from toolkit.body import skeleton
from toolkit.database import canonical
from toolkit.database.origin import observed_offsets, seen_points
from toolkit.landmarks.centre import cloud_centre

REPORTED = skeleton.REPORTED.index


def swap_sides(points: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Return the points of the mirrored person under their new names, mirrored at x = 0."""
    partner = {"left": "right", "right": "left"}
    order = [names.index("_".join([partner.get(n.split("_")[0], n.split("_")[0]), *n.split("_")[1:]])) for n in names]
    return points[..., order, :] * [-1.0, 1.0, 1.0]


def test_a_canonical_pose_put_back_is_the_pose_it_came_from() -> None:
    poses = random_poses(np.random.default_rng(0), 50)
    bare, positions, yaws = canonical.canonicalise(poses)
    assert np.abs(canonical.body_facing(bare)).max() < 1e-12
    assert not bare[:, skeleton.ROOT_POSITION].any()
    back = canonical.place(bare, np.zeros((50, 4)), positions, yaws)
    np.testing.assert_allclose(neutral().joint_positions(back), neutral().joint_positions(poses), atol=1e-12)


def test_the_canonical_pose_does_not_depend_on_where_the_person_stood() -> None:
    rng = np.random.default_rng(1)
    bare = canonical.canonicalise(random_poses(rng, 20))[0]
    moved = canonical.place(bare, np.zeros(4), rng.normal(size=(20, 3)), rng.uniform(-3, 3, 20))
    np.testing.assert_allclose(
        neutral().joint_positions(canonical.canonicalise(moved)[0]), neutral().joint_positions(bare), atol=1e-12
    )


@pytest.mark.parametrize("yaw", [-3.0, -1.2, 0.0, 0.4, 2.9])
def test_the_facing_of_an_upright_pose_is_the_yaw_of_its_root(yaw: float) -> None:
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[4] = yaw
    assert canonical.body_facing(pose) == pytest.approx(yaw)
    nose = neutral().vertex_positions(pose)[neutral().vertices[:, 2].argmax()]
    assert nose @ [np.sin(yaw), 0.0, np.cos(yaw)] > 0.1


@pytest.mark.parametrize("bend", [-1.2, 0.9, 1.8, 2.6])
def test_a_deep_bend_does_not_turn_the_facing(bend: float) -> None:
    pose = np.zeros(skeleton.POSE_SIZE)
    pose[skeleton.ROOT_ROTATION] = [bend, 0.0, 0.0]
    pose = canonical.place(pose, np.zeros(4), np.zeros(3), 0.7)
    assert canonical.body_facing(pose) == pytest.approx(0.7)


def test_mirrored_poses_have_mirrored_joints_under_swapped_names() -> None:
    body, poses = neutral(), random_poses(np.random.default_rng(2), 30)
    reflected = canonical.mirrored(poses)
    np.testing.assert_allclose(canonical.body_facing(reflected), -canonical.body_facing(poses), atol=1e-12)
    np.testing.assert_allclose(canonical.mirrored(reflected), poses)
    for positions, names in (
        (body.joint_positions, skeleton.REPORTED), (body.end_effector_positions, skeleton.END_EFFECTORS)
    ):  # fmt: skip
        np.testing.assert_allclose(positions(reflected), swap_sides(positions(poses), names), atol=0.01)


def test_a_looked_up_pose_has_its_end_effectors_where_the_query_had_them() -> None:
    database, body = small_database(), neutral()
    centre, yaw = np.array([0.4, 0.2, -2.7]), 0.6
    placed = canonical.place(database.poses[:20], database.offsets[:20], centre, yaw)
    seen = canonical.normalise(body.end_effector_positions(placed), np.tile(centre, (20, 1)), np.full(20, yaw))
    np.testing.assert_allclose(seen.reshape(20, 15), database.features[:20], atol=1e-6)


def test_the_frontal_centre_takes_away_most_of_what_turning_the_person_moves() -> None:
    poses = small_database().poses[:60].astype(np.float64)
    front, stand = observed_offsets(neutral(), poses)[:, :3], np.array([0.0, 0.0, -3.0])
    for yaw in np.radians([-40, 40]):
        turned = canonical.place(poses, np.zeros(4), stand, yaw)
        centres = [cloud_centre(seen_points(neutral(), pose)) for pose in turned]
        offsets = np.array([canonical.frontal_centre(centre, yaw) - stand for centre in centres])
        assert np.linalg.norm(np.median(offsets @ canonical.about_up(yaw) - front, axis=0)) < 0.035
    plain = np.array([0.0, 0.0, -3.0])
    shift = canonical.frontal_centre(plain, np.radians(40)) - plain
    assert shift @ [np.cos(np.radians(40)), 0.0, -np.sin(np.radians(40))] == pytest.approx(
        canonical.TRUNK_RADIUS * np.sin(np.radians(40))
    )
    np.testing.assert_array_equal(canonical.frontal_centre(plain, 0.0), plain)
