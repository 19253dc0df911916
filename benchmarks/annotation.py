"""Annotation by the thesis's motion templates: `depthmocap bench annotation PART`, which is one of

- `thesis DATA [--runs 30]`: for each of the HDM05 actors bd, bk and dg, motion templates, keyframes and one threshold
  are learned from the cut clips of the other two, and documents of this one are annotated, without and with keyframe
  preselection (thesis 5.4, Table 5.2), and with keyframes at one threshold after the other (Fig. 5.6). The threshold is
  chosen by learning templates and keyframes from each training actor alone and annotating documents of the other with
  both. Nothing is chosen on the actor that is reported. Documents are put together from cut clips, with blended joins
  and unlabelled filler.
- `events [--split report] [--queries FILE] [--threshold 0.06]`: motion events during tracking. True poses of the
  sequences of `tests/support/labelled.py`, with other motions between the clips, on the neutral body's proportions;
  classes of the other actors. F over segments of the events against that of annotation of the whole, both without
  keyframes unless a file of queries is given; seconds from the end of a motion to its event; milliseconds of processor
  time per frame.
"""

from __future__ import annotations

import argparse
import time
import timeit
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._events import told_events
from benchmarks._keyframe_corpus import (
    ACTORS,
    Example,
    Fold,
    LabelledDocument,
    confusion,
    learn_threshold,
    learned_from,
    load_examples,
    load_filler,
)
from benchmarks._record import RESULTS, run_part, save_figures
from toolkit.retrieval.annotation.annotation_report import plot_annotation
from toolkit.retrieval.annotation.annotator import AS_PUBLISHED, Annotator, DecisionSettings, Intervals
from toolkit.retrieval.annotation.classes import learn_classes
from toolkit.retrieval.annotation.documents import assemble, shuffled_parts
from toolkit.retrieval.annotation.measures import Scores, Segment, frame_scores, label_frames, segment_scores
from toolkit.retrieval.annotation.preselection import preselect
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.keyframes.query_file import load_queries, save_queries
from toolkit.retrieval.learning.genetic import GeneticSettings
from toolkit.retrieval.learning.queries import LearningSettings

CLIPS_PER_DOCUMENT = 12
HOLDS_A_CLASS = ("02_03", "02_04", "02_06", "10_04", "49_02", *(f"49_{n:02d}" for n in range(3, 13)))
"""CMU motions left out of the filler: a jog, jumps and hops, a bend to the floor, a kick, acrobatics."""
LAST_TRAINING_SUBJECT = 8
"""Last CMU subject whose motions are filler in training; the others are filler of the reported documents."""
HOW = (
    "documents put together from cut HDM05 clips of one actor (12 each), joined by eased straight lines of 0.25 to "
    "1.5 s, with excerpts of CMU walks, punches and swordplay before every second clip; joins and filler bear no "
    "label; 'without joins' leaves the frames of the joins out of the count"
)
COUNTEREXAMPLES = 3
"""Number of document sets of a training actor's clips whose unlabelled parts are counterexamples."""
ALTERNATIVES = 2
"""Keyframe queries per class."""
VARIANTS: dict[str, tuple[bool, DecisionSettings]] = {
    "without keyframes": (False, DecisionSettings()),
    "with keyframes": (True, DecisionSettings()),
    "without keyframes, rules as published": (False, AS_PUBLISHED),
    "with keyframes, rules as published": (True, AS_PUBLISHED),
}
"""Name -> True with keyframe preselection, and the rule for overlapping hits."""
THRESHOLDS = tuple(round(0.02 * step, 2) for step in range(1, 13))
"""`tau` of Fig. 5.6, with the thesis's own rules."""
MEASURES = ("frames", "segments")
RELEVANT_SHARE = 0.1
"""Fraction of labelled frames in the second timed corpus."""
Labelled = tuple[FeatureMatrix, tuple[Segment, ...], tuple[tuple[float, float], ...]]
"""Features of a document, its true segments and its joins."""


