"""Learning a motion model as it will be used: on documents of people whose clips are not among the examples.

Each person's clips in turn are put together into documents, easy ones and hard ones: joined smoothly or abruptly, with
excerpts of motions of no class, and with the mirror images of one-sided motions, which are none of their class. What
the other people's clips find there, right and wrong, and what they find in the motions of no class, mirrored, faster
and slower ones too, is what the judges learn from. With one person alone, clips take turns in halves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.io.progress import Progress, silent
from toolkit.retrieval.annotation.documents import HARD_JOINS, JOINS, Document, assemble, shuffled_parts
from toolkit.retrieval.annotation.examples import ExampleSet, Proposals
from toolkit.retrieval.annotation.judge import Turn, joined, learn_judges
from toolkit.retrieval.annotation.measures import Scores, frame_scores, label_frames, segment_scores
from toolkit.retrieval.annotation.model import MotionModel
from toolkit.retrieval.features.grades import BLOCK
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features

ROUNDS = 2
"""How often every person's clips become documents, easy and hard ones each time."""
CLIPS_PER_DOCUMENT = 12
SPEEDS = (0.7, 1.0, 1.4)
"""Speeds at which motions of no class are counterexamples."""
ONE_SIDED = 1.5
"""A class is one-sided if its mirror images cost more than this many times what its clips cost one another."""
ALIKE = 1.25
"""Two classes are alike if clips of one cost, by examples of the other, less than this many times their own."""


@dataclass(frozen=True, eq=False)
class CutClip:
    """A cut clip.

    Attributes
    ----------
    motion : the clip, and nothing but the motion
    label : its class
    person : who performs it, "" if unknown
    """

    motion: Motion
    label: str
    person: str = ""

    @cached_property
    def features(self) -> FeatureMatrix:
        """Its features."""
        return relational_features(self.motion)

    @cached_property
    def mirror_features(self) -> FeatureMatrix:
        """Features of its mirror image."""
        return relational_features(self.motion.mirrored())


@dataclass(frozen=True, eq=False)
class LeftOut:
    """How a model of the other people did on one person's documents.

    Attributes
    ----------
    person : who was left out
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
    """Learn a model: all clips are its examples, its judges come from what some clips find in documents of others.

    Parameters
    ----------
    clips : of at least one class
    others : motions that hold none of the classes: counterexamples
    rng : source of all randomness
    progress : told after each part

    Raises
    ------
    RetrievalError
        No clips, or a class with a single clip and nothing to tell it from.
    """
    if not clips:
        raise RetrievalError("there are no labelled clips to learn from; give at least one")
    labels = sorted({clip.label for clip in clips})
    if len(labels) == 1 and not others:
        raise RetrievalError(
            f"all clips have the label {labels[0]!r}, so there is nothing to tell it from; give clips of other "
            "classes, or motions of none"
        )
    several = len({clip.person for clip in clips}) > 1  # halves of one person teach no caution about others
    found = _what_clips_find(clips, others, rng, progress)
    turns = {label: {turn: joined(parts) for turn, parts in found[label].items()} for label in labels}
    judges = learn_judges(turns, cautious=several)
    return MotionModel(
        ExampleSet.of([(clip.features, clip.label) for clip in clips]), tuple(judges[label] for label in labels)
    )


def _what_clips_find(
    clips: Sequence[CutClip],
    others: Sequence[Motion],
    rng: np.random.Generator,
    progress: Progress,
) -> dict[str, dict[int, list[Turn]]]:
    """Per label and turn: what places in documents of known truth measure, and whether they are right."""
    symmetric, labels = two_sided(clips), {clip.label for clip in clips}
    empty = [
        Document(side.at_speed(speed)) for motion in others for side in (motion, motion.mirrored()) for speed in SPEEDS
    ]
    rows: dict[str, dict[int, list[Turn]]] = {label: {} for label in labels}
    steps = [
        (turn, parts, hard)
        for _ in range(ROUNDS)
        for turn, parts in enumerate(turns_of(clips, rng))
        for hard in (False, True)
    ]
    for number, (turn, (seen, unseen), hard) in enumerate(steps, start=1):
        documents = documents_of(unseen, others, rng, hard=hard, symmetric=symmetric) + (empty if hard else [])
        examples = ExampleSet.of([(clip.features, clip.label) for clip in seen])
        for label in examples.classes:
            places = examples.propose(label, [document.features for document in documents])
            rows[label].setdefault(turn, []).append((places.described, rightness(places, label, documents)))
        progress("learning", number, len(steps))
    return rows


def turns_of(clips: Sequence[CutClip], rng: np.random.Generator) -> list[tuple[list[CutClip], list[CutClip]]]:
    """(Examples, clips for documents): each person against all others, or two random halves of every class of one.

    There are none where every class has a single clip: a clip that is sought with itself teaches nothing.
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
    """Documents that hold every clip once, with excerpts of `others` between.

    Parameters
    ----------
    clips : of one person, say
    others : motions of no class
    rng : source of all randomness
    hard : join abruptly, and put in the mirror images of all clips of one-sided classes, without a label
    symmetric : classes that are not one-sided
    """
    rate = max(motion.frame_rate for motion in (*(clip.motion for clip in clips), *others))
    parts: list[tuple[Motion, str | None]] = [(clip.motion.at_rate(rate), clip.label) for clip in clips]
    if hard:
        one_sided = [clip for clip in clips if clip.label not in symmetric]
        parts += [(clip.motion.mirrored().at_rate(rate), None) for clip in one_sided]
    mixed = shuffled_parts(parts, [motion.at_rate(rate) for motion in others], rng)
    groups = [mixed[k : k + CLIPS_PER_DOCUMENT] for k in range(0, len(mixed), CLIPS_PER_DOCUMENT)]
    return [assemble(f"document {i}", group, HARD_JOINS if hard else JOINS) for i, group in enumerate(groups)]


