"""The pruned farthest-first selection against the plain one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from database_builder.sampling import farthest_first
from toolkit.io.errors import DatabaseError, UsageError


def plain_selection(points: np.ndarray, threshold: float, max_count: int) -> np.ndarray:
    """Return a farthest-first selection by the definition, float32 throughout."""
    selected = [0]
    nearest = np.sum((points - points[0]) ** 2, axis=1)
    while len(selected) < max_count:
        candidate = int(nearest.argmax())
        if not nearest[candidate] > (20 * threshold) ** 2:
            break
        selected.append(candidate)
        nearest = np.minimum(nearest, np.sum((points - points[candidate]) ** 2, axis=1))
    return np.array(selected)


def walk_of_poses(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return points along smooth random curves, similar to frames of mocap, float32 (count, 60)."""
    steps = rng.normal(size=(count, 8)).cumsum(axis=0) @ rng.normal(size=(8, 60))
    return (0.01 * steps + 0.002 * rng.normal(size=(count, 60))).astype(np.float32)


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 300),
    grid=st.sampled_from([0.0, 0.05, 1.0]),
    copies=st.booleans(),
    scale=st.sampled_from([1e-22, 1e-19, 1.0, 1e6]),
    threshold=st.sampled_from([0.0, 0.003, 0.018, 0.3]),
    limit=st.integers(1, 300),
)
@settings(max_examples=150, deadline=None)
def test_the_selection_equals_plain_farthest_first_with_ties_and_duplicates(
    seed: int, count: int, grid: float, copies: bool, scale: float, threshold: float, limit: int
) -> None:
    rng = np.random.default_rng(seed)
    points = walk_of_poses(rng, count)
    if grid:
        points = (np.round(points / grid) * grid).astype(np.float32)
    if copies:
        points = points[rng.integers(0, count, count)]
    points = (points * np.float32(scale)).astype(np.float32)
    expected = plain_selection(points, threshold * scale, limit)
    np.testing.assert_array_equal(farthest_first(points, threshold * scale, limit), expected)


def test_the_selection_equals_plain_farthest_first_on_many_poses() -> None:
    points = walk_of_poses(np.random.default_rng(3), 6000)
    expected = plain_selection(points, 0.01, 6000)
    assert len(expected) > 500
    np.testing.assert_array_equal(farthest_first(points, 0.01), expected)


@pytest.mark.parametrize(
    ("joints", "threshold", "limit", "error", "words"),
    [
        (np.zeros((0, 20, 3)), 0.018, None, DatabaseError, "no pose"),
        (np.zeros((5, 19, 3)), 0.018, None, DatabaseError, "expected"),
        (np.full((5, 20, 3), np.nan), 0.018, None, DatabaseError, "not finite"),
        (np.zeros((5, 20, 3)), -1.0, None, UsageError, "threshold"),
        (np.zeros((5, 20, 3)), float("nan"), None, UsageError, "threshold"),
        (np.zeros((5, 20, 3)), 0.018, 0, UsageError, "at least 1"),
    ],
)
def test_bad_input_is_named(
    joints: np.ndarray, threshold: float, limit: int | None, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        farthest_first(joints, threshold, limit)
