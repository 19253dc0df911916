"""The counting behind the retrieval benchmarks, on made-up documents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import _keyframe_corpus as corpus
from benchmarks import _keyframe_ranking as ranking
from benchmarks import annotation, keyframes
from tests.retrieval_motions import random_motion
from toolkit.retrieval.annotation.annotator import Annotator, MotionClass
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery
from toolkit.retrieval.search.find import HitRanges
from toolkit.retrieval.templates import QuantisedTemplate


def document(name: str, frames: int, *segments: tuple[int, int, str]) -> corpus.LabelledDocument:
    return corpus.LabelledDocument(FeatureMatrix(name, np.zeros((40, frames), dtype=bool)), "bd", segments)


def hits(*ranges: tuple[int, int, int]) -> HitRanges:
    return HitRanges(*np.array(ranges, dtype=np.int64).reshape(-1, 3).T)


def test_alternatives_are_judged_by_what_any_of_them_leaves() -> None:
    documents = [document("a", 100, (10, 20, "hop"), (50, 60, "hop")), document("b", 100, (0, 10, "kick"))]
    found = [hits((0, 10, 20), (1, 0, 100)), hits((0, 15, 25), (0, 58, 63))]
    share, touched, half = keyframes.quality(found, documents, [0], "hop")
    assert (share, touched, half) == (0.2, 1.0, 0.5)
    assert keyframes.quality(found[:1], documents, [0], "hop") == (0.1, 0.5, 0.5)
    assert keyframes.relevant_share(documents, [0], "hop") == 0.2


def test_ranked_hits_find_each_motion_once_and_precision_falls_with_wrong_ones() -> None:
    documents = [document("a", 100, (10, 20, "hop"), (50, 60, "hop"), (70, 90, "kick"))]
    found = [ranking.Hit(0.1, 0, 11, 21), ranking.Hit(0.2, 0, 12, 19), ranking.Hit(0.3, 0, 52, 80)]
    right, relevant = ranking.right_ones(found, documents, "hop")
    assert right.tolist() == [True, False, True] and relevant == 2
    curve = ranking.precisions(right, relevant)
    assert curve[ranking.RECALLS <= 0.5].min() == 1.0
    np.testing.assert_allclose(curve[ranking.RECALLS > 0.51], 2 / 3)
    assert not ranking.precisions(np.zeros(0, dtype=bool), 3).any()


def test_hits_of_a_template_do_not_overlap_and_the_cheapest_comes_first() -> None:
    features = relational_features(random_motion(3))
    clip = features.sliced(20, 40)
    template = QuantisedTemplate(clip.values.astype(np.int8), np.ones(20))
    documents = [corpus.LabelledDocument(features, "bd", ())]
    found = ranking.ranked(template, documents, ranking.whole(documents))
    assert found[0] == ranking.Hit(0.0, 0, 20, 40)
    assert [hit.cost for hit in found] == sorted(hit.cost for hit in found)
    spans = sorted((hit.start, hit.stop) for hit in found)
    assert all(a[1] <= b[0] for a, b in zip(spans, spans[1:], strict=False))


def test_one_stiffness_for_all_gaps_keeps_keyframes_of_one_frame_together() -> None:
    keyframe = Keyframe("upper", (("F1", 1),))
    query = KeyframeQuery((keyframe,) * 3, ((0, 0), (5, 20)), 1, 2, "hop")
    assert ranking.stiffened(query, 1.0).bounds == ((0, 0), (10, 10))
    between = KeyframeQuery((keyframe,) * 2, ((1, 3),), 0, 0, "hop")  # its distance, 1.7, is no number of frames
    assert ranking.stiffened(between, 1.0).bounds == ((2, 2),)
    early = KeyframeQuery((keyframe,) * 2, ((0, 12),), 0, 0, "hop")
    assert ranking.stiffened(early, 0.5).bounds == ((3, 12),)
    assert ranking.stiffened(query, 0.0).bounds == ((0, 0), (0, None))
    assert ranking.stiffened(query, 0.5) == KeyframeQuery((keyframe,) * 3, ((0, 0), (5, 20)), 1, 2)


def test_the_summary_sets_data_left_against_what_is_relevant() -> None:
    rows = [
        {"label": "hop", "queries": 2, "milliseconds": ms, "relevant": 0.1, "left_hits": left, "left_motions": 0.4}
        for ms, left in ((1.0, 0.1), (3.0, 0.3))
    ]
    means = keyframes.summary(rows)
    assert (means["milliseconds"], means["worst_milliseconds"]) == (2.0, 3.0)
    assert means["left_hits_over_relevant"] == pytest.approx(2.0)
    assert means["left_motions_over_relevant"] == pytest.approx(4.0)


def test_the_line_through_the_origin_is_the_time_per_segment() -> None:
    slope, correlation = keyframes.line_through_origin(
        [{"segments": n, "milliseconds": 0.01 * n} for n in (100, 500, 2000)]
    )
    assert slope == pytest.approx(0.01) and correlation == pytest.approx(1.0)


def test_counterexamples_hold_no_labelled_frame_and_are_long_enough() -> None:
    made = document("a", 300, (20, 60, "hop"), (70, 100, "kick"))
    marked = FeatureMatrix("a", np.zeros((40, 300), dtype=bool))
    marked.values[0, 20:60] = marked.values[0, 70:100] = True
    pieces = corpus.unlabelled_pieces([corpus.LabelledDocument(marked, "bd", made.segments)])
    assert not any(piece.values.any() for piece in pieces)
    assert [len(piece) for piece in pieces] == [20, 90, 90, 20]
    assert len({piece.name for piece in pieces}) == 4


def test_documents_hold_the_clips_of_one_actor_and_name_their_frames() -> None:
    examples = [corpus.Example(random_motion(seed), "bd", label) for seed, label in enumerate(("squat1Reps", "kick"))]
    documents = corpus.make_documents(examples, [random_motion(9, seconds=8.0)], 200, np.random.default_rng(0))
    assert sum(len(made.features) for made in documents) >= 200
    for made in documents:
        assert made.actor == "bd"
        for first, stop, label in made.segments:
            assert 0 <= first < stop <= len(made.features) and label in ("squat1Reps", "kick")


def test_annotated_documents_hold_every_clip_once() -> None:
    examples = [corpus.Example(random_motion(seed), "bk", "kick") for seed in range(14)]
    documents = annotation.make_documents(examples, [random_motion(99, seconds=8.0)], 0)
    assert [len(segments) for _, segments, _ in documents] == [annotation.CLIPS_PER_DOCUMENT, 2]
    assert all(len(joins) >= len(segments) - 1 for _, segments, joins in documents)


def test_a_threshold_of_one_finds_no_less_than_a_stricter_one(tmp_path: Path) -> None:
    features = relational_features(random_motion(3))
    template = QuantisedTemplate(features.sliced(20, 40).values.astype(np.int8), np.ones(20))
    trained = annotation.Trained(Annotator([MotionClass("swing", template)]), [], 0.1)
    documents = [(features, (Segment(20 / 30, 40 / 30, "swing"),), ())]
    rows = [annotation.swept(trained, tau, documents, [{"swing": [(0, 60)]}]) for tau in annotation.THRESHOLDS]
    assert rows[0]["segments"].recall == 1.0
    found = [row["frames"].recall for row in rows]
    assert found == sorted(found)
    annotation.plot_thresholds(rows, tmp_path / "thresholds.png")
    assert (tmp_path / "thresholds.png").stat().st_size > 5_000


def test_a_confusion_matrix_is_drawn(tmp_path: Path) -> None:
    path = tmp_path / "confusion.png"
    annotation.plot_confusion(np.array([[3, 1], [0, 0]]), ["hop", "no class"], path, "made up")
    assert path.stat().st_size > 1000
