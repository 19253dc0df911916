"""Keyframe queries learned from many runs of the genetic algorithm (thesis, Section 4.4)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from typing import Any

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.io.progress import Progress, silent
from toolkit.io.workers import task_of
from toolkit.retrieval.features.lengths import BodyLengths
from toolkit.retrieval.features.motion import Motion
from toolkit.retrieval.features.relational import FEATURES, FeatureMatrix, pack, relational_features
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery
from toolkit.retrieval.learning.genetic import (
    FEWEST_KEYFRAMES,
    Breeder,
    GeneticSettings,
    Individual,
    PlacedKeyframe,
    Quality,
    TrainingSet,
    evolve,
    ranked,
    tightened,
    with_best_distances,
)
from toolkit.retrieval.templates import MotionTemplate, QuantisedTemplate


@dataclass(frozen=True)
class LearningSettings:
    """Settings of keyframe learning.

    Attributes
    ----------
    genetic : settings of one run
    runs : genetic runs per class; the thesis uses 100 to 500
    proportions : factors of the body lengths; every clip is added once more for each
    speeds : speed factors; every clip is added once more for each
    """

    genetic: GeneticSettings = field(default_factory=GeneticSettings)
    runs: int = 100
    proportions: tuple[float, ...] = (0.8, 1.25)
    speeds: tuple[float, ...] = (0.8, 1.25)


@dataclass(frozen=True, eq=False)
class LearnedQuery:
    """Result of keyframe learning for one class.

    Attributes
    ----------
    label : class
    ranked : extracted individuals and the result of each run, the best first
    tight : the same with the smallest sufficient distances, the best first: they leave less of long documents, but
        their hits contain the middle of a motion rather than most of it
    training : quality of the best one on the training set
    template : strict template of the runs
    """

    label: str
    ranked: tuple[Individual, ...]
    tight: tuple[Individual, ...]
    training: Quality
    template: QuantisedTemplate

    @property
    def individual(self) -> Individual:
        """Best individual."""
        return self.ranked[0]

    def alternatives(self, count: int, tight: bool = False) -> list[KeyframeQuery]:
        """Return the best `count` as labelled queries; together they have a higher recall and leave more data."""
        best = (self.tight if tight else self.ranked)[:count]
        return [individual.query(len(self.template), self.label) for individual in best]


def variations(motion: Motion, proportions: Sequence[float], speeds: Sequence[float]) -> list[FeatureMatrix]:
    """Return the features of a motion for each factor of the body lengths, and for each factor of the speed.

    A factor of the lengths scales all thresholds on lengths and speeds, as for another actor or another style; angles
    do not change. A few clips of few actors have too little variation, and keyframes learned from them alone are too
    specific.
    """
    lengths = BodyLengths.of(motion)
    matrices = []
    for factor in proportions:
        scaled = relational_features(motion, BodyLengths(*(factor * length for length in astuple(lengths))))
        matrices.append(replace(scaled, name=f"{motion.name} (lengths x {factor:g})"))
    return [*matrices, *(relational_features(motion.at_speed(factor)) for factor in speeds)]


def training_clips(
    motions: Mapping[str, Sequence[Motion]], settings: LearningSettings
) -> tuple[dict[str, list[FeatureMatrix]], dict[str, list[FeatureMatrix]]]:
    """Return the clips to learn from and the clips to compare candidates on.

    Parameters
    ----------
    motions : label -> cut clips
    settings : proportions and speeds

    Returns
    -------
    classes : per label every clip and its variations
    checks : per label every clip in larger variations (the squares of the factors)
    """
    classes = {
        label: [
            matrix
            for clip in clips
            for matrix in (relational_features(clip), *variations(clip, settings.proportions, settings.speeds))
        ]
        for label, clips in motions.items()
    }
    proportions, speeds = ([factor * factor for factor in part] for part in (settings.proportions, settings.speeds))
    checks = {
        label: [matrix for clip in clips for matrix in variations(clip, proportions, speeds)]
        for label, clips in motions.items()
    }
    return classes, checks


def learn(
    classes: Mapping[str, Sequence[FeatureMatrix]],
    settings: LearningSettings,
    rng: np.random.Generator,
    *,
    labels: Sequence[str] | None = None,
    others: Sequence[FeatureMatrix] = (),
    checks: Mapping[str, Sequence[FeatureMatrix]] | None = None,
    workers: int = 1,
    progress: Progress = silent,
) -> dict[str, LearnedQuery]:
    """Learn one keyframe query per class, with the documents of all other classes as counterexamples.

    The result depends on `rng` alone, not on the number of workers.

    Parameters
    ----------
    classes : label -> cut clips of that class, at 30 Hz
    settings : settings of the runs
    rng : source of all randomness
    labels : classes to learn; all by default
    others : further counterexamples without a label
    checks : label -> held-out clips on which candidates are also compared
    workers : processes
    progress : callback for the number of genetic runs done

    Raises
    ------
    RetrievalError
        A label is unknown, a class has no clips or no common features, or there are no counterexamples.
    """
    from joblib import Parallel, delayed

    labels = list(classes) if labels is None else list(labels)
    if unknown := [label for label in labels if label not in classes]:
        raise RetrievalError(f"unknown label {unknown[0]!r}; the clips have {', '.join(sorted(classes)) or 'none'}")
    check_classes(classes, others)
    documents = [document for clips in classes.values() for document in clips] + list(others)
    owners = np.array([label for label, clips in classes.items() for _ in clips] + [""] * len(others), dtype=object)
    training = {label: TrainingSet(documents, owners == label) for label in labels}
    comparisons = training
    if checks:
        documents = [*documents, *(document for clips in checks.values() for document in clips)]
        owners = np.append(owners, np.array([label for label, clips in checks.items() for _ in clips], dtype=object))
        comparisons = {label: TrainingSet(documents, owners == label) for label in labels}
    templates = {label: MotionTemplate.of(list(classes[label]), strict=True).quantised(delta=0.0) for label in labels}
    for label, template in templates.items():
        if np.count_nonzero(~template.wildcards.all(axis=0)) < FEWEST_KEYFRAMES:
            raise RetrievalError(
                f"the clips of class {label!r} agree in fewer than {FEWEST_KEYFRAMES} columns of "
                "their template; give clips of one kind of motion"
            )
    tasks = [(label, int(seed)) for label in labels for seed in rng.integers(2**63, size=settings.runs)]
    solutions: dict[str, list[Individual]] = {label: [] for label in labels}
    jobs = (
        delayed(task_of(evolve))(training[label], templates[label], settings.genetic, np.random.default_rng(seed))
        for label, seed in tasks
    )
    runs = Parallel(n_jobs=workers, return_as="generator")(jobs)
    for done, ((label, _), individual) in enumerate(zip(tasks, runs, strict=True), start=1):
        solutions[label].append(individual)
        progress(label, done, len(tasks))
    return {
        label: _learned(label, training[label], comparisons[label], templates[label], solutions[label], settings, rng)
        for label in labels
    }


def check_classes(classes: Mapping[str, Sequence[Any]], others: Sequence[Any] | None = None) -> None:
    """Raise RetrievalError if classes of clips cannot be learned, or if one has no counterexamples; `others` None skips
    the second check.
    """
    if not classes:
        raise RetrievalError("there are no labelled clips to learn from; give at least one")
    empty = sorted(label for label, clips in classes.items() if not clips)
    if empty:
        raise RetrievalError(f"class {empty[0]!r} has no clips; give it at least one or leave it out")
    if len(classes) == 1 and others is not None and not others:
        raise RetrievalError(
            f"all clips have the label {next(iter(classes))!r}, so there are no counterexamples; give clips of other "
            "classes, or of none (the default label of a clip is its folder's name)"
        )


def _learned(
    label: str,
    training: TrainingSet,
    comparison: TrainingSet,
    template: QuantisedTemplate,
    solutions: Sequence[Individual],
    settings: LearningSettings,
    rng: np.random.Generator,
) -> LearnedQuery:
    """Extract the most frequent keyframes of the runs in several ways, and rank them and the runs' results."""
    breeder = Breeder(template, rng)
    extracted = [
        with_best_distances(training, breeder, placed, settings.genetic)
        for placed in frequent_keyframes(solutions, len(template))
    ]
    candidates = _ranked([*extracted, *solutions], comparison)
    tight = _ranked([tightened(comparison, candidate) for candidate in candidates], comparison)
    return LearnedQuery(label, candidates, tight, training.quality(candidates[0]), template)


