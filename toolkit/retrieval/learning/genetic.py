"""Genetic algorithm that learns a keyframe query from examples, one run (thesis, Sections 4.1 to 4.4)."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from math import ceil, floor
from typing import NamedTuple

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.retrieval.features.relational import FEATURES, FeatureMatrix, pack
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery
from toolkit.retrieval.search.find import Segments, hits_of, matching_segments
from toolkit.retrieval.templates import QuantisedTemplate

FEWEST_KEYFRAMES = 2
"""Smallest number of keyframes of a query."""
BETA = 2.0
"""Weight of recall relative to precision in the fitness."""


@dataclass(frozen=True)
class GeneticSettings:
    """Settings of the genetic algorithm; the defaults are the thesis's.

    Attributes
    ----------
    population : M, individuals that survive a generation
    generations : G
    parents : r, individuals recombined pairwise, giving r (r - 1) / 2 offspring per generation
    """

    population: int = 50
    generations: int = 100
    parents: int = 5


class PlacedKeyframe(NamedTuple):
    """Keyframe at a column of the template."""

    column: int
    keyframe: Keyframe


@dataclass(frozen=True)
class Individual:
    """Keyframe query in the learner's form (V, d'), Eq. 4.1 and 4.3.

    Attributes
    ----------
    placed : K keyframes in the order of their columns
    distances : least and greatest distance in frames of neighbouring keyframes, K - 1
    """

    placed: tuple[PlacedKeyframe, ...]
    distances: tuple[tuple[int, int], ...]

    @property
    def columns(self) -> list[int]:
        """Template columns of the keyframes, ascending."""
        return [column for column, _ in self.placed]

    @property
    def generality(self) -> tuple[int, int]:
        """Generality: minus the number of entries other than wildcards, then the freedom in all distances."""
        entries = sum(keyframe.mask.bit_count() for _, keyframe in self.placed)
        return -entries, sum(greatest - least for least, greatest in self.distances)

    def query(self, length: int, label: str) -> KeyframeQuery:
        """Return the query of the index with the lead and tail of a template of `length` columns."""
        keyframes, columns = tuple(keyframe for _, keyframe in self.placed), self.columns
        return KeyframeQuery(keyframes, self.distances, columns[0], length - 1 - columns[-1], label)


@dataclass(frozen=True)
class Quality:
    """Precision, recall and F-measure of a query over documents, Eq. 4.9 to 4.11; 0 without relevant results."""

    precision: float
    recall: float
    fitness: float

    @classmethod
    def of(cls, retrieved: np.ndarray, relevant: np.ndarray, beta: float = BETA) -> Quality:
        """Compare two Boolean arrays (D,)."""
        true = int(np.count_nonzero(retrieved & relevant))
        if true == 0:
            return cls(0.0, 0.0, 0.0)
        precision, recall = true / int(np.count_nonzero(retrieved)), true / int(np.count_nonzero(relevant))
        return cls(precision, recall, (1 + beta**2) * precision * recall / (beta**2 * precision + recall))


class TrainingSet:
    """Documents with the relevant ones marked; evaluates individuals.

    Keyframe lists are cached, because offspring share most of their keyframes with their parents.
    """

    def __init__(self, documents: Sequence[FeatureMatrix], relevant: Sequence[bool]) -> None:
        """Index the documents.

        Parameters
        ----------
        documents : positive and negative examples T
        relevant : bool per document, True for the examples T+ of the class

        Raises
        ------
        RetrievalError
            There is no positive or no negative example.
        """
        self.relevant = np.asarray(relevant, dtype=bool)
        if self.relevant.shape != (len(documents),):
            raise RetrievalError(f"{len(documents)} documents came with {self.relevant.size} marks; give one each")
        if not self.relevant.any() or self.relevant.all():
            kind = "relevant" if not self.relevant.any() else "other"
            raise RetrievalError(f"the training set has no {kind} document; keyframes are learned from both kinds")
        self.document_starts = np.cumsum([0, *(len(document) for document in documents)])
        self.words = np.concatenate([document.words for document in documents])
        self._cache: dict[Keyframe, Segments] = {}

    def retrieved(self, individual: Individual) -> np.ndarray:
        """Return the documents with at least one hit (Algorithm 1), bool (D,)."""
        lists = [self._segments(keyframe) for _, keyframe in individual.placed]
        found = np.zeros(len(self.relevant), dtype=bool)
        found[hits_of(lists, individual.distances, self.document_starts)[0]] = True
        return found

    def quality(self, individual: Individual, beta: float = BETA) -> Quality:
        """Return the precision, recall and fitness of an individual on these documents."""
        return Quality.of(self.retrieved(individual), self.relevant, beta)

    def _segments(self, keyframe: Keyframe) -> Segments:
        if keyframe not in self._cache:
            most = 1024  # cached lists
            if len(self._cache) >= most:
                self._cache.clear()
            self._cache[keyframe] = matching_segments(self.words, self.document_starts, keyframe)
        return self._cache[keyframe]


class Breeder:
    """Random operations that make individuals from a strict template."""

    def __init__(self, template: QuantisedTemplate, rng: np.random.Generator) -> None:
        """Prepare the template's columns; at least two have an entry other than the wildcard."""
        self.rng = rng
        bits = zip(pack(~template.wildcards).tolist(), pack(template.values == 1).tolist(), strict=True)
        self.columns = {n: PlacedKeyframe(n, Keyframe(*pair)) for n, pair in enumerate(bits) if pair[0]}

    def individual(self) -> Individual:
        """Return K random columns of the template with random tolerances of their distances."""
        wanted = round(self.rng.normal(3.0, 2.0))  # mean and standard deviation of the initial number
        count = min(max(FEWEST_KEYFRAMES, wanted), len(self.columns))
        chosen = sorted(self.rng.choice(list(self.columns), count, replace=False).tolist())
        return self.assembled([self.columns[n] for n in chosen])

    def assembled(self, placed: Sequence[PlacedKeyframe]) -> Individual:
        """Return an individual of ordered keyframes, with new admissible distances (Algorithm 2, line 7)."""
        return Individual(tuple(placed), tuple(self.tolerance(b.column - a.column) for a, b in pairwise(placed)))

    def tolerance(self, distance: int) -> tuple[int, int]:
        """Return random admissible distances around a template distance (Algorithm 2, lines 8 to 10)."""
        half = distance / 2
        down, up = 2.0 * self.rng.random(), 2.0 * self.rng.random()
        return max(0, floor(half - round(half * down))), ceil(half + round(half * up))

    def recombined(self, a: Individual, b: Individual) -> Individual:
        """Combine some keyframes of each parent by template column; at equal columns the first parent's is used."""
        merged = {one.column: one for parent in (b, a) for one in self._some(parent.placed)}
        while len(merged) < FEWEST_KEYFRAMES:
            one = a.placed[self.rng.integers(len(a.placed))]
            merged[one.column] = one
        return self.assembled([merged[n] for n in sorted(merged)])

    def _some(self, placed: Sequence[PlacedKeyframe]) -> list[PlacedKeyframe]:
        count = self.rng.integers(1, len(placed), endpoint=True)
        return [placed[i] for i in self.rng.permutation(len(placed))[:count]]

    def mutated(self, individual: Individual) -> Individual:
        """Apply one of the three mutations, chosen at random."""
        return (self.with_other_keyframes, self.with_other_entry, self.with_other_distances)[self.rng.integers(3)](
            individual
        )

    def with_other_keyframes(self, individual: Individual) -> Individual:
        """Add a random column of the template or remove a random keyframe."""
        count, columns = len(individual.placed), individual.columns
        free = [n for n in self.columns if n not in columns]
        if count > FEWEST_KEYFRAMES and (not free or self.rng.random() < 0.5):
            return self.without(individual, int(self.rng.integers(count)))
        return self.extended(individual, free[self.rng.integers(len(free))]) if free else individual

    def without(self, individual: Individual, k: int) -> Individual:
        """Remove keyframe k; the distances to its two neighbours are added."""
        placed, distances = individual.placed, individual.distances
        first = max(k - 1, 0)
        least, greatest = (sum(part) for part in zip(*distances[first : k + 1], strict=True))
        inside = [(least, greatest)] if 0 < k < len(distances) else []
        return Individual((*placed[:k], *placed[k + 1 :]), (*distances[:first], *inside, *distances[k + 1 :]))

    def extended(self, individual: Individual, column: int) -> Individual:
        """Add a column of the template; the gaps beside it get new distances."""
        k = sum(n < column for n in individual.columns)
        placed = (*individual.placed[:k], self.columns[column], *individual.placed[k:])
        gaps = [b.column - a.column for a, b in pairwise(placed[max(k - 1, 0) : k + 2])]
        distances = individual.distances
        return Individual(placed, (*distances[: max(k - 1, 0)], *map(self.tolerance, gaps), *distances[k:]))

    def with_other_entry(self, individual: Individual) -> Individual:
        """Generalise some entries of a random keyframe to wildcards, or specialise one wildcard to 0 or 1."""
        k = int(self.rng.integers(len(individual.placed)))
        column, (mask, value) = individual.placed[k]
        known = [i for i in range(len(FEATURES)) if mask >> i & 1]
        free = [i for i in range(len(FEATURES)) if not mask >> i & 1]
        if len(known) > 1 and (not free or self.rng.random() < 0.5):
            count = self.rng.integers(1, len(known))
            bits = sum(1 << known[i] for i in self.rng.permutation(len(known))[:count])
            mask, value = mask & ~bits, value & ~bits
        else:
            bit = 1 << free[self.rng.integers(len(free))]
            mask, value = mask | bit, value | (bit if self.rng.random() < 0.5 else 0)
        changed = PlacedKeyframe(column, Keyframe(mask, value))
        return replace(individual, placed=(*individual.placed[:k], changed, *individual.placed[k + 1 :]))

    def with_other_distances(self, individual: Individual) -> Individual:
        """Change every admissible distance by up to a quarter of the template's, at least one frame.

        The maximum is twice the template's distance, because cut clips do not penalise larger distances and long
        documents do.
        """
        gaps, (least, greatest) = np.diff(individual.columns), np.array(individual.distances).T
        reach = np.maximum(1, np.rint(gaps / 4)).astype(np.int64)
        low, high = self.rng.integers(-reach, reach, size=(2, len(gaps)), endpoint=True)
        minimum = np.clip(least + low, 0, 2 * gaps)
        maximum = np.clip(greatest + high, minimum, np.maximum(minimum, 2 * gaps))
        return replace(individual, distances=tuple(zip(minimum.tolist(), maximum.tolist(), strict=True)))


