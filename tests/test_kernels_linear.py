"""Linear algebra in a fixed order: correct, and equal at all memory alignments."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.kernels import linear

RNG = np.random.default_rng(5)


def shifted(array: np.ndarray, offset: int) -> np.ndarray:
    """Return a copy that begins `offset` bytes after a multiple of 64."""
    memory = np.empty(array.nbytes + 128, dtype=np.uint8)
    start = -memory.ctypes.data % 64 + offset
    copy = memory[start : start + array.nbytes].view(array.dtype).reshape(array.shape)
    copy[:] = array
    return copy


def definite(size: int, rng: np.random.Generator) -> np.ndarray:
    root = rng.normal(size=(size, size))
    return root @ root.T + np.eye(size)


@pytest.mark.parametrize(
    ("function", "reference", "shapes"),
    [
        (linear.rotated, np.matmul, [(50, 3), (3, 3)]),
        (linear.times, np.matmul, [(20, 37), (37,)]),
        (linear.combined, lambda w, r: np.tensordot(w, r, axes=1), [(16,), (16, 30, 3)]),
        (linear.dot, np.dot, [(37,), (37,)]),
        (linear.lengths, lambda v: np.linalg.norm(v, axis=1), [(50, 3)]),
        (linear.distances_from_axis, lambda p, a: np.linalg.norm(np.cross(p, a), axis=1), [(50, 3), (3,)]),
        (linear.dots, lambda a, b: (a * b).sum(axis=1), [(50, 3), (50, 3)]),
        (linear.gram, lambda c, w: c.T @ np.diag(w) @ c, [(60, 16), (60,)]),
        (lambda r: linear.moments(r)[0], lambda r: r.mean(axis=0), [(60, 7)]),
        (lambda r: linear.moments(r)[1], lambda r: np.cov(r.T), [(60, 7)]),
    ],
)
def test_products_are_those_of_numpy_wherever_the_arrays_lie(
    function: Callable[..., np.ndarray], reference: Callable[..., np.ndarray], shapes: list[tuple[int, ...]]
) -> None:
    arrays = [RNG.normal(size=shape) for shape in shapes]
    found = np.asarray(function(*arrays))
    np.testing.assert_allclose(found, reference(*arrays), rtol=1e-12, atol=1e-13)
    for offset in (8, 16, 24, 40):
        assert np.asarray(function(*(shifted(array, offset) for array in arrays))).tobytes() == found.tobytes()


def test_points_of_any_shape_type_and_layout_are_rotated() -> None:
    points, rotation = RNG.normal(size=(2, 5, 3)).astype(np.float32), RNG.normal(size=(3, 3)).T
    expected = points.astype(np.float64) @ rotation
    np.testing.assert_allclose(linear.rotated(points, rotation), expected, rtol=1e-14)
    np.testing.assert_allclose(linear.rotated(points[:, ::2], rotation), expected[:, ::2], rtol=1e-14)
    np.testing.assert_allclose(linear.rotated(points[0, 0], rotation), expected[0, 0], rtol=1e-14)


@given(size=st.integers(1, 12), seed=st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_a_solution_solves_and_an_inverse_inverts(size: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, vector = definite(size, rng), rng.normal(size=size)
    np.testing.assert_allclose(matrix @ linear.solved(matrix, vector), vector, atol=1e-9)
    inverse = linear.inverse(matrix)
    np.testing.assert_allclose(matrix @ inverse, np.eye(size), atol=1e-9)
    assert (inverse == inverse.T).all()


def test_a_matrix_that_is_not_positive_definite_is_refused() -> None:
    with pytest.raises(ValueError, match="positive definite"):
        linear.solved(np.diag([1.0, -1.0]), np.ones(2))


@given(
    values=st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3),
    seed=st.integers(0, 1000),
    scale=st.sampled_from([1e-6, 1.0, 1e4]),
)
@settings(max_examples=60, deadline=None)
def test_principal_axes_are_orthonormal_and_give_the_matrix_back(values: list[float], seed: int, scale: float) -> None:
    frame = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    matrix = scale * frame @ np.diag(values) @ frame.T
    matrix = 0.5 * (matrix + matrix.T)
    found, axes = linear.principal_axes(matrix)
    assert (np.diff(found) >= 0.0).all()
    np.testing.assert_allclose(found, np.linalg.eigvalsh(matrix), atol=1e-13 * scale * 10)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-13)
    np.testing.assert_allclose(axes @ np.diag(found) @ axes.T, matrix, atol=1e-13 * scale * 10)
