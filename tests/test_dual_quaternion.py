"""Dual quaternion skinning against its definition."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.support.dual_quaternions import dual_skinning
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.body.shape import load_body


def random_pose(seed: int) -> np.ndarray:
    """Return a pose within the limits."""
    rng = np.random.default_rng(seed)
    pose = rng.normal(0.0, 1.0, skeleton.POSE_SIZE)
    pose[6:] = rng.uniform(*skeleton.POSE_LIMITS[6:].T)
    return pose


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the product of quaternions w, x, y, z."""
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def plain(body: Body, pose: np.ndarray, vertex: int) -> np.ndarray:
    """Return one vertex by Kavan 2008, Eq. 5: the normalised sum of dual quaternions, applied."""
    placed, real, dual = body.place(pose), np.zeros(4), np.zeros(4)
    first = None
    for j, weight in zip(body.skin_joints[vertex], body.skin_weights[vertex], strict=True):
        q = np.roll(Rotation.from_matrix(placed.rotations[j]).as_quat(), 1)
        first = q if first is None else first
        q = q if first @ q >= 0 else -q
        moved = placed.origins[j] - placed.rotations[j] @ body.joints[j]
        real += weight * q
        dual += weight * 0.5 * product(np.array([0.0, *moved]), q)
    length = np.linalg.norm(real)
    real, dual = real / length, dual / length
    conjugate = real * [1, -1, -1, -1]
    shift = 2.0 * product(dual, conjugate)[1:]
    return product(product(real, np.array([0.0, *body.vertices[vertex]])), conjugate)[1:] + shift


def test_vertices_are_moved_by_the_normalised_sum_of_dual_quaternions() -> None:
    body = load_body("neutral")
    for seed in range(3):
        pose = random_pose(seed)
        found = dual_skinning(body, pose)
        for vertex in range(0, len(body.vertices), 37):
            np.testing.assert_allclose(found[vertex], plain(body, pose, vertex), atol=1e-9)