@dataclass(frozen=True, eq=False)
class Trained:
    """Templates, threshold and keyframes learned from two actors."""

    annotator: Annotator
    queries: list[KeyframeQuery]
    threshold: float


def make_documents(examples: Sequence[Example], filler: Sequence[Motion], seed: int) -> list[Labelled]:
    """Return all clips of one actor in documents of `CLIPS_PER_DOCUMENT` clips with filler between."""
    clips = [(example.motion, example.label) for example in examples]
    groups: list[list[tuple[Motion, str | None]]] = [[]]
    for part in shuffled_parts(clips, filler, np.random.default_rng(seed)):
        if sum(label is not None for _, label in groups[-1]) == CLIPS_PER_DOCUMENT:
            groups.append([])
        groups[-1].append(part)
    documents = [assemble(f"{examples[0].actor} {i}", group) for i, group in enumerate(groups, start=1)]
    return [(relational_features(d.motion), d.segments, d.joins) for d in documents]


def classes_of(examples: Sequence[Example]) -> dict[str, list[FeatureMatrix]]:
    """Return feature matrices of each class."""
    found: dict[str, list[FeatureMatrix]] = {}
    for example in examples:
        found.setdefault(example.label, []).append(relational_features(example.motion))
    return found


def train(
    examples: Sequence[Example], filler: Sequence[Motion], options: argparse.Namespace, kept: Path | None
) -> Trained:
    """Return templates, threshold and keyframes from the clips of some actors and filler of the training subjects.

    Keyframes are learned in this run, unless `kept` is a file of an earlier one; where it is missing it is written.
    """
    folds = []
    for actor in sorted({example.actor for example in examples}):
        seen, unseen = ([e for e in examples if (e.actor == actor) == out] for out in (False, True))
        unknown = [(features, segments) for features, segments, _ in make_documents(unseen, filler, options.seed)]
        folds.append(Fold(learn_classes(classes_of(seen)), unknown, keyframes_of(seen, filler, options)))
    threshold = learn_threshold(folds)
    if kept is not None and kept.exists():
        queries = load_queries(kept)
    else:
        queries = keyframes_of(examples, filler, options)
        if kept is not None:
            save_queries(kept, queries)
    return Trained(Annotator(learn_classes(classes_of(examples), threshold=threshold)), queries, threshold)


def keyframes_of(
    examples: Sequence[Example], filler: Sequence[Motion], options: argparse.Namespace
) -> list[KeyframeQuery]:
    """Return keyframes learned from clips, with unlabelled parts of their documents as counterexamples."""
    settings = LearningSettings(genetic=GeneticSettings(generations=options.generations), runs=options.runs)
    made: list[LabelledDocument] = []
    for actor in sorted({example.actor for example in examples}):
        own = [example for example in examples if example.actor == actor]
        for number in range(COUNTEREXAMPLES):
            made.extend(
                LabelledDocument(features, actor, tuple((*s.frames(FEATURE_RATE), s.label) for s in segments))
                for features, segments, _ in make_documents(own, filler, options.seed + 100 + number)
            )
    learned = learned_from(examples, made, settings, np.random.default_rng(options.seed))
    return [query for result in learned.values() for query in result.alternatives(ALTERNATIVES)]


