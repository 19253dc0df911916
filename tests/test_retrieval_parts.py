"""Windows, hits, gaps, bridges and measures of retrieval on made-up numbers."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks._keyframe_corpus import confusion
from tests.support.bootstrap import paired_bootstrap
from toolkit.io.errors import RetrievalError
from toolkit.retrieval.annotation.measures import Segment, check_truth, frame_scores, label_frames, segment_scores
from toolkit.retrieval.priors.bridge import End, bridge
from toolkit.retrieval.priors.gaps import find_gaps, limb_support
from toolkit.retrieval.priors.limb_entries import LIMBS, OUTER
from toolkit.retrieval.search.find import HitRanges, pieces

INDEX = SimpleNamespace(document_starts=np.array([0, 100, 200]), names=["a", "b"])


def ranges(*hits: tuple[int, int, int]) -> HitRanges:
    """Pieces by document, first frame and the frame after the last one."""
    documents, starts, stops = (np.array(column) for column in zip(*hits, strict=True))
    return HitRanges(documents, starts, stops, 7)


def listed(found: HitRanges) -> list[tuple[int, int, int]]:
    return list(zip(found.documents.tolist(), found.starts.tolist(), found.stops.tolist(), strict=True))


def test_longer_windows_stay_inside_their_document_and_join_where_they_overlap() -> None:
    hits = ranges((0, 5, 10), (0, 30, 40), (0, 95, 98), (1, 2, 4))
    assert listed(hits.extended(INDEX, 8, 6)) == [(0, 0, 16), (0, 22, 46), (0, 87, 100), (1, 0, 10)]
    assert listed(hits.extended(INDEX, 10, 12)) == [(0, 0, 52), (0, 85, 100), (1, 0, 16)]
    assert listed(ranges((0, 5, 10), (0, 14, 20)).extended(INDEX, 2, 2)) == [(0, 3, 12), (0, 12, 22)]
    assert hits.frames == 20 and hits.extended(INDEX, 1, 1).processed == 7


def test_a_query_s_lead_and_tail_say_how_far_the_refined_search_looks() -> None:
    query = SimpleNamespace(lead=4, tail=10)
    assert listed(pieces(INDEX, query, ranges((1, 50, 60)))) == [(1, 38, 90)]
    assert listed(pieces(INDEX, query, ranges((1, 50, 60)), factor=1.0)) == [(1, 46, 70)]


LIMB = next(iter(LIMBS))


def confidence(*hidden: tuple[int, int, float]) -> np.ndarray:
    """Sure of everything but one limb in these frames."""
    values = np.ones((40, 20))
    for start, stop, value in hidden:
        values[start:stop, OUTER[LIMB]] = value
    return values


@pytest.fixture
def unsmoothed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gaps by the confidence of single frames."""
    monkeypatch.setattr("toolkit.retrieval.priors.gaps.SMOOTHING", 1)


def gaps_of(values: np.ndarray, absent: slice = slice(0, 0)) -> list[tuple[int, int]]:
    present = np.ones(len(values), dtype=bool)
    present[absent] = False
    return [(gap.start, gap.stop) for gap in find_gaps(values, present) if gap.limb == LIMB]


def test_a_gap_is_hidden_somewhere_and_goes_on_where_the_limb_is_seen_badly(unsmoothed: None) -> None:
    assert gaps_of(confidence((8, 20, 0.79), (10, 15, 0.2))) == [(8, 20)]
    assert gaps_of(confidence((8, 20, 0.79))) == []
    assert gaps_of(confidence((8, 20, 0.81), (10, 15, 0.2))) == [(10, 15)]
    assert gaps_of(confidence((10, 13, 0.2))) == [] and gaps_of(confidence((10, 14, 0.2))) == [(10, 14)]


def test_near_gaps_are_one_unless_nobody_was_there_between_them(unsmoothed: None) -> None:
    values = confidence((5, 11, 0.2), (13, 20, 0.2))
    assert gaps_of(values) == [(5, 20)]
    assert gaps_of(values, absent=slice(11, 12)) == [(5, 11), (13, 20)]
    assert gaps_of(confidence((5, 11, 0.2), (14, 20, 0.2))) == [(5, 11), (14, 20)]
    assert gaps_of(confidence((5, 20, 0.2)), absent=slice(10, 14)) == [(5, 10), (14, 20)]


def test_confidence_is_averaged_over_the_outer_joints_and_over_frames() -> None:
    values = np.ones((7, 20))
    values[3, OUTER[LIMB]] = 0.4
    assert limb_support(values, 3)[LIMB] == pytest.approx([1.0, 1.0, 0.8, 0.8, 0.8, 1.0, 1.0])
    values[3, OUTER[LIMB][0]] = 1.0
    assert limb_support(values, 1)[LIMB][3] == pytest.approx((1.0 + 2 * 0.4) / 3)


START, STOP = End(np.array([0.3]), np.array([0.01])), End(np.array([-0.2]), np.array([0.04]))


def bridged(seconds: list[float], length: float, memory: float, start: End | None, end: End | None):
    expected = np.full((len(seconds), 1), 1.0)
    return bridge(expected, np.full_like(expected, 0.5), memory, np.array(seconds), length, start, end)


