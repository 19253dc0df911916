"""Annotation of actors not trained on: `depthmocap bench annotation DATA [--runs 30]`.

For each of the HDM05 actors bd, bk and dg, motion templates, keyframes and one threshold are learned from the cut clips
of the other two, and documents of this one are annotated, without and with keyframe preselection (thesis 5.4, Table
5.2). The threshold is chosen by learning templates and keyframes from each training actor alone and annotating
documents of the other with both. Nothing is chosen on the actor that is reported. Documents are put together from cut
clips, with blended joins and unlabelled filler.

UTD-MHAD (27 actions, 4 subjects, Kinect skeletons) is the harder set: whole clips of a subject left out are given the
class whose template fits best somewhere within them.
"""

from __future__ import annotations

import argparse
import time
import timeit
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from benchmarks._keyframe_corpus import ACTORS, Example, LabelledDocument, learned_from, load_examples, load_filler
from benchmarks._record import RESULTS, save_figures
from toolkit.recordings.readers.utd_mhad import joints_from_kinect
from toolkit.retrieval.annotation.annotator import (
    AS_PUBLISHED,
    Annotator,
    DecisionSettings,
    MotionClass,
    distance_function,
)
from toolkit.retrieval.annotation.classes import Fold, learn_classes, learn_threshold
from toolkit.retrieval.annotation.documents import assemble, shuffled_parts
from toolkit.retrieval.annotation.measures import Scores, Segment, confusion, frame_scores, label_frames, segment_scores
from toolkit.retrieval.annotation.preselection import preselect
from toolkit.retrieval.annotation.report import plot_annotation
from toolkit.retrieval.features.motion import Motion, from_joints
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.keyframes.query_file import load_queries, save_queries
from toolkit.retrieval.learning.genetic import GeneticSettings
from toolkit.retrieval.learning.queries import LearningSettings
from toolkit.retrieval.templates.picture import plot_matrix, plot_template
from toolkit.retrieval.templates.template import MotionTemplate

CLIPS_PER_DOCUMENT = 12
HOLDS_A_CLASS = ("02_03", "02_04", "02_06", "10_04", "49_02", *(f"49_{n:02d}" for n in range(3, 13)))
"""CMU motions left out of the filler: a jog, jumps and hops, bending to the floor, a kick, acrobatics."""
LAST_TRAINING_SUBJECT = 8
"""CMU subjects up to this one give the filler of training, the others that of the documents reported."""
HOW = (
    "documents put together from cut HDM05 clips of one actor (12 each), joined by eased straight lines of 0.25 to "
    "1.5 s, with excerpts of CMU walks, punches and swordplay before every second clip; joins and filler bear no "
    "label; 'without joins' leaves the frames of the joins out of the count"
)
COUNTEREXAMPLES = 3
"""How often a training actor's clips are put together into documents, whose unlabelled parts are counterexamples."""
ALTERNATIVES = 2
"""Keyframe queries per class."""
VARIANTS: dict[str, tuple[bool, DecisionSettings]] = {
    "without keyframes": (False, DecisionSettings()),
    "with keyframes": (True, DecisionSettings()),
    "without keyframes, rules as published": (False, AS_PUBLISHED),
    "with keyframes, rules as published": (True, AS_PUBLISHED),
}
"""Name -> whether keyframes narrow the search down, and which overlapping hits count."""
RELEVANT_SHARE = 0.1
"""Share of labelled frames in the second corpus that is timed."""
DRAWN_CLASS, DRAWN_FEATURES = "kickLFront1Reps", (6, 13, 14, 15, 16, 18, 20, 21, 25, 26, 30)
"""What the picture of a motion template shows."""
KINECT_ACTIONS = (
    "swipe left", "swipe right", "wave", "clap", "throw", "cross arms", "basketball shoot", "draw x",
    "draw circle (clockwise)", "draw circle (counter-clockwise)", "draw triangle", "bowling", "boxing",
    "baseball swing", "tennis forehand", "arm curl", "tennis serve", "two-hand push", "knock", "catch",
    "pick up and throw", "jog in place", "walk in place", "sit to stand", "stand to sit", "lunge", "squat",
)  # fmt: skip
"""Actions 1 to 27 of UTD-MHAD."""
KINECT_DELTAS = {"unanimous": 0.05, "majority": 0.34}
"""Quantisation thresholds for UTD-MHAD, where a class has three training clips: all agree, or two of three decide."""
TOLD_APART = 0.75
"""Share of an action's clips that have to be right."""

