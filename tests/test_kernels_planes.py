"""The plane with the most points near it."""

import numpy as np
import pytest

from tests.test_kernels_linear import shifted
from toolkit.kernels.cloud.planes import largest_plane

TOLERANCE = 0.02


def scene(seed: int, noise: float = 0.004) -> tuple[np.ndarray, np.ndarray]:
    """Return 600 points near a plane, in scan order, among 900 others; and the plane (4,)."""
    rng = np.random.default_rng(seed)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    on = np.column_stack([rng.uniform(-1, 1, (600, 2)), rng.normal(0.0, noise, 600)]) @ frame.T
    others = rng.uniform(-1.5, 1.5, (900, 3))
    return np.concatenate([on, others]), np.append(frame[:, 2], 0.0)


def brute_support(points: np.ndarray, trials: int, seed: int) -> np.ndarray:
    """Return the members of the best sampled plane, one NumPy statement per plane."""
    best = np.empty(0, dtype=np.int64)
    for a, b, c in points[np.random.default_rng(seed).integers(len(points), size=(trials, 3))]:
        normal = np.cross(b - a, c - a)
        if np.linalg.norm(normal) > 1e-12:
            near = np.flatnonzero(np.abs((points - a) @ normal) <= TOLERANCE * np.linalg.norm(normal))
            best = near if len(near) > len(best) else best
    return best


@pytest.mark.parametrize("seed", range(5))
def test_the_plane_is_found_with_the_members_of_the_best_sample(seed: int) -> None:
    points, expected = scene(seed)
    plane, members = largest_plane(points, TOLERANCE, 400, np.random.default_rng(seed))
    assert members.tolist() == brute_support(points, 400, seed).tolist()
    assert abs(plane[:3] @ expected[:3]) > np.cos(np.deg2rad(1.0))
    assert abs(plane[3]) < 0.01
    assert np.linalg.norm(plane[:3]) == pytest.approx(1.0)


def test_one_seed_gives_one_plane_to_the_last_bit_wherever_the_points_lie() -> None:
    points, _ = scene(7)
    found = {
        largest_plane(shifted(points, offset), TOLERANCE, 300, np.random.default_rng(0))[0].tobytes()
        for offset in range(0, 64, 8)
    }
    assert len(found) == 1


def test_points_on_a_line_have_no_plane() -> None:
    points = np.outer(np.arange(20.0), [1.0, 2.0, 3.0])
    plane, members = largest_plane(points, TOLERANCE, 50, np.random.default_rng(0))
    assert not plane.any()
    assert not len(members)
