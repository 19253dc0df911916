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
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _keyframe_corpus as corpus
from benchmarks._record import RESULTS, benchmark, milliseconds_of, script
from benchmarks._rows import SPLIT
from tests.support.labelled import SEQUENCES, class_clips, perform
from toolkit.retrieval.annotation.annotation_report import plot_annotation, score
from toolkit.retrieval.annotation.annotator import AS_PUBLISHED, Annotation, Annotator, DecisionSettings, Intervals
from toolkit.retrieval.annotation.classes import learn_classes
from toolkit.retrieval.annotation.documents import Document, assemble, shuffled_parts
from toolkit.retrieval.annotation.measures import Scores, Segment, segment_scores
from toolkit.retrieval.annotation.online import Event, OnlineAnnotator
from toolkit.retrieval.annotation.training import CutClip
from toolkit.retrieval.features.motion import Motion, from_poses
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.learning.queries import LearningSettings
from toolkit.retrieval.search.find import preselect
from toolkit.retrieval.workflow.learn import learn_templates

CLIPS_PER_DOCUMENT, SEED = 12, 0
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
Run = tuple[dict[str, Scores], list[tuple[float, Annotation, Document]]]
"""Scores over frames and segments; and of each document F over frames, the annotation and the document."""


def make_documents(clips: Sequence[CutClip], filler: Sequence[Motion], seed: int) -> list[Document]:
    """Return all clips of one actor in documents of `CLIPS_PER_DOCUMENT` clips with filler between."""
    groups: list[list[tuple[Motion, str | None]]] = [[]]
    for part in shuffled_parts([(c.motion, c.label) for c in clips], filler, np.random.default_rng(seed)):
        if sum(label is not None for _, label in groups[-1]) == CLIPS_PER_DOCUMENT:
            groups.append([])
        groups[-1].append(part)
    return [assemble(f"{clips[0].person} {i}", group) for i, group in enumerate(groups, start=1)]


def train(clips: Sequence[CutClip], filler: Sequence[Motion], runs: int) -> tuple[Annotator, list[KeyframeQuery]]:
    """Return templates with their threshold, and keyframes, from the clips of some actors and filler."""
    folds = []
    for _, seen, unseen in corpus.left_out(clips):
        classes = learn_classes(corpus.features_by_label(seen))
        folds.append(corpus.Fold(classes, make_documents(unseen, filler, SEED), keyframes_of(seen, filler, runs)))
    classes = learn_classes(corpus.features_by_label(clips), threshold=corpus.learn_threshold(folds))
    return Annotator(classes), keyframes_of(clips, filler, runs)


def keyframes_of(clips: Sequence[CutClip], filler: Sequence[Motion], runs: int) -> list[KeyframeQuery]:
    """Return keyframes learned from clips, with unlabelled parts of their documents as counterexamples."""
    made = [
        document
        for _, _, own in corpus.left_out(clips)
        for number in range(COUNTEREXAMPLES)
        for document in make_documents(own, filler, SEED + 100 + number)
    ]
    learned = corpus.learned_from(clips, made, LearningSettings(runs=runs), np.random.default_rng(SEED))
    return [query for result in learned.values() for query in result.alternatives(ALTERNATIVES)]


def scored(annotator: Annotator, documents: Sequence[Document], intervals: Sequence[Intervals | None]) -> Run:
    """Annotate documents, within intervals where there are any."""
    totals, annotations = dict.fromkeys(MEASURES, Scores(0, 0, 0, 0)), []
    for document, own in zip(documents, intervals, strict=True):
        found = annotator.annotate(document.features, own)
        scores = score(found, document.segments)
        totals = {of: totals[of] + scores[of] for of in MEASURES}
        annotations.append((scores["frames"].f, found, document))
    return totals, annotations


def measured(annotator: Annotator, queries: Sequence[KeyframeQuery], documents: Sequence[Document]) -> dict[str, Run]:
    """Annotate one actor's documents without and with keyframes, and at each threshold (Fig. 5.6)."""
    index = KeyframeIndex.build([document.features for document in documents])
    intervals = preselect(index, queries, annotator.labels)
    found = {}
    for name, (narrowed, rules) in VARIANTS.items():
        within = intervals if narrowed else [None] * len(documents)
        found[name] = scored(Annotator(annotator.classes, rules), documents, within)
    for threshold in THRESHOLDS:
        classes = [replace(known, threshold=threshold) for known in annotator.classes]
        found[str(threshold)] = scored(Annotator(classes, AS_PUBLISHED), documents, intervals)
    return found


def speed(annotator: Annotator, queries: Sequence[KeyframeQuery], parts: Sequence[FeatureMatrix]) -> dict[str, float]:
    """Return CPU seconds to annotate a document of about `MINUTES`, made of repeated parts, and the speed-up."""
    values = np.concatenate([features.values for features in parts], axis=1)
    repeats = max(1, round(MINUTES * 1800.0 / values.shape[1]))
    features = FeatureMatrix("all", np.tile(values, (1, repeats)))
    index = KeyframeIndex.build([features])
    without = _cpu_seconds(lambda: annotator.annotate(features))
    both = _cpu_seconds(lambda: annotator.annotate(features, preselect(index, queries, annotator.labels)[0]))
    return {"seconds_without_keyframes": without, "seconds_with_keyframes": both, "speed_up": without / both}


