"""Search by example: graded features, the compiled DTW against the recursion, and results."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.retrieval_motions import random_motion
from toolkit.kernels.motion import graded
from toolkit.kernels.motion.graded import distinct_hits, graded_distances
from toolkit.retrieval.features.grades import BLOCK_COLUMNS, FULL, coarse, grade
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.search.example import search_example


def written_recursion(
    template: np.ndarray, weights: np.ndarray, document: np.ndarray
) -> tuple[np.ndarray, list[list[int]]]:
    """Return the cheapest alignment cost that ends in each column, and all starts with this cost."""
    cells = (np.abs(template[:, None] - document[None].astype(np.float64)) * weights).sum(axis=2)
    n, length = cells.shape
    best = np.full((n, length), np.inf)
    starts: list[list[set[int]]] = [[set() for _ in range(length)] for _ in range(n)]
    for i in range(n):
        for j in range(length):
            steps = [(cells[0, j], {j})] if i == 0 else []
            for di, dj, weight in ((1, 1, 1), (1, 2, 1), (2, 1, 2)):
                if i - di >= 0 and j - dj >= 0:
                    steps.append((best[i - di, j - dj] + weight * cells[i, j], starts[i - di][j - dj]))
            best[i, j] = min((cost for cost, _ in steps), default=np.inf)
            for cost, origin in steps:
                if cost <= best[i, j] + 1e-3:
                    starts[i][j] |= origin
    return best[-1], [sorted(origin) for origin in starts[-1]]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 7), st.integers(1, 40), st.sampled_from([3, 8, 1024]))
def test_the_compiled_distance_is_the_written_recursion_for_any_tile(seed: int, n: int, length: int, tile: int) -> None:
    rng = np.random.default_rng(seed)
    template = rng.integers(-FULL, FULL + 1, (n, 40)).astype(np.float32)
    document = rng.integers(-FULL, FULL + 1, (length, 40)).astype(np.int8)
    weights = rng.random(40).astype(np.float32)
    starts = np.array([0, length // 3, length])
    cost, first = graded_distances(template, weights, document, starts)
    for a, b in zip(starts[:-1], starts[1:], strict=True):
        expected, origins = written_recursion(template, weights, document[a:b])
        np.testing.assert_allclose(cost[a:b], expected, rtol=1e-5)
        for j in np.flatnonzero(np.isfinite(expected)):
            assert not len(origins[j]) or first[a + j] in origins[j]


def test_a_document_of_many_tiles_has_the_distances_of_its_parts() -> None:
    rng = np.random.default_rng(4)
    document = rng.integers(-FULL, FULL + 1, (2 * graded.TILE + 100, 40)).astype(np.int8)
    template, weights = document[1000:1010].astype(np.float32), np.full(40, 0.025, np.float32)
    cost, first = graded_distances(template, weights, document, np.array([0, len(document)]))
    begin = graded.TILE - 60
    part, part_first = graded_distances(template, weights, document[begin:], np.array([0, len(document) - begin]))
    np.testing.assert_array_equal(cost[begin + 18 :], part[18:])
    np.testing.assert_array_equal(first[begin + 18 :], part_first[18:] + begin)
    assert cost.argmin() == 1009 and first[1009] == 1000


def test_the_cheapest_hits_come_first_and_the_same_motion_counts_once() -> None:
    cost = np.array([9, 5, 1, 2, 9, 3, 9, 0.5, 9], np.float32)
    start = np.array([0, 0, 0, 1, 2, 1, 3, 0, 1], np.int32)
    starts = np.array([0, 6, 9])
    assert distinct_hits(cost, start, starts, np.inf, 9).tolist() == [[1, 0, 1], [0, 0, 2], [0, 1, 5]]
    assert distinct_hits(cost, start, starts, np.inf, 1).tolist() == [[1, 0, 1]]
    assert distinct_hits(cost, start, starts, 2.0, 9).tolist() == [[1, 0, 1], [0, 0, 2]]
    wide = np.zeros(6, np.int32)
    lone = np.array([9, 9, 9, 1, 9, 3], np.float32)
    assert distinct_hits(lone, wide, starts[:2], np.inf, 9).tolist() == [[0, 0, 3]], "four of six columns are covered"


def test_a_grade_has_the_sign_of_its_feature_and_its_mean_is_the_coarse_one() -> None:
    features = relational_features(random_motion(3, seconds=3.1))
    assert features.grades.dtype == np.int8 and features.grades.shape == features.values.shape
    assert (features.grades[features.values] > -FULL // 2).all(), "hysteresis lies within the two thresholds"
    blocks = coarse(features.grades)
    assert blocks.shape == (40, -(-len(features) // BLOCK_COLUMNS))
    np.testing.assert_array_equal(
        blocks[:, 2], np.rint(features.grades[:, 2 * BLOCK_COLUMNS : 3 * BLOCK_COLUMNS].mean(axis=1))
    )
    np.testing.assert_array_equal(grade(np.zeros((40, 2))), 0)


def test_grades_follow_slices_and_are_extreme_where_only_booleans_are_known() -> None:
    features = relational_features(random_motion(5))
    np.testing.assert_array_equal(features.sliced(3, 9).grades, features.grades[:, 3:9])
    known = FeatureMatrix("booleans", features.values)
    np.testing.assert_array_equal(known.grades, np.where(features.values, FULL, -FULL))


@pytest.mark.parametrize("speed", [0.7, 1.0, 1.4])
def test_a_stretch_is_found_where_it_was_performed_slower_or_faster(speed: float) -> None:
    whole = random_motion(11, seconds=6.0)
    documents = [relational_features(random_motion(seed, seconds=8.0)) for seed in range(20, 25)]
    index = KeyframeIndex.build([*documents, relational_features(whole.at_speed(speed))])
    example = relational_features(whole).sliced(60, 120)
    best = search_example(index, example, limit=3)[0]
    assert best.document == index.names[-1]
    assert best.start == pytest.approx(2.0 / speed, abs=0.2) and best.end == pytest.approx(4.0 / speed, abs=0.2)
    assert best.cost < 0.05


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0, 120.0])
def test_an_example_finds_what_was_recorded_at_another_rate(rate: float) -> None:
    documents = [
        random_motion(seed, seconds=8.0, rate=r) for seed, r in zip(range(20, 24), (24, 30, 60, 120), strict=True)
    ]
    index = KeyframeIndex.build([relational_features(m) for m in (*documents, random_motion(11, 6.0, rate))])
    best = search_example(index, relational_features(random_motion(11, 6.0)).sliced(60, 120), limit=1)[0]
    assert best.document == "random 11"
    assert (best.start, best.end) == (pytest.approx(2.0, abs=0.15), pytest.approx(4.0, abs=0.15))
