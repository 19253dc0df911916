"""Euler angles of motion files: the compiled matrices against SciPy's."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from toolkit.body.rotations.matrices import of_euler
from toolkit.io.errors import MocapError

ORDERS = [
    "".join(axes)
    for count in (1, 2, 3)
    for axes in itertools.product("xyz", repeat=count)
    if all(a != b for a, b in itertools.pairwise(axes))
]


@pytest.mark.parametrize("order", [*ORDERS, *map(str.upper, ORDERS)])
def test_euler_angles_become_the_matrices_of_scipy_to_the_last_bit(order: str) -> None:
    angles = np.random.default_rng(len(order)).uniform(-400.0, 400.0, (40, len(order)))
    expected = Rotation.from_euler(order, angles, degrees=True).as_matrix()
    assert np.array_equal(of_euler(order, angles, degrees=True, name="test"), expected)
    one = of_euler(order, np.radians(angles[0]), degrees=False, name="test")
    assert np.array_equal(one, Rotation.from_euler(order, np.radians(angles[0])).as_matrix().reshape(3, 3))


@pytest.mark.parametrize("order", ["xxy", "xyzx", "abc", "xYz", ""])
def test_axes_that_cannot_be_are_refused(order: str) -> None:
    with pytest.raises(MocapError, match="turns about the axes"):
        of_euler(order, np.zeros((2, len(order))), degrees=True, name="test")