def diluted(documents: Sequence[Document], filler: Sequence[Motion]) -> list[FeatureMatrix]:
    """Return the documents with filler, so that labelled frames are `RELEVANT_SHARE` of all."""
    labelled = sum(segment.end - segment.start for document in documents for segment in document.segments)
    total = sum(document.features.duration for document in documents)
    matrices = [relational_features(motion) for motion in filler]
    wanted = (labelled / RELEVANT_SHARE - total) / sum(matrix.duration for matrix in matrices)
    return [*(document.features for document in documents), *matrices * max(0, round(wanted))]


def _cpu_seconds(run: Callable[[], object]) -> float:
    return min(milliseconds_of(run, REPEATS, time.process_time)) / 1000.0


def rotations(clips: Sequence[CutClip], filler: Sequence[Motion], runs: int) -> dict[str, Any]:
    """Return the figures of all three rotations, and draw the best document (Fig. 5.5)."""
    training, reporting = corpus.halves(filler)
    found: dict[str, dict[str, Run]] = {}
    speeds: dict[str, dict[str, dict[str, float]]] = {}
    for actor, seen, unseen in corpus.left_out(clips):
        trained, documents = train(seen, training, runs), make_documents(unseen, reporting, SEED + 1)
        found[actor] = measured(*trained, documents)
        speeds[actor] = {
            "documents": speed(*trained, [document.features for document in documents]),
            "with more filler": speed(*trained, diluted(documents, reporting)),
        }
    together = {name: _scores([own[name][0] for own in found.values()]) for name in next(iter(found.values()))}
    annotations = [one for own in found.values() for one in own["with keyframes"][1]]
    whole = [one for one in annotations if len(one[2].segments) == CLIPS_PER_DOCUMENT]
    best, annotation, document = max(whole, key=lambda one: one[0])
    plot_annotation(annotation, document.segments).savefig(RESULTS / "annotation_best.jpg", dpi=80)
    curves = {
        of: {key: [together[str(tau)][of][key] for tau in THRESHOLDS] for key in ("precision", "recall", "f")}
        for of in MEASURES
    }
    return {
        "all_actors": {name: together[name] for name in VARIANTS},
        "over_thresholds": {"tau": THRESHOLDS, **curves},
        "by_actor_left_out": {
            actor: {**{name: _scores([own[name][0]]) for name in VARIANTS}, "speed": speeds[actor]}
            for actor, own in found.items()
        },
        "speed_up": {
            name: float(np.mean([own[name]["speed_up"] for own in speeds.values()]))
            for name in ("documents", "with more filler")
        },
        "drawn": {"best": best},
    }


def _scores(parts: Sequence[dict[str, Scores]]) -> dict[str, dict[str, float]]:
    """Return precision, recall and F of the sum of some scores."""
    sums = {of: sum((part[of] for part in parts), Scores(0, 0, 0, 0)) for of in MEASURES}
    return {of: {"precision": s.precision, "recall": s.recall, "f": s.f} for of, s in sums.items()}


@benchmark(data=Path, runs=2)
def thesis(options: argparse.Namespace) -> tuple[str, Any]:
    """Learn and annotate with 11 and with 15 classes."""
    eleven, fifteen = corpus.load_examples(options.data), corpus.load_all(options.data)
    holding = {"hdm05": corpus.HOLDS_A_CLASS, "fifteen": corpus.HOLDS_A_CLASS + corpus.PUNCHES}
    figures = {
        name: rotations(clips, corpus.load_filler(options.data, holding[name]), options.runs)
        for name, clips in (("hdm05", eleven), ("fifteen", fifteen))
    }
    seconds = _cpu_seconds(lambda: [relational_features(clip.motion) for clip in eleven])
    duration = sum(clip.motion.duration for clip in eleven)
    figures["hdm05"]["features"] = {"cpu_seconds": seconds * MINUTES * 60.0 / duration}
    return "annotation", figures


@benchmark(SPLIT, threshold=0.06)
def live_events(options: argparse.Namespace) -> tuple[str, Any]:
    """Annotate the sequences during tracking and as a whole, and compare."""
    learned = learn_templates(class_clips(options.split))
    classes = [replace(c, threshold=options.threshold) for c in learned]
    whole = live = Scores(0, 0, 0, 0)
    delays: list[float] = []
    spent, frames = 0.0, 0
    for sequence in SEQUENCES:
        done = perform(sequence, options.split, filler=True)
        clip = done.clip
        features = relational_features(from_poses(clip.poses, done.body, clip.frame_rate, clip.name))
        whole += segment_scores(done.segments, Annotator(classes).annotate(features).segments)
        annotator = OnlineAnnotator(classes, done.body, clip.frame_rate)
        start, events = time.process_time(), list[Event]()
        for pose, moment in zip(clip.poses, clip.timestamps, strict=True):
            events += annotator.push(pose, float(moment))
        spent, frames = spent + time.process_time() - start, frames + len(clip)
        events += annotator.finish()
        live += segment_scores(done.segments, [Segment(e.start, e.end, e.label) for e in events])
        delays += [_delay(event, done.segments) for event in events]
    known = np.array([delay for delay in delays if np.isfinite(delay)])
    return "events" + "_tune" * (options.split == "tune"), {
        "F segments, whole": whole.f,
        "F segments, live": live.f,
        "delay s, median": float(np.median(known)) if len(known) else None,
        "delay s, 90 %": float(np.quantile(known, 0.9)) if len(known) else None,
        "ms of processor per frame": 1000 * spent / frames,
    }


def _delay(event: Event, truth: tuple[Segment, ...]) -> float:
    """Return the delay from the end of the matching true motion to the event, seconds; NaN without one."""
    own = [s for s in truth if s.label == event.label and s.start < event.end and event.start < s.end]
    return event.time - own[-1].end if own else float("nan")


main = script(__name__, __doc__, {"thesis": thesis, "events": live_events})
