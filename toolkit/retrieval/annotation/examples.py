"""Labelled example clips, and their matches in documents: possible places of a class with their differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion.graded import differences, distinct_hits, nearest_example
from toolkit.retrieval.features.grades import BLOCK_COLUMNS, FULL, coarse, importance
from toolkit.retrieval.features.relational import FeatureMatrix


class Proposals(NamedTuple):
    """Possible places of a class in some documents, H places; columns are coarse (`grades.BLOCK_COLUMNS` frames).

    Attributes
    ----------
    documents : int64 (H,)
    firsts, lasts : int64 (H,), first and last column within the document
    described : float64 (H, 42), mean difference of each feature's grades to that example (1 = 127 grades), its cost in
        tenths, and the logarithm of its duration against the example's
    """

    documents: np.ndarray
    firsts: np.ndarray
    lasts: np.ndarray
    described: np.ndarray


@dataclass(frozen=True, eq=False)
class ExampleSet:
    """Labelled clips.

    Attributes
    ----------
    labels : labels of each clip
    names : names of each clip
    columns : int8 (S, 40), coarse graded features of all clips, one after the other
    starts : int64 (E + 1,), first column of each clip; the last entry is S
    weights : float64 (E, 40), weight of each feature of a clip
    """

    labels: tuple[str, ...]
    names: tuple[str, ...]
    columns: np.ndarray
    starts: np.ndarray
    weights: np.ndarray

    @classmethod
    def of(cls, clips: Sequence[tuple[FeatureMatrix, str]]) -> ExampleSet:
        """Return the set of clips with their labels.

        Raises
        ------
        RetrievalError
            There are no clips, or one is too short.
        """
        if not clips:
            raise RetrievalError("there are no labelled clips to learn from; give at least one")
        shortest = BLOCK_COLUMNS + 1  # frames, two coarse columns
        short = [features for features, _ in clips if len(features) < shortest]
        if short:
            raise RetrievalError(
                f"example {short[0].name!r} has {len(short[0])} frames at 30 Hz; give at least {shortest}, or "
                "leave it out"
            )
        columns = [np.ascontiguousarray(coarse(features.grades).T) for features, _ in clips]
        return cls(
            tuple(label for _, label in clips),
            tuple(features.name for features, _ in clips),
            np.concatenate(columns),
            np.cumsum([0, *map(len, columns)]),
            np.array([importance(features.grades) for features, _ in clips]),
        )

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def classes(self) -> tuple[str, ...]:
        """Labels of the clips, sorted."""
        return tuple(sorted(set(self.labels)))

    def of_class(self, label: str) -> np.ndarray:
        """Return the numbers of a class's clips, int64 (C,)."""
        return np.flatnonzero(np.array(self.labels) == label)

    @property
    def shortest(self) -> int:
        """Smallest number of frames at 30 Hz of a document; every step may skip one column."""
        return int(BLOCK_COLUMNS * (np.diff(self.starts).min() // 2) + 1)

    @cached_property
    def _floats(self) -> tuple[np.ndarray, np.ndarray]:
        """Columns and weights for the kernels; the cost of a path is the mean over a clip's columns."""
        lengths = np.diff(self.starts)[:, None]
        return self.columns.astype(np.float32), (self.weights / (2.0 * FULL * lengths)).astype(np.float32)

    def propose(self, label: str, documents: Sequence[FeatureMatrix]) -> Proposals:
        """Return the possible places of a class: distinct hits of the nearest example in each column."""
        return self.propose_in(label, *_joined(documents))

    def propose_in(self, label: str, columns: np.ndarray, edges: np.ndarray) -> Proposals:
        """Return the places in coarse columns, int8 (M, 40), of documents that start at `edges`, int64 (D + 1,)."""
        examples, weights = self._floats
        costs, starts, nearest = nearest_example(examples, self.starts, weights, self.of_class(label), columns, edges)
        # Largest cost of a place: motions of a class by other people cost 0.05 to 0.2, random ones 0.2 to 0.3.
        largest_cost = 0.3
        owners, firsts, lasts = distinct_hits(costs, starts, edges, largest_cost, len(costs)).T
        ends = edges[owners] + lasts
        numbers = nearest[ends].astype(np.int64)
        places = np.stack([numbers, edges[owners] + firsts, ends], axis=1)
        apart = differences(examples, self.starts, weights, columns, places) / FULL
        longer = np.log((lasts + 1 - firsts) / np.diff(self.starts)[numbers])
        described = np.column_stack([apart, 10.0 * costs[ends], longer])
        return Proposals(owners, firsts, lasts, described.astype(np.float64))

    def cheapest(self, label: str, documents: Sequence[FeatureMatrix], without: str = "") -> np.ndarray:
        """Return the cost of the class's best alignment in each document, float64 (D,), infinite for none.

        Parameters
        ----------
        label : class
        documents : documents to search
        without : name of an excluded clip
        """
        chosen = np.array([e for e in self.of_class(label) if self.names[e] != without], dtype=np.int64)
        columns, edges = _joined(documents)
        examples, weights = self._floats
        costs, _, _ = nearest_example(examples, self.starts, weights, chosen, columns, edges)
        return np.minimum.reduceat(costs, edges[:-1]).astype(np.float64)


def _joined(documents: Sequence[FeatureMatrix]) -> tuple[np.ndarray, np.ndarray]:
    """Return the coarse columns of all documents, int8 (M, 40), and their starts, int64 (D + 1,), ending with M."""
    pieces = [np.ascontiguousarray(coarse(document.grades).T) for document in documents]
    return np.concatenate(pieces), np.cumsum([0, *map(len, pieces)])
