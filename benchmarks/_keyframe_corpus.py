"""Clips and documents for the benchmarks of keyframe search and learning, from HDM05 and CMU motions.

HDM05 has 188 cut clips of 11 classes by 3 actors, about 6 minutes. Larger corpora are put together from them: clips are
mirrored, sped up and slowed down, and joined with filler by eased straight lines. Every table states this.
"""

from collections.abc import Collection, Sequence
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
    ("hopBothLegs1hops", "lieDownFloor", "rotateArmsBothBackward1Reps", "squat1Reps", "standUpFloor", "throwBasketball")
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
REVERSED = {"lieDownFloor": "standUpFloor"}
"""Class of HDM05 -> class of its clips played backwards."""
CUT_FROM_CMU = (
    ("cartwheelLeft", 0.9, {"bd": [("49_06", 2.2)], "bk": [("49_07", 1.4)], "dg": [("49_08", 3.4)]}),
    ("punchRight", 0.5, {
        "bd": [("02_05", s) for s in (1.4, 5.77, 10.04)],
        "bk": [("02_05", s) for s in (2.86, 7.2, 11.56)],
        "dg": [("02_05", s) for s in (4.36, 8.63, 13.08)],
    }),
    ("hopLeftLeg", 0.27, {
        "bd": [("49_02", s) for s in (8.68, 9.22, 9.74, 10.26, 10.79, 11.32)],
        "bk": [("49_02 mirrored", s) for s in (13.33, 13.97, 14.49)],
        "dg": [("49_03", 4.78), ("49_03", 5.37), ("49_03 mirrored", 6.49), ("49_03 mirrored", 7.03)],
    }),
)  # fmt: skip
"""Three classes of Table 5.1, which the excerpt of HDM05 lacks, cut from CMU motions: label, seconds of a clip before
and after its middle, and motion with middle (s) of each clip by the rotation in which it is left out.

The middles are the largest reach of the fist, the highest point of the root in a hop, and the handstand. Each class is
of one person.
"""
HOLDS_A_CLASS = ("02_03", "02_04", "02_06", "10_04", *(f"49_{n:02d}" for n in range(2, 13)))
"""CMU motions with a motion of the 11 classes: a jog, jumps and hops, a bend to the floor, a kick, acrobatics."""
PUNCHES = ("02_05",)
"""CMU motions with another class of Table 5.1, filler where that is no class."""


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


def load_all(data: Path) -> list[Example]:
    """Return the HDM05 clips, and clips of four more classes of Table 5.1; neutral, tpose and turn are missing.

    The latter are HDM05 clips played backwards, and parts of CMU motions. "actor" is the rotation in which a clip is
    left out; of the four classes only standUpFloor has clips of three people.
    """
    examples = load_examples(data)
    found = examples + [
        Example(_backwards(example.motion), example.actor, REVERSED[example.label])
        for example in examples
        if example.label in REVERSED
    ]
    for label, half, folds in CUT_FROM_CMU:
        for actor, clips in folds.items():
            for name, middle in clips:
                motion = load_motion(data / "mocap" / "cmu" / f"{name.split()[0]}.bvh")
                first, last = (round((middle + offset) * motion.frame_rate) for offset in (-half, half))
                clip = replace(motion.sliced(first, last), name=f"{name} {middle:g} s")
                found.append(Example(clip.mirrored() if name.endswith("mirrored") else clip, actor, label))
    return found


def _backwards(motion: Motion) -> Motion:
    axis = motion.root_axis
    back = None if axis is None else np.ascontiguousarray(axis[::-1])
    joints = np.ascontiguousarray(motion.joints[::-1])
    return replace(motion, name=f"{motion.name} (backwards)", joints=joints, root_axis=back)


def by_label(examples: Sequence[Example]) -> dict[str, list[Motion]]:
    """Return the clips of each class."""
    classes: dict[str, list[Motion]] = {label: [] for label in sorted({e.label for e in examples})}
    for example in examples:
        classes[example.label].append(example.motion)
    return classes


def load_filler(data: Path, without: Collection[str] = ()) -> list[Motion]:
    """Return all CMU motions but those of some names, sorted by name, without the initial T-pose."""
    motions = (load_motion(file) for file in find_clips(data / "mocap" / "cmu") if file.stem not in without)
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
