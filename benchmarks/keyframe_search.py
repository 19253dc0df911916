"""Keyframe search over 3.5 hours: `depthmocap bench keyframe_search DATA [--frames 378000] [--runs 24]`.

Documents are made from HDM05 clips and CMU motions (see `benchmarks/_keyframe_corpus.py`), a third of them per actor.
For each actor, queries for the 11 classes are learned from the cut clips of the other two, at three speeds and three
proportions, and from unlabelled pieces of documents made of their clips and half of the CMU motions; the other half of
the CMU motions is the filler of what is searched. Every query searches the whole index; recall and data left are
counted on the documents of the actor left out.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks._keyframe_corpus import (
    ACTORS,
    HOW,
    Example,
    LabelledDocument,
    learned_from,
    load_examples,
    load_filler,
    make_documents,
)
from benchmarks._record import RESULTS, save_figures
from benchmarks._timing import pin_to_one_processor
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery, in_sequence
from toolkit.retrieval.learning.genetic import Breeder
from toolkit.retrieval.learning.queries import LearnedQuery, LearningSettings, query_of
from toolkit.retrieval.search.find import HitRanges, find, pieces

COUNTEREXAMPLES = 30_000
"""Frames of the documents from which counterexamples are cut."""
ALTERNATIVES = ((1, False), (2, False), (1, True), (2, True), (3, True), (5, True))
"""Queries per class that are tried together, a hit of any counting, and whether their distances are tightened."""
REPEATS = 20
"""Searches per query; the median counts."""
KINDS = ("learned", "sequences", "random columns")
SHOWN = ("queries", "tight", "milliseconds", "segments", "relevant", "left_hits", "touched_hits", "half_motions")
UNSPECIFIC = 8
"""Queries of random template columns per class, which process many more segments than learned ones."""


def timed(index: KeyframeIndex, query: KeyframeQuery) -> dict[str, Any]:
    """Median time of a search and the number of segments in its inverted lists."""
    milliseconds = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        ranges = find(index, query)
        milliseconds.append(1000 * (time.perf_counter() - begin))
    median = float(np.median(milliseconds))
    return {"milliseconds": median, "segments": ranges.processed, "keyframes": len(query.keyframes)}


def quality(
    found: Sequence[HitRanges], documents: Sequence[LabelledDocument], chosen: Sequence[int], label: str
) -> tuple[float, float, float]:
    """Share of the chosen documents' frames left; shares of the true segments touched, and at least half left."""
    left = {number: np.zeros(len(documents[number].features), dtype=bool) for number in chosen}
    for ranges in found:
        for document, start, stop in zip(ranges.documents, ranges.starts, ranges.stops, strict=True):
            if int(document) in left:
                left[int(document)][start:stop] = True
    covered = np.array(
        [
            left[number][start:stop].mean()
            for number in chosen
            for start, stop, name in documents[number].segments
            if name == label
        ]
    )
    share = float(np.concatenate(list(left.values())).mean())
    return share, float(np.mean(covered > 0)), float(np.mean(covered >= 0.5))


def relevant_share(documents: Sequence[LabelledDocument], chosen: Sequence[int], label: str) -> float:
    """Share of the chosen documents' frames that lie in true segments of the class."""
    true = sum(b - a for number in chosen for a, b, name in documents[number].segments if name == label)
    return true / sum(len(documents[number].features) for number in chosen)


def judged(
    index: KeyframeIndex,
    documents: Sequence[LabelledDocument],
    actor: str,
    result: LearnedQuery,
    count: int,
    tight: bool,
) -> dict[str, Any]:
    """Everything about `count` learned queries of a class taken together."""
    queries = result.alternatives(count, tight)
    chosen = [number for number, document in enumerate(documents) if document.actor == actor]
    timings = [timed(index, query) for query in queries]
    row: dict[str, Any] = {"label": result.label, "left_out": actor, "queries": len(queries), "tight": tight}
    row |= {key: sum(timing[key] for timing in timings) for key in timings[0]}
    row["relevant"] = relevant_share(documents, chosen, result.label)
    for name, factor in (("hits", 0.0), ("motions", 1.0), ("refined_search", 3.0)):
        row[f"left_{name}"], row[f"touched_{name}"], row[f"half_{name}"] = quality(
            [pieces(index, query, find(index, query), factor) for query in queries], documents, chosen, result.label
        )
    return row


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Means over classes and actors, the worst time, and data left as a multiple of what is relevant."""
    keys = [key for key, value in rows[0].items() if isinstance(value, float)]
    means = {key: float(np.mean([row[key] for row in rows])) for key in keys}
    means["worst_milliseconds"] = float(np.max([row["milliseconds"] for row in rows]))
    means["left_hits_over_relevant"] = means["left_hits"] / means["relevant"]
    means["left_motions_over_relevant"] = means["left_motions"] / means["relevant"]
    return means


def sequences(learned: dict[str, LearnedQuery], rng: np.random.Generator, count: int = 9) -> list[KeyframeQuery]:
    """Queries for two or three different actions in a row (Section 3.6.2)."""
    queries = [result.query for result in learned.values()]
    chosen = [rng.permutation(len(queries))[: 2 + i % 2] for i in range(count)]
    return [
        in_sequence([queries[i] for i in order], [60] * (len(order) - 1), [0.2] * (len(order) - 1)) for order in chosen
    ]


def plot_times(entries: dict[str, list[dict[str, Any]]], slope: float, path: Path) -> None:
    """Time against processed segments on logarithmic axes, as Fig. 3.10."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4.2), layout="constrained")
    axes = figure.subplots()
    for name, rows in entries.items():
        axes.loglog([r["segments"] for r in rows], [r["milliseconds"] for r in rows], ".", label=name)
    segments = [row["segments"] for rows in entries.values() for row in rows]
    span = np.array([min(segments), max(segments)], dtype=float)
    axes.loglog(span, slope * span, color="0.6", linewidth=1, label=f"{1e6 * slope:.1f} ns per segment", zorder=0)
    axes.set(xlabel="segments in the inverted lists", ylabel="keyframe search, ms")
    axes.grid(alpha=0.3, which="both")
    axes.legend()
    figure.savefig(path, dpi=120)


