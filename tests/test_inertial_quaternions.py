"""Quaternions against SciPy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from toolkit.body.rotations import quaternions as quat

vectors = arrays(np.float64, (4, 3), elements=st.floats(-3.0, 3.0, allow_nan=False))


def scipy_of(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.asarray(q)[..., [1, 2, 3, 0]])


@given(vectors)
def test_the_logarithm_undoes_the_exponential_up_to_a_full_turn(vector):
    q = quat.exponential(vector)
    np.testing.assert_allclose(quat.angle(quat.exponential(quat.logarithm(q)), q), 0.0, atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(quat.logarithm(q), axis=1), scipy_of(q).magnitude(), atol=1e-7)
    np.testing.assert_allclose(quat.logarithm(-q), quat.logarithm(q), atol=1e-9)


def test_matrices_and_euler_angles_become_the_same_quaternion():
    angles = np.radians([[10.0, -40.0, 100.0], [0.0, 20.0, -170.0]])
    q = quat.from_euler(angles)
    for angle, matrix in zip(angles, quat.matrices(q), strict=True):
        by_hand = Rotation.from_euler("z", angle[2]) * Rotation.from_euler("y", angle[1])
        by_hand = by_hand * Rotation.from_euler("x", angle[0])
        np.testing.assert_allclose(matrix, by_hand.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(quat.angle(quat.from_matrices(quat.matrices(q)), q), 0.0, atol=1e-7)


@pytest.mark.parametrize("stop", ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.6, 0.0, -0.8]))
def test_the_smallest_turn_brings_one_vector_on_to_another(stop):
    start = np.array([1.0, 0.0, 0.0])
    turn = quat.between(start, np.array(stop))
    np.testing.assert_allclose(quat.rotate(turn, start), stop, atol=1e-12)
    expected = np.arccos(np.clip(start @ stop, -1, 1))
    np.testing.assert_allclose(np.linalg.norm(quat.logarithm(turn)), expected, atol=1e-7)


def test_interpolation_runs_evenly_from_one_end_to_the_other():
    first, second = quat.exponential([[0.1, 0.2, 0.3]]), -quat.exponential([[1.1, -0.2, 0.3]])
    np.testing.assert_allclose(quat.angle(quat.interpolate(first, second, np.zeros(1)), first), 0.0, atol=1e-7)
    np.testing.assert_allclose(quat.angle(quat.interpolate(first, second, np.ones(1)), second), 0.0, atol=1e-7)
    third = quat.interpolate(first, second, np.full(1, 1 / 3))
    np.testing.assert_allclose(3 * quat.angle(first, third), quat.angle(first, second), atol=1e-7)


def test_the_mean_lies_among_its_members_and_follows_the_weights():
    rng = np.random.default_rng(3)
    centre = quat.normalised(rng.normal(size=4))
    q = quat.multiply(quat.exponential(0.05 * rng.normal(size=(200, 3))), centre)
    q *= np.where(rng.random(200) < 0.5, -1.0, 1.0)[:, None]
    assert quat.angle(quat.mean(q, np.ones(200)), centre) < 0.02
    np.testing.assert_allclose(quat.angle(quat.mean(q, np.eye(200)[7]), q[7]), 0.0, atol=1e-6)
