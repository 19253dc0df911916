"""Motion templates: the compiled alignment against recursions, steps of the estimator, quantisation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.retrieval_motions import random_motion
from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion import dtw
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.templates import WILDCARD, MotionTemplate, QuantisedTemplate, contract, expand


def clips(count: int = 5, seed: int = 0) -> list[FeatureMatrix]:
    """Return feature matrices of one random movement at different speeds, each with some entries inverted."""
    rng = np.random.default_rng(seed)
    base = relational_features(random_motion(seed)).values
    found = []
    for number in range(count):
        length = int(rng.integers(40, 80))
        values = base[:, np.rint(np.linspace(0, base.shape[1] - 1, length)).astype(int)]
        found.append(FeatureMatrix(f"clip {number}", values ^ (rng.random(values.shape) < 0.02)))
    return found


def plain_align(x: np.ndarray, wx: np.ndarray, y: np.ndarray, wy: np.ndarray) -> tuple[float, list[tuple[int, int]]]:
    """Return the alignment by the recursion on Python floats; ties: diagonal, then the warped sequence alone."""
    n, m = x.shape[1], y.shape[1]
    total = np.full((n, m), np.inf)
    step: dict[tuple[int, int], tuple[int, int]] = {}
    for i in range(n):
        for j in range(m):
            cell = np.mean(np.abs(x[:, i] - y[:, j])) * (wx[i] + wy[j]) / 2
            options = [(i - 1, j - 1), (i, j - 1), (i - 1, j)]
            options = [(a, b) for a, b in options if a >= 0 and b >= 0]
            if not options:
                total[i, j] = cell
                continue
            step[i, j] = min(options, key=lambda o: total[o])
            total[i, j] = total[step[i, j]] + cell
    path = [(n - 1, m - 1)]
    while path[0] in step:
        path.insert(0, step[path[0]])
    return float(total[-1, -1]), path


@given(st.integers(0, 10_000), st.integers(1, 12), st.integers(1, 12))
@settings(max_examples=60, deadline=None)
def test_the_compiled_alignment_is_the_plain_recursion(seed: int, n: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.integers(0, 5, (8, n)) / 4.0, rng.integers(0, 5, (8, m)) / 4.0  # eighths: sums are exact, ties are real
    wx, wy = rng.integers(1, 4, n) / 2.0, rng.integers(1, 4, m) / 2.0
    cost, path = dtw.align(x, wx, y, wy)
    expected, expected_path = plain_align(x, wx, y, wy)
    assert cost == pytest.approx(expected, abs=1e-12)
    assert [tuple(p) for p in path.tolist()] == expected_path


def test_warping_shares_out_the_weight_of_a_column_that_is_matched_twice() -> None:
    path = np.array([[0, 0], [1, 0], [2, 1], [2, 2]])
    values, weights = dtw.warp(path, np.array([[0.0, 1.0, 0.0]]), np.array([1.0, 3.0, 1.0]), 3)
    np.testing.assert_allclose(values, [[0.0, 0.0, 0.75]])
    np.testing.assert_allclose(weights, [0.5, 0.5, 4.0])


@given(st.lists(st.floats(0.05, 4.0), min_size=1, max_size=30))
def test_time_adaptation_keeps_the_weight_and_ends_with_columns_of_about_one_frame(weights: list[float]) -> None:
    columns = np.random.default_rng(0).random((3, len(weights)))
    values, adapted = expand(columns, np.array(weights))
    values, adapted = contract(values, adapted, 0.75)
    assert adapted.sum() == pytest.approx(sum(weights))
    np.testing.assert_allclose((values * adapted).sum(axis=1), (columns * weights).sum(axis=1))
    if sum(weights) >= 0.75:
        assert adapted.min() >= 0.75 - 1e-12


def test_equal_clips_are_their_own_template() -> None:
    clip = clips(1)[0]
    template = MotionTemplate.of([clip, clip, clip])
    np.testing.assert_array_equal(template.values, clip.values)
    np.testing.assert_array_equal(template.weights, np.ones(len(clip)))


def test_a_template_is_about_as_long_as_its_clips_on_average_and_shows_what_they_share() -> None:
    training = clips(6)
    template = MotionTemplate.of(training)
    assert template.weights.sum() == pytest.approx(np.mean([len(clip) for clip in training]), rel=0.05)
    shared = np.abs(template.values - 0.5) > 0.3
    assert shared.mean() > 0.8


def test_the_strict_variant_keeps_only_what_all_clips_agree_on() -> None:
    training = clips(4)
    strict = MotionTemplate.of(training, strict=True)
    assert set(np.unique(strict.values)) <= {0.0, 0.5, 1.0}
    loose = MotionTemplate.of(training).quantised(delta=0.05)
    assert strict.quantised(delta=0.0).wildcards.mean() > loose.wildcards.mean()


def test_a_differing_entry_costs_its_share_of_a_column_by_the_columns_weight() -> None:
    values = np.zeros((40, 2), dtype=np.int8)
    values[10:, 1] = WILDCARD
    bits, mask, scale = QuantisedTemplate(values, np.array([1.4, 0.8])).packed
    assert bits.tolist() == [0, 0] and mask.tolist() == [2**40 - 1, 2**10 - 1]
    np.testing.assert_allclose(scale, [0.5 * 2.4 / (40 * 2), 0.5 * 1.8 / (10 * 2)])  # Eq. 5.2, over the whole length


@pytest.mark.parametrize("delta", [-0.1, 0.5, 0.8])
def test_a_quantisation_threshold_outside_its_range_is_refused(delta: float) -> None:
    with pytest.raises(RetrievalError, match=str(delta)):
        MotionTemplate.of(clips(1)).quantised(delta=delta)