def measured(trained: Trained, documents: Sequence[Labelled]) -> dict[str, Any]:
    """Return scores, confusion matrix and searched fraction, without and with keyframes, of one actor's documents."""
    labels = trained.annotator.labels
    index = KeyframeIndex.build([features for features, _, _ in documents])
    intervals = preselect(index, trained.queries, labels)
    frames = sum(len(features) for features, _, _ in documents)
    result: dict[str, Any] = {"threshold": trained.threshold, "minutes": frames / 1800.0}
    searched = sum(stop - start for found in intervals for pieces in found.values() for start, stop in pieces)
    result["share_searched"] = searched / (frames * len(labels))
    for name, (narrowed, rules) in VARIANTS.items():
        annotator = Annotator(trained.annotator.classes, rules)
        totals = dict.fromkeys(("frames", "frames without joins", "segments"), Scores(0, 0, 0, 0))
        table = np.zeros((len(labels) + 1, len(labels) + 1), dtype=np.int64)
        annotations = []
        for number, (features, segments, joins) in enumerate(documents):
            found = annotator.annotate(features, intervals[number] if narrowed else None)
            true = label_frames(segments, labels, len(features), features.frame_rate)
            joined = [Segment(start, end, "join") for start, end in joins]
            counted = ~label_frames(joined, ("join",), len(features), features.frame_rate)[0]
            totals["frames"] += frame_scores(true, found.frames)
            totals["frames without joins"] += frame_scores(true[:, counted], found.frames[:, counted])
            totals["segments"] += segment_scores(segments, found.segments)
            table += confusion(true, found.decided)
            annotations.append((frame_scores(true, found.frames).f, found, segments))
        result[name] = {"scores": totals, "confusion": table, "annotations": annotations}
    result["over thresholds"] = [swept(trained, threshold, documents, intervals) for threshold in THRESHOLDS]
    return result


def swept(
    trained: Trained, threshold: float, documents: Sequence[Labelled], intervals: Sequence[Intervals]
) -> dict[str, Scores]:
    """Return scores over frames and segments with keyframes and a common threshold (Fig. 5.6)."""
    classes = [replace(known, threshold=threshold) for known in trained.annotator.classes]
    annotator, found = Annotator(classes, AS_PUBLISHED), dict.fromkeys(MEASURES, Scores(0, 0, 0, 0))
    for (features, segments, _), own in zip(documents, intervals, strict=True):
        annotation = annotator.annotate(features, own)
        true = label_frames(segments, annotator.labels, len(features), features.frame_rate)
        found["frames"] += frame_scores(true, annotation.frames)
        found["segments"] += segment_scores(segments, annotation.segments)
    return found