Labelled = tuple[FeatureMatrix, tuple[Segment, ...], tuple[tuple[float, float], ...]]
"""A document's features, its true segments and its joins."""


@dataclass(frozen=True, eq=False)
class Trained:
    """What was learned from two actors."""

    annotator: Annotator
    queries: list[KeyframeQuery]
    threshold: float


def make_documents(examples: Sequence[Example], filler: Sequence[Motion], seed: int) -> list[Labelled]:
    """All clips of one actor in documents of `CLIPS_PER_DOCUMENT` clips, filler between."""
    clips = [(example.motion, example.label) for example in examples]
    groups: list[list[tuple[Motion, str | None]]] = [[]]
    for part in shuffled_parts(clips, filler, np.random.default_rng(seed)):
        if sum(label is not None for _, label in groups[-1]) == CLIPS_PER_DOCUMENT:
            groups.append([])
        groups[-1].append(part)
    documents = [assemble(f"{examples[0].actor} {i}", group) for i, group in enumerate(groups, start=1)]
    return [(relational_features(d.motion), d.segments, d.joins) for d in documents]


def classes_of(examples: Sequence[Example]) -> dict[str, list[FeatureMatrix]]:
    """Feature matrices of each class."""
    found: dict[str, list[FeatureMatrix]] = {}
    for example in examples:
        found.setdefault(example.label, []).append(relational_features(example.motion))
    return found


def train(
    examples: Sequence[Example], filler: Sequence[Motion], options: argparse.Namespace, kept: Path | None
) -> Trained:
    """Templates, threshold and keyframes from the clips of some actors and from filler of the training subjects.

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
    """Keyframes learned from clips, and from what bears no label in documents made of them."""
    settings = LearningSettings(genetic=GeneticSettings(generations=options.generations), runs=options.runs)
    made = []
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
    """Scores, confusion matrix and the share searched, without and with keyframes, over the documents of one actor."""
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
    return result


def speed(trained: Trained, parts: Sequence[FeatureMatrix], minutes: float) -> dict[str, float]:
    """CPU seconds to annotate one document of about `minutes`, the given parts over and over, and the speed-up.

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
    """The documents and so much filler that labelled frames are `RELEVANT_SHARE` of all."""
    labelled = sum(segment.end - segment.start for _, segments, _ in documents for segment in segments)
    total = sum(features.duration for features, _, _ in documents)
    matrices = [relational_features(motion) for motion in filler]
    wanted = (labelled / RELEVANT_SHARE - total) / sum(matrix.duration for matrix in matrices)
    return [*(features for features, _, _ in documents), *matrices * max(0, round(wanted))]


def _cpu_seconds(run: Callable[[], object], repeats: int = 5) -> float:
    """Least CPU time of some runs."""
    return min(timeit.repeat(run, timer=time.process_time, repeat=repeats, number=1))


