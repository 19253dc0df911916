"""Clips and documents for the benchmarks of keyframe search and learning, from HDM05 and CMU motions.

HDM05 has 188 cut clips of 11 classes by 3 actors, about 6 minutes. Larger corpora are put together from them: clips are
mirrored, sped up and slowed down, and joined with filler by eased straight lines. Every table states this.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from toolkit.mocap.read import find_clips
from toolkit.retrieval.annotation.annotator import Annotator, Intervals, MotionClass
from toolkit.retrieval.annotation.documents import Document, assemble, excerpt
from toolkit.retrieval.annotation.measures import label_frames
from toolkit.retrieval.annotation.training import CutClip
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FEATURE_RATE, FeatureMatrix
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.learning.queries import LearnedQuery, LearningSettings, learn, training_clips
from toolkit.retrieval.search.find import HitRanges, preselect
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


LAST_TRAINING_SUBJECT = 8
"""Last CMU subject whose motions are used in training; the others are filler of the reported documents."""


def load_examples(data: Path) -> list[CutClip]:
    """Return all HDM05 clips, sorted by name."""
    words = {file: file.stem.split("_") for file in find_clips(data / "mocap" / "hdm05")}
    return [CutClip(load_motion(file), label, person) for file, (_, person, label, *_) in words.items()]


def load_all(data: Path) -> list[CutClip]:
    """Return the HDM05 clips, and clips of four more classes of Table 5.1; neutral, tpose and turn are missing.

    The latter are HDM05 clips played backwards, and parts of CMU motions. The person is the rotation in which a clip is
    left out; of the four classes only standUpFloor has clips of three people.
    """
    examples = load_examples(data)
    found = examples + [
        CutClip(_backwards(clip.motion), REVERSED[clip.label], clip.person)
        for clip in examples
        if clip.label in REVERSED
    ]
    for label, half, folds in CUT_FROM_CMU:
        for person, clips in folds.items():
            for name, middle in clips:
                motion = load_motion(data / "mocap" / "cmu" / f"{name.split()[0]}.bvh")
                first, last = (round((middle + offset) * motion.frame_rate) for offset in (-half, half))
                cut = replace(motion.sliced(first, last), name=f"{name} {middle:g} s")
                found.append(CutClip(cut.mirrored() if name.endswith("mirrored") else cut, label, person))
    return found


def left_out(clips: Sequence[CutClip]) -> Iterator[tuple[str, list[CutClip], list[CutClip]]]:
    """Yield each person with the clips of the others and the person's own."""
    for person in sorted({clip.person for clip in clips}):
        yield person, [c for c in clips if c.person != person], [c for c in clips if c.person == person]


def _backwards(motion: Motion) -> Motion:
    axis = motion.root_axis
    back = None if axis is None else np.ascontiguousarray(axis[::-1])
    joints = np.ascontiguousarray(motion.joints[::-1])
    return replace(motion, name=f"{motion.name} (backwards)", joints=joints, root_axis=back)


def motions_by_label(clips: Sequence[CutClip]) -> dict[str, list[Motion]]:
    """Return the motions of the clips of each class."""
    return {label: [c.motion for c in clips if c.label == label] for label in sorted({c.label for c in clips})}


def features_by_label(clips: Sequence[CutClip]) -> dict[str, list[FeatureMatrix]]:
    """Return the features of the clips of each class."""
    return {label: [c.features for c in clips if c.label == label] for label in sorted({c.label for c in clips})}


def load_filler(data: Path, without: Collection[str] = ()) -> list[Motion]:
    """Return all CMU motions but those of some names, sorted by name, without the initial T-pose."""
    motions = (load_motion(file) for file in find_clips(data / "mocap" / "cmu") if file.stem not in without)
    return [motion.sliced(1, len(motion)) for motion in motions]


def halves(filler: Sequence[Motion]) -> tuple[list[Motion], list[Motion]]:
    """Return the filler of training and that of the reported documents, see `LAST_TRAINING_SUBJECT`."""
    subjects = [int(motion.name.split("_")[0]) for motion in filler]
    early = [motion for motion, subject in zip(filler, subjects, strict=True) if subject <= LAST_TRAINING_SUBJECT]
    return early, [motion for motion in filler if motion not in early]


def make_documents(
    clips: Sequence[CutClip], filler: Sequence[Motion], frames: int, rng: np.random.Generator
) -> list[Document]:
    """Return documents of one person, together at least `frames` frames at 30 Hz; their names start with the person."""
    documents: list[Document] = []
    done = 0
    while done < frames:
        name = f"{clips[0].person}_{len(documents):04d}"
        documents.append(assemble(name, [_part(clips, filler, rng) for _ in range(PARTS)]))
        done += len(documents[-1].features)
    return documents


def _part(clips: Sequence[CutClip], filler: Sequence[Motion], rng: np.random.Generator) -> tuple[Motion, str | None]:
    if rng.random() < FILLER_SHARE:
        return excerpt(filler, FILLER_SECONDS, rng), None
    clip = clips[int(rng.integers(len(clips)))]
    motion = clip.motion.at_speed(float(np.exp(rng.uniform(*np.log(SPEEDS)))))
    if rng.random() < 0.5:
        return motion, clip.label
    return motion.mirrored(), clip.label if clip.label in SYMMETRIC else None