def rightness(places: Proposals, label: str, documents: Sequence[Document]) -> np.ndarray:
    """Bool (H,): a place is right if it and a true segment share half of the longer of the two."""
    right = np.zeros(len(places.documents), dtype=bool)
    for k, (owner, first, last) in enumerate(zip(places.documents, places.firsts, places.lasts, strict=True)):
        document = documents[owner]
        rate = document.features.frame_rate
        start, stop = BLOCK * first / rate, BLOCK * (last + 1) / rate
        right[k] = any(
            2 * (min(stop, s.end) - max(start, s.start)) >= max(stop - start, s.end - s.start)
            for s in document.segments
            if s.label == label
        )
    return right


def two_sided(clips: Sequence[CutClip]) -> frozenset[str]:
    """Classes whose mirror images are of the class too: they cost about what its clips cost one another."""
    examples = ExampleSet.of([(clip.features, clip.label) for clip in clips])
    found = set()
    for label in examples.classes:
        own = [clip for clip in clips if clip.label == label]
        if len(own) == 1:
            continue
        costs = np.array(
            [examples.cheapest(label, [clip.features, clip.mirror_features], clip.motion.name) for clip in own]
        )
        straight, mirrored = np.median(costs, axis=0)
        if mirrored <= ONE_SIDED * straight:
            found.add(label)
    return frozenset(found)


def alike(clips: Sequence[CutClip]) -> list[tuple[str, str, float]]:
    """Pairs of classes that are hard to tell apart: (class, the other, its clips' median cost by examples of the other
    as a multiple of that by its own), the most alike first."""
    examples = ExampleSet.of([(clip.features, clip.label) for clip in clips])
    found = []
    for label in examples.classes:
        own = [clip for clip in clips if clip.label == label]
        if len(own) < 2:
            continue
        within = float(np.median([examples.cheapest(label, [c.features], c.motion.name)[0] for c in own]))
        for other in examples.classes:
            if other != label:
                between = float(np.median(examples.cheapest(other, [clip.features for clip in own])))
                if between < ALIKE * within:
                    found.append((label, other, between / within))
    return sorted(found, key=lambda pair: pair[2])


def leave_one_out(
    clips: Sequence[CutClip], others: Sequence[Motion], rng: np.random.Generator, progress: Progress = silent
) -> list[LeftOut]:
    """How well each person is annotated by a model of all others: what to expect for a new person.

    With one person alone, halves of the clips take turns; that is what to expect for the same person again.
    """
    results = []
    symmetric = two_sided(clips)
    for number, (seen, unseen) in enumerate(turns := turns_of(clips, rng), start=1):
        people = {clip.person for clip in unseen}
        name = people.pop() if len({clip.person for clip in clips}) > 1 else f"half {number}"
        model = train(seen, others, rng)
        documents = [
            document
            for hard in (False, True)
            for document in documents_of(unseen, others, rng, hard=hard, symmetric=symmetric)
        ]
        results.append(replace(judged(model, documents), person=name))
        progress("leaving one person out", number, len(turns))
    return results


def judged(model: MotionModel, documents: Sequence[Document]) -> LeftOut:
    """Scores per label of a model on documents; labels that it does not know count as missed."""
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
    return LeftOut("", frames, segments)