def through_file(documents: Sequence[LabelledDocument]) -> tuple[KeyframeIndex, dict[str, Any]]:
    """The index as the command uses it: written, opened again, mapped."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motions.index"
        begin = time.perf_counter()
        KeyframeIndex.build([document.features for document in documents]).save(path)
        middle = time.perf_counter()
        index = KeyframeIndex.open(path)
        end = time.perf_counter()
        runs = {name: len(lists.run_vectors) for name, lists in index.sets.items()}
        size = path.stat().st_size
    return index, {
        "documents": len(index), "frames": index.frames, "minutes": index.duration / 60, "bytes": size, "runs": runs,
        "build_seconds": middle - begin, "open_milliseconds": 1000 * (end - middle),
    }  # fmt: skip


def line_through_origin(rows: Sequence[dict[str, Any]]) -> tuple[float, float]:
    """Slope (ms per segment) of time over segments, and the correlation of the two."""
    segments = np.array([row["segments"] for row in rows], dtype=float)
    times = np.array([row["milliseconds"] for row in rows])
    return float(segments @ times / (segments @ segments)), float(np.corrcoef(segments, times)[0, 1])


class Measured(NamedTuple):
    """Times of searches by kind of query; figures of classes by the number of queries and whether they are tight."""

    timed: dict[str, list[dict[str, Any]]]
    together: dict[tuple[int, bool], list[dict[str, Any]]]


def rotate(
    measured: Measured, index: KeyframeIndex, documents: Sequence[LabelledDocument], examples: Sequence[Example],
    filler: Sequence[Motion], actor: str, settings: LearningSettings, rng: np.random.Generator,
) -> None:  # fmt: skip
    """Learn from the others, search the documents of one actor, and add what comes of it."""
    seen = [example for example in examples if example.actor != actor]
    made: list[LabelledDocument] = []
    for other in sorted({example.actor for example in seen}):
        own = [example for example in seen if example.actor == other]
        made.extend(make_documents(own, filler, COUNTEREXAMPLES // 2, rng))
    learned = learned_from(seen, made, settings, rng)
    for label, result in learned.items():
        for count, tight in ALTERNATIVES:
            row = judged(index, documents, actor, result, count, tight)
            measured.together[count, tight].append(row)
            print(f"{label:28s} {actor}", *(f"{row[key]:.3g}" for key in SHOWN), sep="  ", flush=True)
        measured.timed["learned"].extend(timed(index, query) for query in result.alternatives(1))
        breeder = Breeder(result.template, settings.genetic, rng)
        random = [query_of(breeder.individual(), len(result.template), label) for _ in range(UNSPECIFIC)]
        measured.timed["random columns"].extend(timed(index, query) for query in random)
    measured.timed["sequences"].extend(timed(index, query) for query in sequences(learned, rng))


def main() -> None:
    """Parse the command line, measure, print and store the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="the shared data folder")
    parser.add_argument("--frames", type=int, default=378_000, help="frames of the corpus at 30 Hz")
    parser.add_argument("--runs", type=int, default=24, help="genetic runs per class")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    rng = np.random.default_rng(options.seed)
    examples, filler = load_examples(options.data), load_filler(options.data)
    documents: list[LabelledDocument] = []
    for actor in ACTORS:
        own = [example for example in examples if example.actor == actor]
        documents.extend(make_documents(own, filler[1::2], options.frames // len(ACTORS), rng))
    index, size = through_file(documents)
    print(f"{size['documents']} documents, {size['frames']} frames, {size['minutes']:.0f} minutes", flush=True)

    measured = Measured({kind: [] for kind in KINDS}, {chosen: [] for chosen in ALTERNATIVES})
    pin_to_one_processor()
    for actor in ACTORS:
        rotate(measured, index, documents, examples, filler[0::2], actor, LearningSettings(runs=options.runs), rng)

    entries, together = measured
    slope, correlation = line_through_origin([row for part in entries.values() for row in part])
    figures = {
        "index": size,
        "together": {
            f"{count} per class{', tight' if tight else ''}": summary(rows) for (count, tight), rows in together.items()
        },
        "mean_milliseconds_of_sequences": float(np.mean([row["milliseconds"] for row in entries["sequences"]])),
        "nanoseconds_per_segment": 1e6 * slope,
        "correlation_of_time_and_segments": correlation,
        "classes": [
            {key: value for key, value in row.items() if not key.endswith("refined_search")}
            for rows in together.values()
            for row in rows
        ],
        "timed": entries,
    }
    whole = all(getattr(options, name) == parser.get_default(name) for name in ("frames", "runs"))
    name = "keyframe_search" if whole else "keyframe_search_part"
    plot_times(entries, slope, RESULTS / f"{name}.png")
    for row, means in figures["together"].items():
        print(row, *(f"{key} {value:.3f}" for key, value in means.items()), sep="  ")
    for key in ("mean_milliseconds_of_sequences", "nanoseconds_per_segment", "correlation_of_time_and_segments"):
        print(key, figures[key])
    chosen = {"frames": options.frames, "runs": options.runs, "seed": options.seed, "corpus": HOW}
    print(save_figures(name, figures, chosen))


if __name__ == "__main__":
    main()
