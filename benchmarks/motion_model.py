"""Annotation of new people by example clips and classifiers: `depthmocap bench motion_model DATA [--seeds 3]`.

For each of the HDM05 actors bd, bk and dg a motion model is learned from the clips of the other two, and documents of
the third are annotated; thresholds and classifiers are learned by leaving one training actor out. CMU subjects up to 8
are the motions of no class in training, those above 8 the filler of the reported documents.

Two sets of documents, put together from cut clips:
easy : blended joins, filler
hard : joins of at most 0.1 s, filler, and the mirror images of all clips of one-sided classes, which belong to none

The same documents are annotated by the model without motions of no class, and by the thesis's motion templates with a
learned threshold. Counterexamples at other speeds, no
grouping by person and the thresholds per class were chosen with the three rotations in view, so a new set has to
confirm the figures.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks import _keyframe_corpus as corpus
from benchmarks._record import benchmark, script
from toolkit.retrieval.annotation.annotator import Annotator
from toolkit.retrieval.annotation.classes import learn_classes
from toolkit.retrieval.annotation.documents import Document
from toolkit.retrieval.annotation.measures import Scores, frame_scores, label_frames, segment_scores
from toolkit.retrieval.annotation.model import MotionModel
from toolkit.retrieval.annotation.training import CutClip, documents_of, train, two_sided
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FEATURE_RATE
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.workflow.search_files import by_class

SETS = {"easy": False, "hard": True}
MODEL = "motion model"
"""Row of the model itself."""
DOUBT = 0.8
"""Maximum doubt of a search for classes."""
DRAWS = 2000
"""Bootstrap draws over people and seeds."""
NOTHING = Scores(0, 0, 0, 0)
Annotate = Any
"""Function from a feature matrix to an `Annotation`."""


def templates(clips: Sequence[CutClip], filler: Sequence[Motion], seed: int) -> Annotator:
    """Return the thesis's annotator, learned from the same clips, with its own threshold."""
    rng = np.random.default_rng(seed)
    folds = []
    for _, seen, unseen in corpus.left_out(clips):
        documents = documents_of(unseen, filler, rng, hard=False)
        folds.append(corpus.Fold(learn_classes(corpus.features_by_label(seen)), documents))
    classes = learn_classes(corpus.features_by_label(clips), threshold=corpus.learn_threshold(folds))
    return Annotator(classes)


def scores_on(annotate: Annotate, documents: Sequence[Document], labels: Sequence[str]) -> dict[str, Any]:
    """Return scores over frames and segments, per class, and confusions of an annotator on documents."""
    frames, segments, classes = NOTHING, NOTHING, dict.fromkeys(labels, NOTHING)
    table = np.zeros((len(labels) + 1, len(labels) + 1), dtype=np.int64)
    for document in documents:
        found = annotate(document.features)
        size = len(document.features), document.features.frame_rate
        true, marked = (label_frames(part, labels, *size) for part in (document.segments, found.segments))
        frames += frame_scores(true, marked)
        segments += segment_scores(document.segments, found.segments)
        for row, columns in enumerate([*true, ~true.any(axis=0)]):
            decided = np.where(marked.any(axis=0), marked.argmax(axis=0), len(labels))
            table[row] += np.bincount(decided[columns], minlength=len(labels) + 1)
        for label in labels:
            parts = ([s for s in side if s.label == label] for side in (document.segments, found.segments))
            classes[label] += segment_scores(*parts)
    return {"frames": frames, "segments": segments, "classes": classes, "confusion": table}


def found_by_search(model: MotionModel, documents: Sequence[Document]) -> np.ndarray:
    """Return the data that `depthmocap search --classes` leaves, over all classes: int64 (5,).

    Frames left, frames of true segments, segments of which a frame is left, segments of which half is left, segments.
    """
    index = KeyframeIndex.build(replace(d.features, name=str(k)) for k, d in enumerate(documents))
    total = np.zeros(5, dtype=np.int64)
    for report in by_class(index, model, doubt=DOUBT):
        truth = corpus.Truth(documents, report.label)
        frames, shares = truth.covered(
            (int(m.document), round(m.start * FEATURE_RATE), round(m.end * FEATURE_RATE)) for m in report.matches
        )
        total += [frames, truth.frames, (shares > 0).sum(), (shares >= 0.5).sum(), len(shares)]
    return total


