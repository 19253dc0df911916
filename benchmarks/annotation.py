"""Annotation by the thesis's motion templates: `depthmocap bench annotation PART`, which is one of

- `thesis DATA [--runs 2]`: for each of the HDM05 actors bd, bk and dg, motion templates, keyframes and one threshold
  are learned from the cut clips of the other two, and documents of this one are annotated, without and with keyframe
  preselection (thesis 5.4, Table 5.2), and with keyframes at one threshold after the other (Fig. 5.6). The threshold is
  chosen by learning templates and keyframes from each training actor alone and annotating documents of the other with
  both. Nothing is chosen on the actor that is reported. Documents are put together from cut clips, with blended joins
  and unlabelled filler. Once with the 11 classes of the excerpt of HDM05, once with 15, which cover 12 of
  Table 5.1 (`_keyframe_corpus.load_all`).
- `events [--split report] [--threshold 0.06]`: motion events during tracking. True poses of the sequences of
  `tests/support/labelled.py`, with other motions between the clips, on the neutral body's proportions; classes of the
  other actors. F over segments of the events against that of annotation of the whole; seconds from the end of a motion
  to its event; milliseconds of processor time per frame.
"""

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._events import live_events
from benchmarks._keyframe_corpus import (
    ACTORS,
    HOLDS_A_CLASS,
    PUNCHES,
    Example,
    Fold,
    LabelledDocument,
    confusion,
    learn_threshold,
    learned_from,
    load_all,
    load_examples,
    load_filler,
)
from benchmarks._record import RESULTS, benchmark, milliseconds_of, script
from toolkit.retrieval.annotation.annotation_report import plot_annotation
from toolkit.retrieval.annotation.annotator import AS_PUBLISHED, Annotation, Annotator, DecisionSettings, Intervals
from toolkit.retrieval.annotation.classes import learn_classes
from toolkit.retrieval.annotation.documents import assemble, shuffled_parts
from toolkit.retrieval.annotation.measures import Scores, Segment, frame_scores, label_frames, segment_scores
from toolkit.retrieval.annotation.preselection import preselect
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.learning.queries import LearningSettings

CLIPS_PER_DOCUMENT, SEED = 12, 0
LAST_TRAINING_SUBJECT = 8
"""Last CMU subject whose motions are filler in training; the others are filler of the reported documents."""
MINUTES, REPEATS = 74.0, 5
"""Length of the timed document, and runs of which the shortest counts."""
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
Labelled = tuple[FeatureMatrix, tuple[Segment, ...]]
"""Features of a document, and its true segments."""


@dataclass(frozen=True, eq=False)
class Trained:
    """Templates and keyframes learned from two actors."""

    annotator: Annotator
    queries: list[KeyframeQuery]


def make_documents(examples: Sequence[Example], filler: Sequence[Motion], seed: int) -> list[Labelled]:
    """Return all clips of one actor in documents of `CLIPS_PER_DOCUMENT` clips with filler between."""
    clips = [(example.motion, example.label) for example in examples]
    groups: list[list[tuple[Motion, str | None]]] = [[]]
    for part in shuffled_parts(clips, filler, np.random.default_rng(seed)):
        if sum(label is not None for _, label in groups[-1]) == CLIPS_PER_DOCUMENT:
            groups.append([])
        groups[-1].append(part)
    documents = [assemble(f"{examples[0].actor} {i}", group) for i, group in enumerate(groups, start=1)]
    return [(relational_features(d.motion), d.segments) for d in documents]


def classes_of(examples: Sequence[Example]) -> dict[str, list[FeatureMatrix]]:
    """Return feature matrices of each class."""
    found: dict[str, list[FeatureMatrix]] = {}
    for example in examples:
        found.setdefault(example.label, []).append(relational_features(example.motion))
    return found


def train(examples: Sequence[Example], filler: Sequence[Motion], runs: int) -> Trained:
    """Return templates, threshold and keyframes from the clips of some actors and filler of the training subjects."""
    folds = []
    for actor in sorted({example.actor for example in examples}):
        seen, unseen = ([e for e in examples if (e.actor == actor) == out] for out in (False, True))
        unknown = make_documents(unseen, filler, SEED)
        folds.append(Fold(learn_classes(classes_of(seen)), unknown, keyframes_of(seen, filler, runs)))
    classes = learn_classes(classes_of(examples), threshold=learn_threshold(folds))
    return Trained(Annotator(classes), keyframes_of(examples, filler, runs))