def test_a_bridge_meets_both_ends_and_follows_the_class_far_from_them() -> None:
    found = bridged([1e-9, 5.0, 10.0 - 1e-9], 10.0, 0.5, START, STOP)
    assert found.mean[:, 0] == pytest.approx([1.3, 1.0, 0.8], abs=1e-3)
    assert found.variance[:, 0] == pytest.approx([0.01, 0.25, 0.04], abs=1e-3)


def test_a_short_bridge_runs_straight_and_keeps_the_equation() -> None:
    length, memory, u = 0.4, 2.0, 0.1
    found = bridged([u], length, memory, START, STOP)
    near, far = (
        np.sinh((length - u) / memory) / np.sinh(length / memory),
        np.sinh(u / memory) / np.sinh(length / memory),
    )
    free = 2.0 * 0.25 * np.sinh(u / memory) * np.sinh((length - u) / memory) / np.sinh(length / memory)
    assert found.mean[0, 0] == pytest.approx(1.0 + 0.3 * near - 0.2 * far)
    assert found.variance[0, 0] == pytest.approx(free + near**2 * 0.01 + far**2 * 0.04, rel=0.05)


def test_an_open_end_is_forgotten_with_the_memory() -> None:
    for start, end, expected in ((START, None, 1.0 + 0.3 * np.exp(-0.5)), (None, STOP, 1.0 - 0.2 * np.exp(-1.0))):
        found = bridged([0.5], 1.5, 1.0, start, end)
        assert found.mean[0, 0] == pytest.approx(expected)
    share = np.exp(-0.5)
    variance = 0.25 * (1.0 - share**2) + share**2 * 0.01
    assert bridged([0.5], 1.5, 1.0, START, None).variance[0, 0] == pytest.approx(variance)


def test_segments_are_right_where_one_of_the_same_label_overlaps() -> None:
    true = [Segment(0.0, 1.0, "kick"), Segment(2.0, 3.0, "jump"), Segment(4.0, 5.0, "kick")]
    found = [Segment(0.9, 1.4, "kick"), Segment(1.0, 1.2, "kick"), Segment(2.0, 3.0, "kick")]
    scores = segment_scores(true, found)
    assert (scores.right_found, scores.found, scores.right_true, scores.true) == (1, 3, 1, 3)
    assert scores.precision == pytest.approx(1 / 3) and scores.f == pytest.approx(1 / 3)
    twice = scores + scores
    assert (twice.right_found, twice.found, twice.right_true, twice.true) == (2, 6, 2, 6)


def test_frames_bear_labels_from_the_first_to_before_the_end() -> None:
    frames = label_frames([Segment(0.1, 0.3, "b"), Segment(-0.2, 0.1, "a")], ["a", "b"], 5, 10.0)
    assert frames.astype(int).tolist() == [[1, 0, 0, 0, 0], [0, 1, 1, 0, 0]]
    scores = frame_scores(frames, np.array([[1, 1, 0, 0, 0], [0, 0, 1, 1, 0]], dtype=bool))
    assert (scores.right_found, scores.found, scores.right_true, scores.true) == (2, 4, 2, 3)
    assert scores.precision == 0.5 and scores.recall == pytest.approx(2 / 3)
    with pytest.raises(RetrievalError, match="'c' is not one of the classes a, b"):
        label_frames([Segment(0.0, 1.0, "c")], ["a", "b"], 5, 10.0)


def test_nothing_found_where_nothing_is_true_is_right() -> None:
    nothing = frame_scores(np.zeros((1, 3), bool), np.zeros((1, 3), bool))
    assert (nothing.precision, nothing.recall, nothing.f) == (1.0, 1.0, 1.0)
    missed = frame_scores(np.ones((1, 3), bool), np.zeros((1, 3), bool))
    assert (missed.precision, missed.recall, missed.f) == (0.0, 0.0, 0.0)


def test_confusion_counts_frames_by_what_they_are_and_what_they_are_said_to_be() -> None:
    true = np.array([[1, 1, 0, 0, 0], [0, 1, 1, 0, 0]], dtype=bool)
    table = confusion(true, np.array([0, 1, -1, 1, -1]))
    assert table.tolist() == [[1, 1, 0], [0, 1, 1], [0, 1, 1]]


def test_true_segments_that_cannot_be_are_refused() -> None:
    check_truth([Segment(0.0, 1.0, "kick"), Segment(1.0, 2.0, "kick"), Segment(0.5, 1.5, "jump")], "x")
    with pytest.raises(RetrievalError, match="runs from 2.0 s to 1.0 s"):
        check_truth([Segment(2.0, 1.0, "kick")], "x")
    with pytest.raises(RetrievalError, match="overlap"):
        check_truth([Segment(0.0, 3.0, "kick"), Segment(1.0, 2.0, "kick"), Segment(2.5, 4.0, "kick")], "x")


def test_a_paired_bootstrap_keeps_the_pairs_together() -> None:
    second = np.linspace(10.0, 100.0, 30)
    found = paired_bootstrap(second + 1.0, second, np.random.default_rng(0), samples=500)
    assert (found.mean, found.low, found.high, found.probability_above_zero) == pytest.approx((1.0, 1.0, 1.0, 1.0))
    alone = paired_bootstrap(np.array([1.0]), np.array([3.0]), np.random.default_rng(0))
    assert (alone.mean, alone.probability_above_zero) == (-2.0, 0.0)
