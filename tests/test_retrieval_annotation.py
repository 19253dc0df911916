"""Annotation: distance functions against the recursion, class decision, extension, measures, bad inputs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.retrieval_motions import random_motion
from toolkit.io.errors import RetrievalError
from toolkit.io.spans import spans
from toolkit.kernels.motion import dtw
from toolkit.retrieval.annotation.annotator import Annotator, MotionClass, segments_of
from toolkit.retrieval.annotation.measures import (
    Scores,
    Segment,
    check_truth,
    frame_scores,
    label_frames,
    segment_scores,
)
from toolkit.retrieval.features.relational import FeatureMatrix, pack, relational_features
from toolkit.retrieval.templates import WILDCARD, MotionTemplate, QuantisedTemplate

INF = np.inf


def plain_distance(template: QuantisedTemplate, document: np.ndarray) -> np.ndarray:
    """Return Equations 5.1 to 5.3 cell by cell: the cheapest alignment that ends in each frame."""
    n, length = len(template), document.shape[1]
    cost = np.full((n, length), INF)
    for i in range(n):
        column = template.values[:, i]
        known = column != WILDCARD
        for j in range(length):
            cell = np.mean(column[known] != document[known, j]) if known.any() else 0.0
            cell *= (template.weights[i] + 1) / 2 / n
            if i == 0:
                cost[i, j] = cell
                continue
            for di, dj, weight in ((1, 1, 1), (1, 2, 1), (2, 1, 2)):
                if i >= di and j >= dj:
                    cost[i, j] = min(cost[i, j], cost[i - di, j - dj] + weight * cell)
    return cost[-1]


def random_template(rng: np.random.Generator, length: int) -> QuantisedTemplate:
    values = rng.choice([0, 1, WILDCARD], size=(40, length)).astype(np.int8)
    if length > 2:
        values[:, 1] = WILDCARD
    return QuantisedTemplate(values, np.ones(length))


def noisy_class(label: str, seed: int) -> tuple[MotionClass, FeatureMatrix]:
    """Return a class learnt from three noisy copies of a movement, and the movement."""
    clean = relational_features(random_motion(seed))
    rng = np.random.default_rng(seed)
    copies = [FeatureMatrix(f"{label} {i}", clean.values ^ (rng.random(clean.values.shape) < 0.01)) for i in range(3)]
    return MotionClass(label, MotionTemplate.of(copies).quantised(), 0.04), clean


@given(st.integers(0, 10_000), st.integers(1, 9), st.integers(1, 25))
@settings(max_examples=60, deadline=None)
def test_the_compiled_distance_function_is_the_written_recursion(seed: int, n: int, length: int) -> None:
    rng = np.random.default_rng(seed)
    template = random_template(rng, n)
    document = rng.random((40, length)) < 0.5
    cost, start = template.distance(pack(document))
    expected = plain_distance(template, document)
    np.testing.assert_allclose(cost, expected, atol=1e-12)
    assert ((start == -1) == np.isinf(expected)).all()
    assert (start[np.isfinite(cost)] <= np.flatnonzero(np.isfinite(cost))).all()


def test_a_motion_within_a_document_is_found_where_it_is_at_half_and_double_speed() -> None:
    rng = np.random.default_rng(4)
    values = np.repeat(rng.random((40, 12)) < 0.5, 4, axis=1)
    template = QuantisedTemplate(values.astype(np.int8), np.ones(48))
    noise = rng.random((40, 40)) < 0.5
    for columns in (np.arange(48), np.arange(0, 48, 2), np.repeat(np.arange(48), 2)):
        document = np.concatenate([noise, values[:, columns], noise], axis=1)
        cost, start = template.distance(pack(document))
        end = int(cost.argmin())
        assert cost[end] < 0.06
        block = 4 * len(columns) / 48  # an alignment may omit most of the first and of the last block
        assert abs(end - (40 + len(columns) - 1)) < block and abs(start[end] - 40) < block


def test_every_hit_writes_its_cost_over_its_frames_as_published_and_the_cheaper_one_wins() -> None:
    cost = np.array([INF, 0.3, 0.05, 0.1, 0.2, 0.02, 0.3])
    start = np.array([-1, 0, 0, 1, 2, 2, 5])
    modified = dtw.spread_hits(cost, start, 0.13, 1.0)
    np.testing.assert_allclose(modified, [0.05, 0.05, 0.02, 0.02, 0.02, 0.02, INF])
    modified = dtw.spread_hits(np.array([0.5, 0.05, 0.2, 0.02]), np.array([0, 0, 1, 1]), 0.13, 1.0)
    np.testing.assert_allclose(modified, [0.05, 0.02, 0.02, 0.02])
    modified = dtw.spread_hits(np.array([0.5, 0.02, 0.2, 0.05]), np.array([0, 0, 1, 1]), 0.13, 1.0)
    np.testing.assert_allclose(modified, [0.02, 0.02, 0.05, 0.05])


def test_a_hit_mostly_within_cheaper_ones_is_the_same_motion() -> None:
    cost = np.array([0.5, 0.5, 0.02, 0.2, 0.05, 0.5, 0.04])
    start = np.array([0, 0, 0, 1, 1, 4, 4])
    both = dtw.spread_hits(cost, start, 0.13, 0.5)
    np.testing.assert_allclose(both, [0.02, 0.02, 0.02, INF, 0.04, 0.04, 0.04])
    np.testing.assert_allclose(dtw.spread_hits(cost, start, 0.13, 0.8)[3], 0.05)
    start[6] = 2
    np.testing.assert_allclose(dtw.spread_hits(cost, start, 0.13, 0.0)[3:], INF)
    np.testing.assert_allclose(dtw.spread_hits(cost, start, 0.13, 0.2)[3:], 0.04)


@given(st.lists(st.integers(0, 3), min_size=1, max_size=30), st.integers(0, 4))
def test_minima_are_the_last_frames_of_plateaus_below_both_sides_and_the_threshold(
    values: list[int], threshold: int
) -> None:
    padded = [9, *values, 9]
    expected = []
    for i in range(1, len(values) + 1):
        left = next(v for v in padded[i::-1] if v != padded[i])
        if left > padded[i] and padded[i + 1] > padded[i] and padded[i] < threshold:
            expected.append(i - 1)
    assert dtw.minima_below(np.array(values, dtype=float), float(threshold)).tolist() == expected


def test_intervals_restrict_a_class_to_their_frames_and_classes_without_any_are_not_searched() -> None:
    (first, a), (second, _) = noisy_class("swing", 1), noisy_class("bow", 2)
    gap = np.random.default_rng(0).random((40, 20)) < 0.5
    document = FeatureMatrix("twice", np.concatenate([a.values, gap, a.values], axis=1))
    annotator = Annotator([first, second])
    everywhere = annotator.annotate(document)
    restricted = annotator.annotate(document, {"swing": [(len(a) + 20, len(document))]})
    assert len(everywhere.segments) == 2
    assert restricted.segments == everywhere.segments[1:]


def test_a_document_shorter_than_every_template_is_refused_and_than_some_is_noted() -> None:
    rng = np.random.default_rng(0)
    classes = [MotionClass(f"c{n}", random_template(rng, n)) for n in (21, 61)]
    with pytest.raises(RetrievalError, match=r"'short' has 10 frames.*needs 11"):
        Annotator(classes).annotate(FeatureMatrix("short", np.zeros((40, 10), dtype=bool)))
    assert Annotator(classes).annotate(FeatureMatrix("fits", np.zeros((40, 11), dtype=bool))).too_long == ("c61",)


# Fig. 5.3: the thesis states class 1 in full, and of class 2 what makes the totals 10 true and 13 found
# frames, 3 true and 4 found segments. Frames count from 1 there.
TRUE = [Segment(1, 4, "class1"), Segment(7, 10, "class1"), Segment(3, 7, "class2")]
FOUND = [Segment(0, 3, "class1"), Segment(5, 7, "class1"), Segment(2, 7, "class2"), Segment(8, 11, "class2")]


def test_the_worked_example_has_its_frame_measures() -> None:
    labels = ("class1", "class2")
    scores = frame_scores(label_frames(TRUE, labels, 12, 1.0), label_frames(FOUND, labels, 12, 1.0))
    assert scores == Scores(6, 13, 6, 10)
    assert (round(scores.precision, 2), round(scores.recall, 2)) == (0.46, 0.60)
    assert scores.f == pytest.approx(2 * (6 / 13) * 0.6 / (6 / 13 + 0.6))


def test_the_worked_example_has_its_segment_measures() -> None:
    scores = segment_scores(TRUE, FOUND)
    assert scores == Scores(2, 4, 2, 3)
    assert (scores.precision, round(scores.recall, 2)) == (0.50, 0.67)


def test_scores_of_documents_add_up_and_nothing_found_among_nothing_is_perfect() -> None:
    assert Scores(1, 2, 1, 3) + Scores(2, 2, 2, 2) == Scores(3, 4, 3, 5)
    assert Scores(0, 0, 0, 0).f == 1.0
    assert Scores(0, 0, 0, 4).f == 0.0
    assert Scores(0, 3, 0, 0).precision == 0.0


def test_true_segments_that_overlap_or_end_before_they_start_are_refused() -> None:
    check_truth(TRUE, "fine")
    with pytest.raises(RetrievalError, match=r"'squat' of doc overlap \(0 to 2 s and 1 to 3 s\)"):
        check_truth([Segment(0, 2, "squat"), Segment(1, 3, "squat")], "doc")
    with pytest.raises(RetrievalError, match="from 2.0 s to 1.0 s"):
        check_truth([Segment(2.0, 1.0, "squat")], "doc")


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 1.0])
def test_segments_are_the_runs_of_each_class_with_their_smallest_distance(share: float) -> None:
    rng = np.random.default_rng(3)
    frames, distances = rng.random((3, 40)) < share, rng.random((3, 40))
    plain = [
        Segment(run.start / 30.0, run.stop / 30.0, "abc"[row], 1.0 - distances[row, run].min())
        for row in range(3)
        for run in spans(frames[row])
    ]
    assert segments_of(frames, distances, "abc", 30.0) == sorted(plain, key=lambda s: (s.start, s.end, s.label))