def sampled_universally(fitness: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Sample universally (Baker 1987): `count` indices, each expected in proportion to its fitness."""
    total = np.cumsum(fitness)
    if total[-1] <= 0.0:
        return rng.integers(len(fitness), size=count)
    pointers = (rng.random() + np.arange(count)) * (total[-1] / count)
    return np.minimum(np.searchsorted(total, pointers, side="right"), len(fitness) - 1)


Observer = Callable[[int, Sequence[Individual]], None]
"""Callback with the number of the generation, from 0, and its population, the best first."""


Ranking = list[tuple[tuple[float, int, int], Individual]]
"""Individuals with their fitness and generality, the best first."""


def ranked(training: TrainingSet, individuals: Iterable[Individual], known: Ranking | None = None) -> Ranking:
    """Rank individuals, together with those of a `known` ranking.

    Among equally fit individuals the more general one is better, because training data cannot distinguish them and each
    extra entry may exclude another person. Not part of the thesis.
    """
    found = [((training.quality(member).fitness, *member.generality), member) for member in individuals]
    return sorted([*(known or ()), *found], key=lambda entry: entry[0], reverse=True)


def evolve(
    training: TrainingSet,
    template: QuantisedTemplate,
    settings: GeneticSettings,
    rng: np.random.Generator,
    observe: Observer | None = None,
) -> Individual:
    """Run Algorithm 3 and return the best individual after all generations."""
    breeder = Breeder(template, rng)
    population = ranked(training, [breeder.individual() for _ in range(settings.population)])
    for generation in range(settings.generations):
        if observe is not None:
            observe(generation, [member for _, member in population])
        fitness = np.array([merit[0] for merit, _ in population])
        parents = [population[i][1] for i in sampled_universally(fitness, settings.parents, rng)]
        offspring = [breeder.mutated(breeder.recombined(a, b)) for a, b in combinations(parents, 2)]
        population = ranked(training, offspring, population)[: settings.population]
    return population[0][1]


def tightened(documents: TrainingSet, individual: Individual) -> Individual:
    """Return the individual with the smallest greatest distances that keep its recall.

    Of equally fit individuals evolution prefers those with larger distances. In long documents unnecessarily large
    distances make hits begin long before the motion; in cut clips they have no effect.
    """
    recall = documents.quality(individual, 1.0).recall
    for k, (least, most) in enumerate(individual.distances):
        before, after = individual.distances[:k], individual.distances[k + 1 :]
        limited = [
            replace(individual, distances=(*before, (least, greatest), *after)) for greatest in range(least, most + 1)
        ]
        individual = limited[
            bisect_left(limited[:-1], True, key=lambda member: documents.quality(member, 1.0).recall >= recall)
        ]
    return individual


def with_best_distances(
    training: TrainingSet, breeder: Breeder, placed: Sequence[PlacedKeyframe], settings: GeneticSettings
) -> Individual:
    """Find distances for fixed keyframes in the same manner: Algorithm 2 for a start, then only their mutation."""
    first = ranked(training, [breeder.assembled(placed) for _ in range(settings.population)])
    survivors = first[: settings.parents]
    for _ in range(settings.generations):
        offspring = [breeder.with_other_distances(member) for _, member in survivors]
        survivors = ranked(training, offspring, survivors)[: settings.parents]
    return survivors[0][1]
