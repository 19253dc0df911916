"""Quaternions and matrices against SciPy's rotations, and further properties."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from toolkit.body import skeleton
from toolkit.body.rotations import matrices, quaternions
from toolkit.body.rotations.matrices import of_euler
from toolkit.database import canonical
from toolkit.io.errors import MocapError
from toolkit.kernels import quaternions as compiled

RNG = np.random.default_rng(5)
FIRST, SECOND = Rotation.random(6, rng=1), Rotation.random(6, rng=2)


def wxyz(rotation: Rotation) -> np.ndarray:
    """Return a SciPy rotation as w, x, y, z."""
    return rotation.as_quat()[..., [3, 0, 1, 2]]


def about(axis: int, angles: np.ndarray) -> Rotation:
    """Return rotations about a coordinate axis."""
    return Rotation.from_rotvec(angles[:, None] * np.eye(3)[axis])


def same_turn(found: np.ndarray, expected: Rotation) -> None:
    """Return True for quaternions of one rotation; both signs count."""
    dots = (found * wxyz(expected)).sum(axis=-1)
    assert np.abs(dots) == pytest.approx(np.ones_like(dots))


def test_exponential_and_logarithm_are_there_and_back_the_shorter_way() -> None:
    vectors = FIRST.as_rotvec()
    same_turn(quaternions.exponential(vectors), FIRST)
    assert quaternions.logarithm(-quaternions.exponential(vectors)) == pytest.approx(vectors)
    for small in (np.array([1e-9, -2e-9, 0.0]), np.array([1e-13, -2e-13, 0.0])):
        assert quaternions.logarithm(quaternions.exponential(small)) == pytest.approx(small, rel=1e-6, abs=0.0)


@given(arrays(np.float64, (4, 3), elements=st.floats(-3.0, 3.0, allow_nan=False)))
def test_the_logarithm_undoes_the_exponential_up_to_a_full_turn(vectors: np.ndarray) -> None:
    q = quaternions.exponential(vectors)
    back = quaternions.logarithm(q)
    np.testing.assert_allclose(
        (Rotation.from_rotvec(back).inv() * Rotation.from_rotvec(vectors)).magnitude(), 0, atol=1e-7
    )
    np.testing.assert_allclose(quaternions.logarithm(-q), back, atol=1e-9)


def test_vectors_are_turned_and_matrices_have_them_as_columns() -> None:
    vectors = RNG.normal(size=(6, 3))
    assert quaternions.rotate(wxyz(FIRST), vectors) == pytest.approx(FIRST.apply(vectors))
    assert quaternions.matrices(wxyz(FIRST)) == pytest.approx(FIRST.as_matrix())
    same_turn(quaternions.from_matrices(FIRST.as_matrix()), FIRST)
    assert (quaternions.from_matrices(FIRST.as_matrix())[:, 0] >= 0.0).all()


@pytest.mark.parametrize("stop", [(0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
def test_the_smallest_turn_brings_one_direction_to_the_other(stop: tuple[float, float, float]) -> None:
    start = np.array([1.0, 0.0, 0.0])
    turned = matrices.swing(start, np.array(stop))[0]
    assert turned @ start == pytest.approx(np.array(stop), abs=1e-12) and np.linalg.det(turned) == pytest.approx(1.0)
    assert Rotation.from_matrix(turned).magnitude() == pytest.approx(np.arccos(start @ stop))


def test_compiled_rotations_are_those_of_scipy() -> None:
    vectors = np.concatenate([RNG.normal(0.0, 1.5, (50, 3)), RNG.normal(0.0, 1e-4, (50, 3)), np.zeros((1, 3))])
    yaws = RNG.uniform(-7.0, 7.0, len(vectors))
    found = np.empty_like(vectors)
    compiled.turned_vectors(yaws, vectors, found)
    assert found == pytest.approx((about(1, yaws) * Rotation.from_rotvec(vectors)).as_rotvec(), abs=1e-12)


def test_facing_is_perpendicular_to_the_left_axes_of_hips_and_chest() -> None:
    poses = np.zeros((8, skeleton.POSE_SIZE))
    poses[:, 3:12] = RNG.normal(0.0, 0.5, (8, 9))
    hips, lumbar, thorax = (Rotation.from_rotvec(poses[:, rows]) for rows in (slice(3, 6), slice(6, 9), slice(9, 12)))
    left = hips.apply([1.0, 0.0, 0.0]) + (hips * lumbar * thorax).apply([1.0, 0.0, 0.0])
    assert canonical.body_facing(poses) == pytest.approx(np.arctan2(-left[:, 2], left[:, 0]))


def test_small_letters_are_fixed_axes_and_capitals_rotate() -> None:
    angles = np.array([[10.0, 20.0, 30.0], [-40.0, 50.0, 60.0]])
    fixed, rotating = (of_euler(order, angles, degrees=True, name="test") for order in ("xyz", "XYZ"))
    assert np.allclose(fixed, of_euler("ZYX", angles[:, ::-1], degrees=True, name="test"))
    assert not np.allclose(fixed, rotating)
    assert np.allclose(of_euler("xyz", np.radians(angles[0]), degrees=False, name="test"), fixed[0])


@pytest.mark.parametrize("order", ["xxy", "xyzx", "abc", "xYz", ""])
def test_axes_that_cannot_be_are_refused(order: str) -> None:
    with pytest.raises(MocapError, match="turns about the axes"):
        of_euler(order, np.zeros((2, len(order))), degrees=True, name="test")