def interval(rows: Sequence[dict[str, Any]], key: str) -> tuple[float, float]:
    """Return the 95 % interval of F by a bootstrap over left-out people and seeds."""
    counts = np.array([[r[key].right_found, r[key].found, r[key].right_true, r[key].true] for r in rows])
    draws = np.random.default_rng(0).integers(len(rows), size=(DRAWS, len(rows)))
    values = [Scores(*map(int, part)).f for part in counts[draws].sum(axis=1)]
    return float(np.percentile(values, 2.5)), float(np.percentile(values, 97.5))


def scores_of(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the scores of an annotator over all rotations and seeds, with their intervals."""
    frames, segments = (sum((row[key] for row in rows), NOTHING) for key in ("frames", "segments"))
    spread = [interval(rows, key) for key in ("frames", "segments")]
    return {
        "frames": frames.f, "segments": segments.f, "frames_interval": spread[0], "segments_interval": spread[1],
    }  # fmt: skip


class Measured(NamedTuple):
    """Results of each annotator and of searches per set of documents; seconds of training, and minutes annotated per
    second, of each model.
    """

    rows: dict[str, dict[str, list[dict[str, Any]]]]
    searched: dict[str, np.ndarray]
    training: list[float]
    annotated: list[float]


def rotate(
    measured: Measured, seen: Sequence[CutClip], unseen: Sequence[CutClip], filler: Sequence[Motion], seed: int
) -> None:
    """Learn from the others, annotate documents of one actor, and add the figures."""
    (early, late), clips = corpus.halves(filler), [*seen, *unseen]
    labels, symmetric = sorted({clip.label for clip in clips}), two_sided(clips)
    documents = {
        name: documents_of(unseen, late, np.random.default_rng([seed, 1]), hard=hard, symmetric=symmetric)
        for name, hard in SETS.items()
    }
    begin = time.process_time()
    model = train(seen, early, np.random.default_rng(seed))
    measured.training.append(time.process_time() - begin)
    others: dict[str, Annotate] = {"without motions of no class": train(seen, [], np.random.default_rng(seed)).annotate}
    if seed == 0:
        others["motion templates"] = templates(seen, early, seed).annotate
    for name, part in documents.items():
        measured.searched[name] += found_by_search(model, part)
        begin = time.process_time()
        measured.rows[name].setdefault(MODEL, []).append(scores_on(model.annotate, part, labels))
        spent = max(time.process_time() - begin, 1e-9)
        minutes = sum(document.features.duration for document in part) / 60.0
        measured.annotated.append(minutes / spent)
        for row, annotate in others.items():
            measured.rows[name].setdefault(row, []).append(scores_on(annotate, part, labels))


def figures_of(measured: Measured, name: str, labels: Sequence[str]) -> dict[str, Any]:
    """Return all figures of one set of documents."""
    results = measured.rows[name]
    figures: dict[str, Any] = {row: scores_of(found) for row, found in results.items()}
    figures["classes"] = {label: sum((r["classes"][label] for r in results[MODEL]), NOTHING).f for label in labels}
    frames, relevant, touched, half, segments = measured.searched[name].tolist()
    figures["search"] = {
        "touched": touched / segments,
        "half": half / segments,
        "left_over_relevant": frames / relevant,
    }
    table, names = sum(row["confusion"] for row in results[MODEL]), [*labels, "no class"]
    figures["confusion"] = {"labels": names, "frames": table}
    return figures


@benchmark(data=Path, seeds=3)
def motion_model(options: argparse.Namespace) -> tuple[str, Any]:
    """Learn and annotate in three rotations with several seeds."""
    clips, filler = corpus.load_examples(options.data), corpus.load_filler(options.data, corpus.HOLDS_A_CLASS)
    searched = {name: np.zeros(5, dtype=np.int64) for name in SETS}
    measured = Measured({name: {} for name in SETS}, searched, [], [])
    for seed in range(options.seeds):
        for _, seen, unseen in corpus.left_out(clips):
            rotate(measured, seen, unseen, filler, seed)
    labels = sorted({clip.label for clip in clips})
    figures: dict[str, Any] = {name: figures_of(measured, name, labels) for name in SETS}
    figures["seconds"] = {
        "training": float(np.median(measured.training)),
        "minutes annotated per second": float(np.median(measured.annotated)),
    }
    return "motion_model", figures


main = script(__name__, __doc__, motion_model)
