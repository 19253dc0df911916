"""Hits of keyframes ranked by motion templates (thesis 3.6.3): a part of `depthmocap bench keyframes`."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks._keyframe_corpus import (
    ACTORS,
    HOW,
    LabelledDocument,
    by_label,
    documents_of_each,
    learned_from,
    load_examples,
    load_filler,
    make_documents,
)
from benchmarks._record import RESULTS, save_figures
from benchmarks._stiffness import admissible, distance_of, stiffness_of
from toolkit.io.files import atomic_path
from toolkit.retrieval.annotation.classes import learn_classes
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.learning.queries import LearningSettings
from toolkit.retrieval.search.find import HitRanges, find, pieces
from toolkit.retrieval.templates import QuantisedTemplate

STIFFNESS = (0.0, 0.3, 0.6, 0.8, 1.0)
"""Of all gaps in place of the learned ones, as in Fig. 3.15."""
LEARNED = "as learned"
RECALLS: np.ndarray = np.linspace(0.05, 1.0, 20)
"""At which precision is drawn."""
BINS: np.ndarray = np.linspace(0.0, 1.0, 11)
"""Of the histogram of stiffness values."""
COUNTEREXAMPLES = 15_000
"""Frames of each training actor's documents from which counterexamples are cut."""
COMMON = 0.5
"""Share of a true motion that a hit covers that finds it."""


class Hit(NamedTuple):
    """A ranked clip: cost, document, first frame and the one after the last."""

    cost: float
    document: int
    start: int
    stop: int


def stiffened(query: KeyframeQuery, stiffness: float) -> KeyframeQuery:
    """A query with one stiffness for all gaps, of whole frames; keyframes of the same frame stay together.

    The distance of a gap from 0 to n frames, which Eq. 4.8 loses, is taken to be half of n.
    """
    bounds = tuple(
        bound
        if bound == (0, 0)
        else admissible(round(distance_of(bound) if bound[0] else (bound[1] or 0) / 2), stiffness)
        for bound in query.bounds
    )
    return KeyframeQuery(query.keyframes, bounds, query.lead, query.tail, query.label)


def ranked(template: QuantisedTemplate, documents: Sequence[LabelledDocument], found: HitRanges) -> list[Hit]:
    """The alignments of a template within pieces of documents, the cheapest first; none overlaps a cheaper one."""
    hits = []
    for number, first, stop in zip(found.documents.tolist(), found.starts.tolist(), found.stops.tolist(), strict=True):
        costs, starts = template.distance(documents[number].features.words[first:stop])
        ends = np.arange(len(costs))
        while np.isfinite(costs).any():
            end = int(np.argmin(costs))
            hits.append(Hit(float(costs[end]), number, first + int(starts[end]), first + end + 1))
            costs[(ends >= starts[end]) & (starts <= end)] = np.inf
    return sorted(hits)


def whole(documents: Sequence[LabelledDocument]) -> HitRanges:
    """All of some documents."""
    numbers = np.arange(len(documents))
    return HitRanges(numbers, np.zeros_like(numbers), np.array([len(document.features) for document in documents]))


def right_ones(hits: Sequence[Hit], documents: Sequence[LabelledDocument], label: str) -> tuple[np.ndarray, int]:
    """Which hits find a motion of the class that none before found, bool (H,), and how many such motions there are."""
    left = {
        (number, a, b)
        for number in {hit.document for hit in hits}
        for a, b, name in documents[number].segments
        if name == label
    }
    right = np.zeros(len(hits), dtype=bool)
    for place, hit in enumerate(hits):
        for number, a, b in sorted(left):
            if number == hit.document and min(b, hit.stop) - max(a, hit.start) >= COMMON * (b - a):
                right[place] = True
                left.remove((number, a, b))
                break
    return right, sum(name == label for document in documents for _, _, name in document.segments)


def precisions(right: np.ndarray, relevant: int) -> np.ndarray:
    """Highest precision from each of `RECALLS` on, 0 where the recall is not reached."""
    found = np.cumsum(right)
    precision, recall = found / np.arange(1, len(right) + 1), found / max(relevant, 1)
    return np.array([precision[recall >= level - 1e-9].max(initial=0.0) for level in RECALLS])


