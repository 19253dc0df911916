"""Database query against brute force, by each provider, whole and partial."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.database_helpers import small_database
from toolkit.database.pose_search import Open3DSearch, ScanSearch
from toolkit.io.errors import DatabaseError
from toolkit.kernels.cloud import nearest


def brute_force(features: np.ndarray, queries: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Return all distances (M, N) over the used coordinates, float64."""
    difference = queries[:, None].astype(np.float64) - features[None].astype(np.float64)
    return np.sqrt((difference**2 * used[:, None]).sum(axis=2))


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 1500),
    k=st.integers(1, 12),
    partial=st.booleans(),
    grid=st.booleans(),
    provider=st.sampled_from((ScanSearch, Open3DSearch)),
)
@settings(max_examples=60, deadline=None)
def test_neighbours_equal_brute_force_for_every_provider(
    seed: int, count: int, k: int, partial: bool, grid: bool, provider: type[ScanSearch | Open3DSearch]
) -> None:
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(count, 15)).astype(np.float32)
    if grid:  # many equal distances
        features = np.round(features).astype(np.float32)
    queries = np.concatenate([features[:2], rng.normal(size=(3, 15))]).astype(np.float32)
    present = rng.random((len(queries), 5)) < 0.6 if partial else np.ones((len(queries), 5), dtype=bool)
    present[~present.any(axis=1), 0] = True
    used = np.repeat(present, 3, axis=1)
    k = min(k, count)
    distances, indices = provider(features).query(queries, k, used)
    expected = brute_force(features, queries, used)
    np.testing.assert_allclose(distances, np.sort(expected, axis=1)[:, :k], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(np.take_along_axis(expected, indices, axis=1), distances, rtol=1e-5, atol=1e-5)
    assert all(len(set(row)) == k for row in indices.tolist())


def test_of_equal_distances_the_compiled_search_names_the_lowest_index_first() -> None:
    features = np.zeros((900, 15), dtype=np.float32)
    used = np.ones((1, 15), dtype=bool)
    _, indices = ScanSearch(features).query(np.zeros((1, 15), np.float32), 6, used)
    np.testing.assert_array_equal(indices, [np.arange(6)])


def test_a_missing_end_effector_does_not_count() -> None:
    database = small_database()
    query = database.features[4].copy()
    query[3:6] = np.nan
    present = np.array([True, False, True, True, True])
    distances, indices = database.query(query, 2, present)
    assert indices[0, 0] == 4 and distances[0, 0] == 0.0


@pytest.mark.parametrize(
    ("features", "k", "present", "words"),
    [
        (np.zeros((2, 14)), 1, None, "expected"),
        (np.zeros((2, 15)), 0, None, "k >= 1"),
        (np.full((2, 15), np.nan), 1, None, "not finite"),
        (np.zeros((2, 15)), 1, np.zeros((2, 5), dtype=bool), "end effector in every row"),
        (np.zeros((2, 15)), 1, np.ones((3, 5), dtype=bool), "end effector in every row"),
    ],
)
def test_a_query_that_cannot_work_is_refused(
    features: np.ndarray, k: int, present: np.ndarray | None, words: str
) -> None:
    with pytest.raises(DatabaseError, match=words):
        small_database().query(features, k, present)


@pytest.mark.parametrize("rows", [5, 1024, 2500])
def test_the_weighted_nearest_rows_are_those_of_a_sort(rows: int) -> None:
    rng = np.random.default_rng(rows)
    # whole numbers: ties occur and float32 is exact
    columns = rng.integers(-3, 4, (4, rows)).astype(np.float32)
    query, weights = rng.integers(-3, 4, 4).astype(np.float32), np.array([1, 0, 2, 1], dtype=np.float32)
    distances, indices = np.empty(5, dtype=np.float32), np.empty(5, dtype=np.int64)
    nearest.weighted_nearest(query[None], weights[None], columns, distances[None], indices[None])
    squares = (weights[:, None] * (columns - query[:, None]) ** 2).sum(axis=0)
    expected = np.lexsort((np.arange(rows), squares))[:5]
    assert indices.tolist() == expected.tolist()
    assert distances.tolist() == squares[expected].tolist()