def keyframes_of(examples: Sequence[Example], filler: Sequence[Motion], runs: int) -> list[KeyframeQuery]:
    """Return keyframes learned from clips, with unlabelled parts of their documents as counterexamples."""
    made: list[LabelledDocument] = []
    for actor in sorted({example.actor for example in examples}):
        own = [example for example in examples if example.actor == actor]
        for number in range(COUNTEREXAMPLES):
            made.extend(
                LabelledDocument(features, actor, tuple((*s.frames(FEATURE_RATE), s.label) for s in segments))
                for features, segments in make_documents(own, filler, SEED + 100 + number)
            )
    learned = learned_from(examples, made, LearningSettings(runs=runs), np.random.default_rng(SEED))
    return [query for result in learned.values() for query in result.alternatives(ALTERNATIVES)]


def measured(trained: Trained, documents: Sequence[Labelled]) -> dict[str, Any]:
    """Return scores and confusion matrix, without and with keyframes, of one actor's documents."""
    labels = trained.annotator.labels
    index = KeyframeIndex.build([features for features, _ in documents])
    intervals = preselect(index, trained.queries, labels)
    result: dict[str, Any] = {}
    for name, (narrowed, rules) in VARIANTS.items():
        annotator = Annotator(trained.annotator.classes, rules)
        totals = dict.fromkeys(MEASURES, Scores(0, 0, 0, 0))
        table = np.zeros((len(labels) + 1, len(labels) + 1), dtype=np.int64)
        annotations = []
        for number, (features, segments) in enumerate(documents):
            found = annotator.annotate(features, intervals[number] if narrowed else None)
            true = label_frames(segments, labels, len(features), features.frame_rate)
            totals["frames"] += frame_scores(true, found.frames)
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
    for (features, segments), own in zip(documents, intervals, strict=True):
        annotation = annotator.annotate(features, own)
        true = label_frames(segments, annotator.labels, len(features), features.frame_rate)
        found["frames"] += frame_scores(true, annotation.frames)
        found["segments"] += segment_scores(segments, annotation.segments)
    return found


def speed(trained: Trained, parts: Sequence[FeatureMatrix]) -> dict[str, float]:
    """Return CPU seconds to annotate a document of about `MINUTES`, made of repeated parts, and the speed-up."""
    values = np.concatenate([features.values for features in parts], axis=1)
    repeats = max(1, round(MINUTES * 1800.0 / values.shape[1]))
    features = FeatureMatrix("all", np.tile(values, (1, repeats)))
    index = KeyframeIndex.build([features])
    annotator = trained.annotator
    without = _cpu_seconds(lambda: annotator.annotate(features))
    both = _cpu_seconds(lambda: annotator.annotate(features, preselect(index, trained.queries, annotator.labels)[0]))
    return {
        "seconds_without_keyframes": without, "seconds_with_keyframes": both, "speed_up": without / both,
    }  # fmt: skip


def diluted(documents: Sequence[Labelled], filler: Sequence[Motion]) -> list[FeatureMatrix]:
    """Return the documents with filler, so that labelled frames are `RELEVANT_SHARE` of all."""
    labelled = sum(segment.end - segment.start for _, segments in documents for segment in segments)
    total = sum(features.duration for features, _ in documents)
    matrices = [relational_features(motion) for motion in filler]
    wanted = (labelled / RELEVANT_SHARE - total) / sum(matrix.duration for matrix in matrices)
    return [*(features for features, _ in documents), *matrices * max(0, round(wanted))]


def _cpu_seconds(run: Callable[[], object]) -> float:
    return min(milliseconds_of(run, REPEATS, time.process_time)) / 1000.0


