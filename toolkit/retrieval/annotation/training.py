"""Training of a motion model on documents of people whose clips are not among the examples.

The clips of each person in turn are combined to documents, easy and hard ones: joined smoothly or abruptly, with
excerpts of motions of no class, and with the mirror images of one-sided motions, which are not of their class. The
classifiers learn from the places that the other people's clips find there and in motions of no class (also mirrored,
faster and slower). With a single person, halves of the clips take turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from toolkit.io.progress import Progress, silent
from toolkit.retrieval.annotation.documents import HARD_JOINS, JOINS, Document, assemble, shuffled_parts
from toolkit.retrieval.annotation.examples import ExampleSet, Proposals
from toolkit.retrieval.annotation.measures import Scores, frame_scores, label_frames, segment_scores
from toolkit.retrieval.annotation.model import MotionModel
from toolkit.retrieval.annotation.place_classifier import Fold, joined, learn_classifiers
from toolkit.retrieval.features.grades import BLOCK_COLUMNS
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.learning.queries import check_classes


@dataclass(frozen=True, eq=False)
class CutClip:
    """Cut clip of one motion.

    Attributes
    ----------
    motion : the motion
    label : class of the motion
    person : name of the performer, "" if unknown
    """

    motion: Motion
    label: str
    person: str = ""

    @cached_property
    def features(self) -> FeatureMatrix:
        """Features of the clip."""
        return relational_features(self.motion)

    @cached_property
    def mirror_features(self) -> FeatureMatrix:
        """Features of its mirror image."""
        return relational_features(self.motion.mirrored())


@dataclass(frozen=True, eq=False)
class HeldOutScores:
    """Scores of a model of the other people on one person's documents.

    Attributes
    ----------
    person : held-out person
    frames, segments : per label the scores over frames and over segments
    """

    person: str
    frames: dict[str, Scores] = field(default_factory=dict)
    segments: dict[str, Scores] = field(default_factory=dict)


def train(
    clips: Sequence[CutClip],
    others: Sequence[Motion],
    rng: np.random.Generator,
    progress: Progress = silent,
) -> MotionModel:
    """Learn a model: all clips are examples, and the classifiers learn from documents of held-out clips.

    Parameters
    ----------
    clips : clips of at least one class
    others : motions of no class: counterexamples
    rng : source of all randomness
    progress : callback for the number of parts done

    Raises
    ------
    RetrievalError
        There are no clips, or a single class without counterexamples.
    """
    labels = sorted({clip.label for clip in clips})
    check_classes(dict.fromkeys(labels, clips), others)
    several = len({clip.person for clip in clips}) > 1  # halves of one person do not represent other people
    found = _what_clips_find(clips, others, rng, progress)
    folds = {label: {fold: joined(parts) for fold, parts in found[label].items()} for label in labels}
    classifiers = learn_classifiers(folds, cautious=several)
    return MotionModel(
        ExampleSet.of([(clip.features, clip.label) for clip in clips]), tuple(classifiers[label] for label in labels)
    )


def _what_clips_find(
    clips: Sequence[CutClip],
    others: Sequence[Motion],
    rng: np.random.Generator,
    progress: Progress,
) -> dict[str, dict[int, list[Fold]]]:
    """Return per label and fold the measures of places in documents of known truth, and their correctness."""
    symmetric, labels = two_sided(clips), {clip.label for clip in clips}
    speeds = (0.7, 1.0, 1.4)  # speed factors of the motions of no class
    empty = [
        Document(side.at_speed(speed)) for motion in others for side in (motion, motion.mirrored()) for speed in speeds
    ]
    rows: dict[str, dict[int, list[Fold]]] = {label: {} for label in labels}
    rounds = 2  # number of document sets of each person, easy and hard ones each time
    steps = [
        (fold, parts, hard)
        for _ in range(rounds)
        for fold, parts in enumerate(folds_of(clips, rng))
        for hard in (False, True)
    ]
    for number, (fold, (seen, unseen), hard) in enumerate(steps, start=1):
        documents = documents_of(unseen, others, rng, hard=hard, symmetric=symmetric) + (empty if hard else [])
        examples = ExampleSet.of([(clip.features, clip.label) for clip in seen])
        for label in examples.classes:
            places = examples.propose(label, [document.features for document in documents])
            rows[label].setdefault(fold, []).append((places.described, correctness(places, label, documents)))
        progress("learning", number, len(steps))
    return rows


def folds_of(clips: Sequence[CutClip], rng: np.random.Generator) -> list[tuple[list[CutClip], list[CutClip]]]:
    """Return folds (examples, clips for documents): each person against all others, or two random halves.

    There are none if every class has a single clip.
    """
    people = sorted({clip.person for clip in clips})
    if len(people) > 1:
        return [
            ([clip for clip in clips if clip.person != person], [clip for clip in clips if clip.person == person])
            for person in people
        ]
    halves: tuple[list[CutClip], list[CutClip]] = ([], [])
    for label in sorted({clip.label for clip in clips}):
        own = [clip for clip in clips if clip.label == label]
        for place, number in enumerate(rng.permutation(len(own))):
            halves[place % 2].append(own[number])
    first, second = halves
    return [(first, second), (second, first)] if second else []


def documents_of(
    clips: Sequence[CutClip],
    others: Sequence[Motion],
    rng: np.random.Generator,
    *,
    hard: bool,
    symmetric: frozenset[str] = frozenset(),
) -> list[Document]:
    """Return documents that contain every clip once, with excerpts of `others` in between.

    Parameters
    ----------
    clips : clips, for instance of one person
    others : motions of no class
    rng : source of all randomness
    hard : join abruptly, and add the mirror images of all clips of one-sided classes, without a label
    symmetric : classes that are not one-sided
    """
    rate = max(motion.frame_rate for motion in (*(clip.motion for clip in clips), *others))
    parts: list[tuple[Motion, str | None]] = [(clip.motion.at_rate(rate), clip.label) for clip in clips]
    if hard:
        one_sided = [clip for clip in clips if clip.label not in symmetric]
        parts += [(clip.motion.mirrored().at_rate(rate), None) for clip in one_sided]
    mixed = shuffled_parts(parts, [motion.at_rate(rate) for motion in others], rng)
    size = 12  # clips per document
    groups = [mixed[k : k + size] for k in range(0, len(mixed), size)]
    return [assemble(f"document {i}", group, HARD_JOINS if hard else JOINS) for i, group in enumerate(groups)]


def correctness(places: Proposals, label: str, documents: Sequence[Document]) -> np.ndarray:
    """Return bool (H,): a place is correct if it and a true segment share half of the longer of the two."""
    right = np.zeros(len(places.documents), dtype=bool)
    for k, (owner, first, last) in enumerate(zip(places.documents, places.firsts, places.lasts, strict=True)):
        document = documents[owner]
        rate = document.features.frame_rate
        start, stop = BLOCK_COLUMNS * first / rate, BLOCK_COLUMNS * (last + 1) / rate
        right[k] = any(
            2 * (min(stop, s.end) - max(start, s.start)) >= max(stop - start, s.end - s.start)
            for s in document.segments
            if s.label == label
        )
    return right


def two_sided(clips: Sequence[CutClip]) -> frozenset[str]:
    """Return the classes whose mirror images cost about as much as their clips cost one another."""
    examples = ExampleSet.of([(clip.features, clip.label) for clip in clips])
    found = set()
    # Cost of mirror images, relative to the cost between a class's clips, from which a class is one-sided.
    one_sided = 1.5
    for label in examples.classes:
        own = [clip for clip in clips if clip.label == label]
        if len(own) == 1:
            continue
        costs = np.array(
            [examples.cheapest(label, [clip.features, clip.mirror_features], clip.motion.name) for clip in own]
        )
        straight, mirrored = np.median(costs, axis=0)
        if mirrored <= one_sided * straight:
            found.add(label)
    return frozenset(found)


def alike(clips: Sequence[CutClip]) -> list[tuple[str, str, float]]:
    """Return pairs of similar classes with their relative cost, the most similar first.

    An entry is (class, other class, median cost of its clips by examples of the other, as a multiple of its own).
    """
    examples = ExampleSet.of([(clip.features, clip.label) for clip in clips])
    similar = 1.25  # relative cost below which two classes are similar
    found = []
    for label in examples.classes:
        own = [clip for clip in clips if clip.label == label]
        if len(own) < 2:
            continue
        within = float(np.median([examples.cheapest(label, [c.features], c.motion.name)[0] for c in own]))
        for other in examples.classes:
            if other != label:
                between = float(np.median(examples.cheapest(other, [clip.features for clip in own])))
                if between < similar * within:
                    found.append((label, other, between / within))
    return sorted(found, key=lambda pair: pair[2])


def leave_one_out(
    clips: Sequence[CutClip], others: Sequence[Motion], rng: np.random.Generator, progress: Progress = silent
) -> list[HeldOutScores]:
    """Return the scores of each person with a model of all others, the expected scores of a new person.

    With a single person, halves of the clips take turns; their scores are those of the same person.
    """
    results = []
    symmetric = two_sided(clips)
    for number, (seen, unseen) in enumerate(folds := folds_of(clips, rng), start=1):
        people = {clip.person for clip in unseen}
        name = people.pop() if len({clip.person for clip in clips}) > 1 else f"half {number}"
        model = train(seen, others, rng)
        documents = [
            document
            for hard in (False, True)
            for document in documents_of(unseen, others, rng, hard=hard, symmetric=symmetric)
        ]
        results.append(replace(scores_on(model, documents), person=name))
        progress("leaving one person out", number, len(folds))
    return results


def scores_on(model: MotionModel, documents: Sequence[Document]) -> HeldOutScores:
    """Return the scores per label of a model on documents; labels outside the model count as missed."""
    nothing = Scores(0, 0, 0, 0)
    known = {segment.label for document in documents for segment in document.segments}
    labels = sorted(known | set(model.labels))
    frames, segments = dict.fromkeys(labels, nothing), dict.fromkeys(labels, nothing)
    for document in documents:
        if len(document.features) < model.examples.shortest:
            continue
        found = model.annotate(document.features).segments
        size = len(document.features), document.features.frame_rate
        true_rows, found_rows = (label_frames(part, labels, *size) for part in (document.segments, found))
        for row, label in enumerate(labels):
            frames[label] += frame_scores(true_rows[[row]], found_rows[[row]])
            segments[label] += segment_scores(
                [s for s in document.segments if s.label == label], [s for s in found if s.label == label]
            )
    return HeldOutScores("", frames, segments)
