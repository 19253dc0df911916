"""Templates of all classes against the columns so far: subsequence DTW, column by column (thesis, Eq. 5.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.kernels import dtw
from toolkit.retrieval.annotation.annotator import MotionClass, PreparedTemplate


class CausalAlignments:
    """What `PreparedTemplate.distance` says of the columns so far, of every template and every beginning of one.

    Parameters
    ----------
    classes : whose templates are aligned

    Attributes
    ----------
    owner, part, lengths : int64 (M,), row of the class of each of M templates, number within it, and columns
    first : int64 (M,), where each template begins among the K columns of all
    column : number of the last column of the document, -1 before the first one
    costs, starts : float64 and int64 (K,), cheapest alignment of each beginning that ends in the last column, infinite
        where there is none, and its first column
    """

    def __init__(self, classes: Sequence[MotionClass]) -> None:
        found = [
            (row, part, PreparedTemplate(template))
            for row, motion_class in enumerate(classes)
            for part, template in enumerate(motion_class.templates)
        ]
        self.owner = np.array([row for row, _, _ in found], dtype=np.int64)
        self.part = np.array([part for _, part, _ in found], dtype=np.int64)
        self.lengths = np.array([template.length for _, _, template in found], dtype=np.int64)
        self._bounds = np.concatenate([[0], np.cumsum(self.lengths)])
        self.first = self._bounds[:-1]
        self._bits = np.concatenate([template.bits for _, _, template in found])
        self._mask = np.concatenate([template.mask for _, _, template in found])
        self._scale = np.concatenate([template.scale for _, _, template in found])
        self._costs = np.full((3, self._bounds[-1]), np.inf)
        self._starts = np.full(self._costs.shape, -1, dtype=np.int64)
        self._kept = {0: (self._mask, self._scale)}
        self.column = -1

    def push(self, word: np.uint64, unknown: int = 0) -> None:
        """One more column of the document, as a bit word; its rows `unknown` do not count, and the others for them."""
        self.column += 1
        mask, scale = self._known(unknown)
        dtw.push_columns(self._bits, mask, scale, self._bounds, word, self.column, self._costs, self._starts)

    def _known(self, unknown: int) -> tuple[np.ndarray, np.ndarray]:
        """Mask and scale of the templates' columns without some rows, as in `dtw.trace`."""
        if unknown not in self._kept:
            mask = self._mask & ~np.uint64(unknown)
            whole, known = (np.maximum(_ones(words), 1) for words in (self._mask, mask))
            self._kept[unknown] = mask, self._scale * (whole / known)
        return self._kept[unknown]

    @property
    def costs(self) -> np.ndarray:
        """See the class."""
        return self._costs[self.column % 3]

    @property
    def starts(self) -> np.ndarray:
        """See the class."""
        return self._starts[self.column % 3]

    def cheapest(self, places: np.ndarray, factors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Per class the least of costs at some columns (M,), one in each template, times factors (M,); and its start.

        Returns float64 and int64 (P,), for all classes up to the last one that has a template.
        """
        count = int(self.owner[-1]) + 1
        costs, starts = np.empty(count), np.empty(count, dtype=np.int64)
        dtw.cheapest_of(self.costs, self.starts, places, factors, self.owner, costs, starts)
        return costs, starts


def _ones(words: np.ndarray) -> np.ndarray:
    """Set bits of each of some words."""
    return np.unpackbits(words.view(np.uint8).reshape(-1, words.itemsize), axis=1).sum(axis=1)