def learned_from(
    clips: Sequence[CutClip], documents: Sequence[Document], settings: LearningSettings, rng: np.random.Generator
) -> dict[str, LearnedQuery]:
    """Return queries for all classes; unlabelled parts of documents of the same clips are the counterexamples."""
    classes, checks = training_clips(motions_by_label(clips), settings)
    return learn(classes, settings, rng, others=unlabelled_pieces(documents), checks=checks)


def unlabelled_pieces(documents: Sequence[Document]) -> list[FeatureMatrix]:
    """Return the unlabelled parts of documents, cut into pieces of at most 3 seconds."""
    pieces = []
    for document in documents:
        inner = [edge for segment in document.segments for edge in segment.frames(FEATURE_RATE)]
        edges = [0, *inner, len(document.features)]
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            for start in range(first, last, PIECE):
                piece = document.features.sliced(start, min(start + PIECE, last))
                if len(piece) >= SHORTEST_PIECE:
                    pieces.append(replace(piece, name=f"{document.features.name} from {start}"))
    return pieces


def ranges_of(found: HitRanges) -> Iterator[tuple[int, int, int]]:
    """Return document, first frame and frame after the last of each hit."""
    return zip(found.documents.tolist(), found.starts.tolist(), found.stops.tolist(), strict=True)


class Truth:
    """True segments of a class in the documents of an index; only those of one actor count, if it is given."""

    def __init__(self, documents: Sequence[Document], label: str, actor: str = "") -> None:
        self.lengths = {
            number: len(document.features)
            for number, document in enumerate(documents)
            if document.features.name.startswith(actor)
        }
        self.segments = [
            (n, *segment.frames(FEATURE_RATE))
            for n in self.lengths
            for segment in documents[n].segments
            if segment.label == label
        ]

    @property
    def frames(self) -> int:
        """Number of frames in true segments."""
        return sum(stop - start for _, start, stop in self.segments)

    @property
    def relevant(self) -> float:
        """Fraction of the frames in true segments."""
        return self.frames / sum(self.lengths.values())

    def covered(self, ranges: Iterable[tuple[int, int, int]]) -> tuple[int, np.ndarray]:
        """Return the number of frames in ranges (document, first frame, frame after the last), and the fraction of each
        true segment that they cover.
        """
        left = {number: np.zeros(length, dtype=bool) for number, length in self.lengths.items()}
        for document, start, stop in ranges:
            if document in left:
                left[document][start:stop] = True
        shares = np.array([left[n][start:stop].mean() for n, start, stop in self.segments])
        return sum(map(np.count_nonzero, left.values())), shares

    def quality(self, found: Iterable[HitRanges]) -> tuple[float, float, float]:
        """Return the remaining fraction of the frames, and fractions of true segments touched and half left."""
        frames, shares = self.covered(each for hits in found for each in ranges_of(hits))
        return frames / sum(self.lengths.values()), float((shares > 0).mean()), float((shares >= 0.5).mean())

    def precision(self, found: HitRanges) -> float:
        """Return the fraction of ranges that overlap a true segment."""
        right = [
            any(d == n and a < stop and start < b for n, a, b in self.segments) for d, start, stop in ranges_of(found)
        ]
        return float(np.mean(right)) if right else 0.0


THRESHOLDS: np.ndarray = np.round(np.arange(0.02, 0.15, 0.01), 3)
"""Candidate thresholds of `learn_threshold`."""


class Fold(NamedTuple):
    """Classes, and keyframe queries if there are any, learned from some people, and documents of another person."""

    classes: Sequence[MotionClass]
    documents: Sequence[Document]
    queries: Sequence[KeyframeQuery] = ()


def learn_threshold(folds: Sequence[Fold]) -> float:
    """Return the common threshold of all classes with the best F over frames on documents of left-out people.

    It is one of `THRESHOLDS`, the smallest among equals. Keyframes remove most frames without a motion, so that with
    them a looser one is best.
    """
    found, right, true = (np.zeros(len(THRESHOLDS)) for _ in range(3))
    for classes, documents, queries in folds:
        labels = [motion_class.label for motion_class in classes]
        narrowed: Sequence[Intervals | None] = [None] * len(documents)
        if queries:
            narrowed = preselect(KeyframeIndex.build([document.features for document in documents]), queries, labels)
        for number, threshold in enumerate(THRESHOLDS):
            annotator = Annotator([MotionClass(c.label, c.template, float(threshold)) for c in classes])
            for document, intervals in zip(documents, narrowed, strict=True):
                frames = annotator.annotate(document.features, intervals).frames
                truth = label_frames(document.segments, annotator.labels, len(document.features), FEATURE_RATE)
                found[number] += frames.sum()
                right[number] += (frames & truth).sum()
                true[number] += truth.sum()
    return float(THRESHOLDS[int((2.0 * right / (found + true)).argmax())])