def _ranked(candidates: Iterable[Individual], comparison: TrainingSet) -> tuple[Individual, ...]:
    """Return distinct candidates, the best first."""
    return tuple(member for _, member in ranked(comparison, dict.fromkeys(candidates)))


def votes_of(solutions: Sequence[Individual], length: int) -> tuple[np.ndarray, np.ndarray]:
    """Count the occurrences of each entry and each column of the template among the keyframes of the runs.

    Returns
    -------
    votes : float64 (2, 40, N), number of keyframes from a column with feature value 0 and 1
    counts : float64 (N,), number of keyframes from a column
    """
    votes, counts = np.zeros((2, len(FEATURES), length)), np.zeros(length)
    bits = np.arange(len(FEATURES))
    for individual in solutions:
        for column, (mask, value) in individual.placed:
            votes[0, :, column] += (mask & ~value) >> bits & 1
            votes[1, :, column] += value >> bits & 1
            counts[column] += 1
    return votes, counts


def frequent_keyframes(solutions: Sequence[Individual], length: int) -> Iterator[tuple[PlacedKeyframe, ...]]:
    """Yield the most frequent keyframes of the runs (Fig. 4.2b) for several numbers and fractions of votes.

    Keyframes are at the columns with most runs, apart from each other. A keyframe has the entries on which the given
    fraction of the runs' keyframes around its column agree.
    """
    reach = 2  # largest distance in template columns of keyframes that count as the same one
    box = np.ones(2 * reach + 1)
    votes, counts = votes_of(solutions, length)
    votes = np.apply_along_axis(np.convolve, -1, votes, box, "same")[..., :length]
    counts = np.convolve(counts, box, "same")[:length]
    tried = set()
    # Fractions of the runs' keyframes around a column from which an entry is extracted; the best one is kept.
    shares = (0.6, 0.5, 0.4, 0.3, 0.2, 0.1)
    keyframe_count = 3  # largest number of extracted keyframes
    for wanted in range(FEWEST_KEYFRAMES, keyframe_count + 1):
        apart = max(reach + 1, length // (3 * wanted))
        columns = _peaks(counts, wanted, apart)
        zeros, ones = votes[:, :, columns]
        for share in shares:
            known = np.maximum(zeros, ones) >= share * counts[columns]
            entries = zip(columns, pack(known).tolist(), pack(known & (ones > zeros)).tolist(), strict=True)
            placed = tuple(PlacedKeyframe(n, Keyframe(mask, value)) for n, mask, value in entries if mask)
            if len(placed) >= FEWEST_KEYFRAMES and placed not in tried:
                tried.add(placed)
                yield placed


def _peaks(counts: np.ndarray, wanted: int, apart: int) -> list[int]:
    """Return up to `wanted` columns of highest count, more than `apart` columns from each other, in order."""
    counts = counts.copy()
    positions: list[int] = []
    while len(positions) < wanted and counts.max() > 0:
        n = int(counts.argmax())
        positions.append(n)
        counts[max(0, n - apart) : n + apart + 1] = 0
    return sorted(positions)
