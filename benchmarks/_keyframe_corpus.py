"""Clips and documents for the benchmarks of keyframe search and learning, from HDM05 and CMU motions.

HDM05 has 188 cut clips of 11 classes by 3 actors, about 6 minutes. Larger corpora are put together from them: clips are
mirrored, sped up and slowed down, and joined with filler by eased straight lines. Every table states this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from toolkit.mocap.read import find_clips
from toolkit.retrieval.annotation.annotator import Annotator, Intervals, MotionClass
from toolkit.retrieval.annotation.documents import assemble, excerpt
from toolkit.retrieval.annotation.measures import Segment, label_frames
from toolkit.retrieval.annotation.preselection import preselect_in
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix, relational_features
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.learning.queries import LearnedQuery, LearningSettings, learn, training_clips
from toolkit.retrieval.workflow.motions import load_motion

ACTORS = ("bd", "bk", "dg")
SYMMETRIC = frozenset(
    ("hopBothLegs1hops", "lieDownFloor", "rotateArmsBothBackward1Reps", "squat1Reps", "throwBasketball")
)
"""Classes that are equal to their mirror image; mirror images of other classes belong to no class."""
SPEEDS = (0.8, 1.25)
"""Lowest and highest speed factor of a clip in a document."""
PARTS = 12
"""Number of parts of a document, filler included."""
FILLER_SHARE = 0.5
"""Fraction of a document's parts that are excerpts of CMU motions."""
FILLER_SECONDS = (2.0, 6.0)
PIECE, SHORTEST_PIECE = 90, 15
"""Length of a counterexample cut out of a document, and its minimum, frames at 30 Hz."""
HOW = (
    "documents put together from cut HDM05 clips (half of them mirrored, speed 0.8 to 1.25) and excerpts of CMU "
    "motions, joined by eased straight lines; mirror images of one-sided classes and CMU motions bear no label"
)


@dataclass(frozen=True, eq=False)
class Example:
    """Cut clip with its actor and class."""

    motion: Motion
    actor: str
    label: str

    @cached_property
    def features(self) -> FeatureMatrix:
        """Relational features of the clip."""
        return relational_features(self.motion)


@dataclass(frozen=True, eq=False)
class LabelledDocument:
    """Features of a document and its true segments: (first frame, frame after the last, label) at 30 Hz."""

    features: FeatureMatrix
    actor: str
    segments: tuple[tuple[int, int, str], ...]


def load_examples(data: Path) -> list[Example]:
    """Return all HDM05 clips, sorted by name."""
    examples = []
    for file in find_clips(data / "mocap" / "hdm05"):
        _, actor, label, *_ = file.stem.split("_")
        examples.append(Example(load_motion(file), actor, label))
    return examples


def by_label(examples: Sequence[Example]) -> dict[str, list[Motion]]:
    """Return the clips of each class."""
    classes: dict[str, list[Motion]] = {label: [] for label in sorted({e.label for e in examples})}
    for example in examples:
        classes[example.label].append(example.motion)
    return classes


def load_filler(data: Path) -> list[Motion]:
    """Return all CMU motions, sorted by name, without the initial T-pose."""
    motions = (load_motion(file) for file in find_clips(data / "mocap" / "cmu"))
    return [motion.sliced(1, len(motion)) for motion in motions]


def make_documents(
    examples: Sequence[Example], filler: Sequence[Motion], frames: int, rng: np.random.Generator
) -> list[LabelledDocument]:
    """Return documents of one actor, together at least `frames` frames at 30 Hz."""
    documents: list[LabelledDocument] = []
    done = 0
    while done < frames:
        name = f"{examples[0].actor}_{len(documents):04d}"
        made = assemble(name, [_part(examples, filler, rng) for _ in range(PARTS)])
        features = relational_features(made.motion)
        segments = tuple((round(s.start * FEATURE_RATE), round(s.end * FEATURE_RATE), s.label) for s in made.segments)
        documents.append(LabelledDocument(features, examples[0].actor, segments))
        done += len(features)
    return documents