def plot_thresholds(rows: Sequence[dict[str, Scores]], path: Path) -> None:
    """Plot precision, recall and F over thresholds, of frames and segments, as in Fig. 5.6."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    for panel, measure in zip(figure.subplots(1, 2), MEASURES, strict=True):
        for key, colour in (("precision", "black"), ("recall", "tab:red"), ("f", "tab:green")):
            panel.plot(THRESHOLDS, [getattr(row[measure], key) for row in rows], color=colour, label=key)
        panel.set(title=measure, xlabel="threshold", ylim=(0, 1.02))
        panel.grid(alpha=0.3)
    figure.axes[0].legend(fontsize=8)
    figure.savefig(path, dpi=110)


def speed(trained: Trained, parts: Sequence[FeatureMatrix], minutes: float) -> dict[str, float]:
    """Return CPU seconds to annotate a document of about `minutes`, made of repeated parts, and the speed-up.

    Where keyframes leave a share of the data, it can be at most 1 over that.
    """
    values = np.concatenate([features.values for features in parts], axis=1)
    repeats = max(1, round(minutes * 1800.0 / values.shape[1]))
    features = FeatureMatrix("all", np.tile(values, (1, repeats)))
    index = KeyframeIndex.build([features])
    annotator = trained.annotator
    without = _cpu_seconds(lambda: annotator.annotate(features))
    search = _cpu_seconds(find := lambda: preselect(index, trained.queries, annotator.labels))
    both = _cpu_seconds(lambda: annotator.annotate(features, find()[0]))
    left = sum(stop - start for pieces in find()[0].values() for start, stop in pieces)
    return {
        "minutes": len(features) / 1800.0, "seconds_without_keyframes": without, "seconds_with_keyframes": both,
        "seconds_of_the_keyframe_search": search, "share_searched": left / (len(features) * len(annotator.labels)),
        "speed_up": without / both,
    }  # fmt: skip


def diluted(documents: Sequence[Labelled], filler: Sequence[Motion]) -> list[FeatureMatrix]:
    """Return the documents with filler, so that labelled frames are `RELEVANT_SHARE` of all."""
    labelled = sum(segment.end - segment.start for _, segments, _ in documents for segment in segments)
    total = sum(features.duration for features, _, _ in documents)
    matrices = [relational_features(motion) for motion in filler]
    wanted = (labelled / RELEVANT_SHARE - total) / sum(matrix.duration for matrix in matrices)
    return [*(features for features, _, _ in documents), *matrices * max(0, round(wanted))]


def _cpu_seconds(run: Callable[[], object], repeats: int = 5) -> float:
    """Return the smallest CPU time of some runs."""
    return min(timeit.repeat(run, timer=time.process_time, repeat=repeats, number=1))


def hdm05(options: argparse.Namespace) -> dict[str, Any]:
    """Yield all three rotations."""
    examples = load_examples(options.data)
    filler = {name: motion for motion in load_filler(options.data) if (name := motion.name) not in HOLDS_A_CLASS}
    training = [m for name, m in filler.items() if int(name.split("_")[0]) <= LAST_TRAINING_SUBJECT]
    reporting = [m for name, m in filler.items() if int(name.split("_")[0]) > LAST_TRAINING_SUBJECT]
    rotations: dict[str, dict[str, Any]] = {}
    speeds = {}
    for actor in ACTORS:
        seen, unseen = ([e for e in examples if (e.actor == actor) == out] for out in (False, True))
        kept = options.queries and options.queries / f"without_{actor}.json"
        trained = train(seen, training, options, kept)
        documents = make_documents(unseen, reporting, options.seed + 1)
        rotations[actor] = measured(trained, documents)
        dense = [features for features, _, _ in documents]
        speeds[actor] = {
            "documents": speed(trained, dense, options.minutes),
            "with more filler": speed(trained, diluted(documents, reporting), options.minutes),
        }
        _print_rotation(actor, rotations[actor], speeds[actor])
    totals = {name: _summed([rotations[a][name]["scores"] for a in ACTORS]) for name in VARIANTS}
    for name in VARIANTS:
        print(f"all actors, {name}: {_line(totals[name])}")
    tables = {name: sum(rotations[a][name]["confusion"] for a in ACTORS) for name in list(VARIANTS)[:2]}
    thresholds = [_summed([rotations[a]["over thresholds"][place] for a in ACTORS]) for place in range(len(THRESHOLDS))]
    plot_thresholds(thresholds, RESULTS / "annotation_thresholds.jpg")
    names = [*trained.annotator.labels, "no class"]
    plot_confusion(tables["with keyframes"], names, RESULTS / "annotation_confusion.jpg", "HDM05, frames")
    done = [annotation for r in rotations.values() for annotation in r["with keyframes"]["annotations"]]
    whole = [annotation for annotation in done if len(annotation[2]) == CLIPS_PER_DOCUMENT]
    ranked = sorted(whole, key=lambda item: item[0])
    for name, (_, found, segments) in (("bad", ranked[0]), ("good", ranked[-1])):
        plot_annotation(found, segments).savefig(RESULTS / f"annotation_{name}.jpg", dpi=110)
    feature_seconds = _cpu_seconds(lambda: [relational_features(e.motion) for e in examples], repeats=2)
    feature_seconds *= options.minutes * 60.0 / sum(e.motion.duration for e in examples)
    print(f"relational features of {options.minutes:.0f} minutes at 120 Hz: {feature_seconds:.1f} s")
    return {
        "documents": HOW,
        "features": {"minutes": options.minutes, "cpu_seconds": feature_seconds},
        "all_actors": {name: _scores(total) for name, total in totals.items()},
        "over_thresholds": {f"{tau:g}": _scores(row) for tau, row in zip(THRESHOLDS, thresholds, strict=True)},
        "by_actor_left_out": {
            actor: {
                "threshold": r["threshold"], "minutes": r["minutes"], "share_searched": r["share_searched"],
                **{name: _scores(r[name]["scores"]) for name in VARIANTS}, "speed": speeds[actor],
            }
            for actor, r in rotations.items()
        },
        "speed_up": {
            name: float(np.mean([found[name]["speed_up"] for found in speeds.values()])) for name in speeds[ACTORS[0]]
        },
        "confusion": {"labels": names, **tables},
    }  # fmt: skip


def plot_confusion(table: np.ndarray, labels: Sequence[str], path: Path, title: str) -> None:
    """Draw a confusion matrix, rows true, columns found, each row as fractions."""
    from matplotlib.figure import Figure

    size = 2.5 + 0.33 * len(labels)
    figure = Figure(figsize=(size + 1, size), layout="constrained")
    axes = figure.subplots()
    shares = table / np.maximum(table.sum(axis=1, keepdims=True), 1)
    image = axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0)
    for row, column in zip(*np.nonzero(shares >= 0.01), strict=True):
        text = f"{100 * shares[row, column]:.0f}"
        axes.text(
            column, row, text, ha="center", va="center", fontsize=7, color="w" if shares[row, column] > 0.5 else "k"
        )
    axes.set_xticks(range(len(labels)), labels, rotation=90, fontsize=8)
    axes.set_yticks(range(len(labels)), labels, fontsize=8)
    axes.set(xlabel="found", ylabel="true", title=f"{title}: percent of the true class")
    figure.colorbar(image, ax=axes, shrink=0.7)
    figure.savefig(path, dpi=110)


def _summed(parts: Sequence[dict[str, Scores]]) -> dict[str, Scores]:
    return {key: sum((part[key] for part in parts), Scores(0, 0, 0, 0)) for key in parts[0]}


def _scores(scores: dict[str, Scores]) -> dict[str, dict[str, float]]:
    return {key: {"precision": s.precision, "recall": s.recall, "f": s.f} for key, s in scores.items()}


def _line(scores: dict[str, Scores]) -> str:
    return ", ".join(f"{key} P {s.precision:.2f} R {s.recall:.2f} F {s.f:.3f}" for key, s in scores.items())


def _print_rotation(actor: str, rotation: dict[str, Any], timings: dict[str, dict[str, float]]) -> None:
    print(f"{actor} left out ({rotation['minutes']:.1f} minutes, threshold {rotation['threshold']:g})")
    for name in VARIANTS:
        print(f"  {name}: {_line(rotation[name]['scores'])}")
    print(f"  {100 * rotation['share_searched']:.1f} % searched")
    for name, timing in timings.items():
        print(
            f"  {name}, {timing['minutes']:.0f} minutes: {timing['seconds_without_keyframes']:.3f} s without and "
            f"{timing['seconds_with_keyframes']:.3f} s with keyframes, {timing['speed_up']:.1f} times faster, "
            f"{100 * timing['share_searched']:.1f} % searched",
            flush=True,
        )


def thesis(parser: argparse.ArgumentParser) -> None:
    """Parse the command line, measure, print and store the figures."""
    parser.add_argument("data", type=Path, help="the shared data folder")
    parser.add_argument("--runs", type=int, default=30, help="genetic runs per class")
    parser.add_argument("--generations", type=int, default=100)
    parser.add_argument("--queries", type=Path, help="folder of queries of an earlier run, or to keep them in")
    parser.add_argument("--minutes", type=float, default=74.0, help="length of the document that is timed")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    print(HOW)
    figures = {"hdm05": hdm05(options)}
    settings = {name: value for name, value in vars(options).items() if name not in ("data", "queries")}
    settings["queries"] = "learned in this run" if options.queries is None else "kept from an earlier run"
    print(save_figures("annotation", figures, settings))


def main() -> None:
    """Run the named part."""
    run_part(__doc__, {"thesis": thesis, "events": told_events})


if __name__ == "__main__":
    main()