def rotations(examples: Sequence[Example], filler: Mapping[str, Motion], runs: int) -> dict[str, Any]:
    """Return the figures of all three rotations, and draw the best document."""
    training = [m for name, m in filler.items() if int(name.split("_")[0]) <= LAST_TRAINING_SUBJECT]
    reporting = [m for name, m in filler.items() if int(name.split("_")[0]) > LAST_TRAINING_SUBJECT]
    found: dict[str, dict[str, Any]] = {}
    for actor in ACTORS:
        seen, unseen = ([e for e in examples if (e.actor == actor) == out] for out in (False, True))
        trained, documents = train(seen, training, runs), make_documents(unseen, reporting, SEED + 1)
        found[actor] = measured(trained, documents)
        dense = [features for features, _ in documents]
        found[actor]["speed"] = {
            "documents": speed(trained, dense),
            "with more filler": speed(trained, diluted(documents, reporting)),
        }
    totals = {name: _summed([found[actor][name]["scores"] for actor in ACTORS]) for name in VARIANTS}
    swept = [_summed([found[actor]["over thresholds"][k] for actor in ACTORS]) for k in range(len(THRESHOLDS))]
    tables = {name: sum(found[actor][name]["confusion"] for actor in ACTORS) for name in list(VARIANTS)[:2]}
    best = _draw_best([one for own in found.values() for one in own["with keyframes"]["annotations"]])
    timings = {name: [found[actor]["speed"][name]["speed_up"] for actor in ACTORS] for name in found["bd"]["speed"]}
    return {
        "all_actors": {name: _scores(total) for name, total in totals.items()},
        "over_thresholds": {"tau": THRESHOLDS, **{of: _curves([_scores(row)[of] for row in swept]) for of in MEASURES}},
        "by_actor_left_out": {
            actor: {**{name: _scores(own[name]["scores"]) for name in VARIANTS}, "speed": own["speed"]}
            for actor, own in found.items()
        },
        "speed_up": {name: float(np.mean(factors)) for name, factors in timings.items()},
        "confusion": {"labels": [*trained.annotator.labels, "no class"], **tables},
        "drawn": {"best": best},
    }  # fmt: skip


def _curves(rows: Sequence[dict[str, float]]) -> dict[str, list[float]]:
    return {key: [row[key] for row in rows] for key in rows[0]}


def _draw_best(annotations: Sequence[tuple[float, Annotation, Sequence[Segment]]]) -> float:
    """Draw the whole document with the highest F over frames (Fig. 5.5), and return that."""
    whole = [one for one in annotations if len(one[2]) == CLIPS_PER_DOCUMENT]
    score, found, segments = max(whole, key=lambda one: one[0])
    plot_annotation(found, segments).savefig(RESULTS / "annotation_best.jpg", dpi=80)
    return score


def features_of(examples: Sequence[Example]) -> dict[str, float]:
    """Return the CPU seconds of the relational features of `MINUTES` at 120 Hz."""
    seconds = _cpu_seconds(lambda: [relational_features(e.motion) for e in examples])
    return {"cpu_seconds": seconds * MINUTES * 60.0 / sum(e.motion.duration for e in examples)}


def _summed(parts: Sequence[dict[str, Scores]]) -> dict[str, Scores]:
    return {key: sum((part[key] for part in parts), Scores(0, 0, 0, 0)) for key in parts[0]}


def _scores(scores: dict[str, Scores]) -> dict[str, dict[str, float]]:
    return {key: {"precision": s.precision, "recall": s.recall, "f": s.f} for key, s in scores.items()}


@benchmark(data=Path, runs=2)
def thesis(options: argparse.Namespace) -> tuple[str, Any]:
    """Learn and annotate with 11 and with 15 classes."""
    eleven, fifteen = load_examples(options.data), load_all(options.data)
    figures = {}
    for name, examples, holding in (("hdm05", eleven, HOLDS_A_CLASS), ("fifteen", fifteen, HOLDS_A_CLASS + PUNCHES)):
        filler = {motion.name: motion for motion in load_filler(options.data, holding)}
        figures[name] = rotations(examples, filler, options.runs)
    figures["hdm05"]["features"] = features_of(eleven)
    return "annotation", figures


main = script(__name__, __doc__, {"thesis": thesis, "events": live_events})