def hdm05(options: argparse.Namespace) -> dict[str, Any]:
    """All three rotations."""
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
    plot_class(classes_of(examples)[DRAWN_CLASS][:4], DRAWN_FEATURES, RESULTS / "annotation_template.png")
    totals = {name: _summed([rotations[a][name]["scores"] for a in ACTORS]) for name in VARIANTS}
    for name in VARIANTS:
        print(f"all actors, {name}: {_line(totals[name])}")
    tables = {name: sum(rotations[a][name]["confusion"] for a in ACTORS) for name in list(VARIANTS)[:2]}
    names = [*trained.annotator.labels, "no class"]
    plot_confusion(tables["with keyframes"], names, RESULTS / "annotation_confusion.png", "HDM05, frames")
    done = [annotation for r in rotations.values() for annotation in r["with keyframes"]["annotations"]]
    whole = [annotation for annotation in done if len(annotation[2]) == CLIPS_PER_DOCUMENT]
    ranked = sorted(whole, key=lambda item: item[0])
    for name, (_, found, segments) in (("bad", ranked[0]), ("good", ranked[-1])):
        plot_annotation(found, segments).savefig(RESULTS / f"annotation_{name}.png", dpi=110)
    feature_seconds = _cpu_seconds(lambda: [relational_features(e.motion) for e in examples], repeats=2)
    feature_seconds *= options.minutes * 60.0 / sum(e.motion.duration for e in examples)
    print(f"relational features of {options.minutes:.0f} minutes at 120 Hz: {feature_seconds:.1f} s")
    return {
        "documents": HOW,
        "features": {"minutes": options.minutes, "cpu_seconds": feature_seconds},
        "all_actors": {name: _scores(total) for name, total in totals.items()},
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


def utd_mhad(data: Path) -> dict[str, Any]:
    """Leave one subject out: whole clips get the class whose template fits best somewhere within them."""
    clips: list[tuple[int, int, FeatureMatrix]] = []
    for file in sorted((data / "depth" / "utd_mhad").glob("*_skeleton.mat")):
        action, subject = (int(part[1:]) for part in file.stem.split("_")[:2])
        upright = joints_from_kinect(loadmat(file)["d_skel"]) * -1.0  # mirrored back, y up, z towards the camera
        clips.append((action, subject, relational_features(from_joints(upright, FEATURE_RATE, file.stem))))
    actions = sorted({action for action, _, _ in clips})
    found: dict[str, Any] = {
        "how": "clips of a subject left out; cost of the best subsequence of the clip under each class's template",
        "clips": len(clips), "labels": actions,
    }  # fmt: skip
    for name, delta in KINECT_DELTAS.items():
        table = _left_out(clips, actions, delta)
        recall = np.diag(table) / table.sum(axis=1)
        apart = [action for action, share in zip(actions, recall, strict=True) if share >= TOLD_APART]
        accuracy = float(np.diag(table).sum() / table.sum())
        found[name] = {"delta": delta, "accuracy": accuracy, "actions_told_apart": apart, "confusion": table}
        print(f"UTD-MHAD, {name}: {100 * accuracy:.1f} % of {len(clips)} clips right; told apart: {apart}")
        picture = RESULTS / f"annotation_confusion_utd_mhad_{name}.png"
        plot_confusion(table, [f"{a} {KINECT_ACTIONS[a - 1]}" for a in actions], picture, f"UTD-MHAD, clips, {name}")
    return found


def _left_out(clips: Sequence[tuple[int, int, FeatureMatrix]], actions: Sequence[int], delta: float) -> np.ndarray:
    """Confusion matrix of whole clips, every subject classified by templates of the others."""
    table = np.zeros((len(actions), len(actions)), dtype=np.int64)
    for subject in sorted({subject for _, subject, _ in clips}):
        seen = {f"{a:02d}": [f for b, s, f in clips if b == a and s != subject] for a in actions}
        classes = learn_classes(seen, delta=delta)
        for action, _, features in (clip for clip in clips if clip[1] == subject):
            table[actions.index(action), int(np.argmin([_best(c, features) for c in classes]))] += 1
    return table


def _best(motion_class: MotionClass, features: FeatureMatrix) -> float:
    return min(float(distance_function(template, features)[0].min()) for template in motion_class.templates)


def plot_class(clips: Sequence[FeatureMatrix], features: Sequence[int], path: Path) -> None:
    """Draw some clips of a class, their template and the quantised template (Fig. 2.5 and 2.6)."""
    from matplotlib.figure import Figure

    template = MotionTemplate().fit(list(clips))
    figure = Figure(figsize=(12, 5), layout="constrained")
    axes = figure.subplots(2, max(len(clips), 2))
    for place, clip in zip(axes[0], clips, strict=False):
        plot_matrix(clip.values, place, features)
        place.set_title(clip.name, fontsize=8)
    plot_template(template, axes[1, 0], features)
    plot_template(template.quantised(), axes[1, 1], features)
    for place, title in zip(axes[1], ("template", "quantised, delta 0.05"), strict=False):
        place.set_title(title, fontsize=8)
    for unused in axes[1, 2:]:
        unused.set_axis_off()
    figure.savefig(path, dpi=110)


def plot_confusion(table: np.ndarray, labels: Sequence[str], path: Path, title: str) -> None:
    """Draw a confusion matrix, rows true, columns found, each row as shares."""
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


def main() -> None:
    """Parse the command line, measure, print and store the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="the shared data folder")
    parser.add_argument("--runs", type=int, default=30, help="genetic runs per class")
    parser.add_argument("--generations", type=int, default=100)
    parser.add_argument("--queries", type=Path, help="folder of queries of an earlier run, or to keep them in")
    parser.add_argument("--minutes", type=float, default=74.0, help="length of the document that is timed")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    print(HOW)
    figures = {"hdm05": hdm05(options), "utd_mhad": utd_mhad(options.data)}
    settings = {name: value for name, value in vars(options).items() if name not in ("data", "queries")}
    settings["queries"] = "learned in this run" if options.queries is None else "kept from an earlier run"
    print(save_figures("annotation", figures, settings))


if __name__ == "__main__":
    main()