def _part(examples: Sequence[Example], filler: Sequence[Motion], rng: np.random.Generator) -> tuple[Motion, str | None]:
    if rng.random() < FILLER_SHARE:
        return excerpt(filler, FILLER_SECONDS, rng), None
    example = examples[int(rng.integers(len(examples)))]
    motion = example.motion.at_speed(float(np.exp(rng.uniform(*np.log(SPEEDS)))))
    if rng.random() < 0.5:
        return motion, example.label
    return motion.mirrored(), example.label if example.label in SYMMETRIC else None


def documents_of_each(
    examples: Sequence[Example], filler: Sequence[Motion], frames: int, rng: np.random.Generator
) -> list[LabelledDocument]:
    """Return documents of `frames` frames of each actor's own clips, actor by actor."""
    return [
        document
        for actor in sorted({example.actor for example in examples})
        for document in make_documents([e for e in examples if e.actor == actor], filler, frames, rng)
    ]


def learned_from(
    examples: Sequence[Example],
    documents: Sequence[LabelledDocument],
    settings: LearningSettings,
    rng: np.random.Generator,
) -> dict[str, LearnedQuery]:
    """Return queries for all classes; unlabelled parts of documents of the same clips are the counterexamples."""
    classes, checks = training_clips(by_label(examples), settings)
    return learn(classes, settings, rng, others=unlabelled_pieces(documents), checks=checks)


def unlabelled_pieces(documents: Sequence[LabelledDocument]) -> list[FeatureMatrix]:
    """Return filler, joins and mirror images of one-sided classes, cut out of documents into pieces of at most 3
    seconds.
    """
    pieces = []
    for document in documents:
        edges = [0, *(edge for start, stop, _ in document.segments for edge in (start, stop)), len(document.features)]
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            for start in range(first, last, PIECE):
                piece = document.features.sliced(start, min(start + PIECE, last))
                if len(piece) >= SHORTEST_PIECE:
                    pieces.append(replace(piece, name=f"{document.features.name} from {start}"))
    return pieces


def confusion(true: np.ndarray, decided: np.ndarray) -> np.ndarray:
    """Return frames by true and decided class: int64 (P + 1, P + 1); the last row and column stand for "no class".

    Parameters
    ----------
    true : bool (P, L); a frame with several true labels counts once for each
    decided : int64 (L,), class of each frame before segments are extended, -1 for none
    """
    classes = len(true)
    table = np.zeros((classes + 1, classes + 1), dtype=np.int64)
    columns = np.where(decided < 0, classes, decided)
    for row, frames in enumerate([*true, ~true.any(axis=0)]):
        table[row] = np.bincount(columns[frames], minlength=classes + 1)
    return table


THRESHOLDS: np.ndarray = np.round(np.arange(0.02, 0.15, 0.01), 3)
"""Candidate thresholds of `learn_threshold`."""


class Fold(NamedTuple):
    """Model of some people with its evaluation documents.

    Attributes
    ----------
    classes : learned from some people
    documents : with true segments, of a person who is in no example
    queries : keyframes learned from the same people, if keyframes will narrow the search down
    """

    classes: Sequence[MotionClass]
    documents: Sequence[tuple[FeatureMatrix, Sequence[Segment]]]
    queries: Sequence[KeyframeQuery] = ()


def learn_threshold(folds: Sequence[Fold]) -> float:
    """Return the common threshold of all classes with the best F over frames on documents of left-out people.

    The threshold is learned with keyframes, which remove most frames without a motion, so a looser one is best.

    Returns
    -------
    One of `THRESHOLDS`, the smallest among equals.
    """
    found, right, true = (np.zeros(len(THRESHOLDS)) for _ in range(3))
    for classes, documents, queries in folds:
        labels = [motion_class.label for motion_class in classes]
        matrices = [features for features, _ in documents]
        narrowed: Sequence[Intervals | None] = [None] * len(documents)
        if queries:
            narrowed = preselect_in(matrices, queries, labels)
        for number, threshold in enumerate(THRESHOLDS):
            annotator = Annotator([MotionClass(c.label, c.template, float(threshold)) for c in classes])
            for (features, segments), intervals in zip(documents, narrowed, strict=True):
                frames = annotator.annotate(features, intervals).frames
                truth = label_frames(segments, annotator.labels, len(features), features.frame_rate)
                found[number] += frames.sum()
                right[number] += (frames & truth).sum()
                true[number] += truth.sum()
    return float(THRESHOLDS[int((2.0 * right / (found + true)).argmax())])