def ranking(parser: argparse.ArgumentParser) -> None:
    """Learn, search, rank, print, draw, write JSON."""
    parser.add_argument("data", type=Path, help="the shared data folder")
    parser.add_argument("--frames", type=int, default=60_000, help="frames of the corpus at 30 Hz")
    parser.add_argument("--runs", type=int, default=2, help="genetic runs per class")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng, filler = np.random.default_rng(options.seed), load_filler(options.data)
    examples, rows, stiffness = load_examples(options.data), [], list[float]()
    for actor in ACTORS:
        seen, own = ([e for e in examples if (e.actor == actor) == here] for here in (False, True))
        documents = make_documents(own, filler[1::2], options.frames // len(ACTORS), rng)
        index = KeyframeIndex.build([document.features for document in documents])
        others = documents_of_each(seen, filler[0::2], COUNTEREXAMPLES, rng)
        learned = learned_from(seen, others, LearningSettings(runs=options.runs), rng)
        clips = {label: [e.features for e in seen if e.label == label] for label in by_label(seen)}
        classes = learn_classes(clips)
        ranked(classes[0].template, documents, whole(documents[:1]))  # loads the kernel
        for found in classes:
            (query,) = learned[found.label].alternatives(1)
            stiffness += [stiffness_of(bound) for bound in query.bounds if bound != (0, 0)]
            kinds = {LEARNED: query, **{f"{s:g}": stiffened(query, s) for s in STIFFNESS}}
            rows += [_row(kind, own_query, index, documents, found.template) for kind, own_query in kinds.items()]
        print(f"{actor} left out: {len(rows)} rankings", flush=True)
    figures = {"rows": rows, **summary(rows, np.array(stiffness))}
    for kind, means in figures["means"].items():
        print(f"{kind:12}", ", ".join(f"{key} {value:.3f}" for key, value in means.items() if key != "precisions"))
    plot(figures, RESULTS / "keyframe_ranking.png")
    settings = {"frames": options.frames, "runs": options.runs, "seed": options.seed, "corpus": HOW}
    print(save_figures("keyframe_ranking", figures, settings))


def _row(
    kind: str,
    query: KeyframeQuery,
    index: KeyframeIndex,
    documents: Sequence[LabelledDocument],
    template: QuantisedTemplate,
) -> dict[str, Any]:
    """One query searched and ranked."""
    reduced = pieces(index, query, find(index, query))
    begun = time.process_time()
    hits = ranked(template, documents, reduced)
    spent = time.process_time() - begun
    right, relevant = right_ones(hits, documents, query.label)
    precise = precisions(right, relevant)
    return {
        "stiffness": kind, "label": query.label, "relevant": relevant, "frames": reduced.frames,
        "cells": reduced.frames * template.expanded[0].shape[1], "milliseconds": 1000.0 * spent,
        "left": reduced.frames / index.frames,
        "recall": float(right.sum() / max(relevant, 1)), "precisions": precise.tolist(),
    }  # fmt: skip


def summary(rows: Sequence[dict[str, Any]], stiffness: np.ndarray) -> dict[str, Any]:
    """Means over classes and actors; time against what is left; the histogram of stiffness values (Fig. 4.4)."""
    means = {}
    for kind in (LEARNED, *(f"{s:g}" for s in STIFFNESS)):
        own = [row for row in rows if row["stiffness"] == kind]
        curve = np.mean([row["precisions"] for row in own], axis=0)
        means[kind] = {
            "recall": float(np.mean([row["recall"] for row in own])),
            "left": float(np.mean([row["left"] for row in own])),
            "milliseconds": float(np.mean([row["milliseconds"] for row in own])),
            "average precision": float(curve.mean()),
            "precisions": curve.tolist(),
        }
    cells, spent = (np.array([row[key] for row in rows], dtype=float) for key in ("cells", "milliseconds"))
    counts, _ = np.histogram(stiffness, BINS)
    return {
        "means": means,
        "nanoseconds_per_cell": float(1e6 * (cells @ spent) / (cells @ cells)),
        "correlation_of_time_and_cells": float(np.corrcoef(cells, spent)[0, 1]),
        "stiffness": {"bins": BINS.tolist(), "counts": counts.tolist(), "up to 0.8": float((stiffness <= 0.8).mean())},
    }


def plot(figures: dict[str, Any], path: Path) -> None:
    """Precision over recall by stiffness (Fig. 3.13 to 3.15), stiffness (3.9, 4.4), time of the ranking (3.12)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 3.8), layout="constrained")
    curves, histogram, times = figure.subplots(1, 3)
    for kind, means in figures["means"].items():
        line = {"color": "black", "lw": 2.0} if kind == LEARNED else {"lw": 1.1}
        curves.plot(RECALLS, means["precisions"], label=f"stiffness {kind}", **line)
    curves.set(xlabel="recall", ylabel="precision", xlim=(0, 1), ylim=(0, 1.02))
    curves.legend(fontsize=7)
    found = figures["stiffness"]
    histogram.bar(BINS[:-1], found["counts"], np.diff(BINS), align="edge", color="0.6", edgecolor="white")
    histogram.set(xlabel="stiffness of learned queries", ylabel="gaps", xlim=(0, 1))
    rows = [row for row in figures["rows"] if row["frames"]]
    times.loglog([row["frames"] for row in rows], [row["milliseconds"] for row in rows], ".", color="black", ms=3)
    times.set(xlabel="frames left to rank", ylabel="processor time of the ranking, ms")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110)
