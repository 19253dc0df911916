"""Templates of all classes against the columns so far: subsequence DTW, column by column (thesis, Eq. 5.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.kernels.motion import dtw
from toolkit.retrieval.annotation.annotator import MotionClass, PreparedTemplate


class CausalAlignments:
    """What `PreparedTemplate.distance` says of the columns so far, of every template and every beginning of one.

    Parameters
    ----------
    classes : whose templates are aligned

    Attributes
    ----------
    owner, part, lengths : int64 (M,), row of the class of each of M templates, number within it, and columns
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
        self._bits = np.concatenate([template.bits for _, _, template in found])
        self._mask = np.concatenate([template.mask for _, _, template in found])
        self._scale = np.concatenate([template.scale for _, _, template in found])
        self._costs = np.full((3, self._bounds[-1]), np.inf)
        self._starts = np.full(self._costs.shape, -1, dtype=np.int64)
        self.column = -1

    def push(self, word: np.uint64) -> None:
        """One more column of the document, as a bit word."""
        self.column += 1
        dtw.push_columns(
            self._bits, self._mask, self._scale, self._bounds, word, self.column, self._costs, self._starts
        )

    @property
    def costs(self) -> np.ndarray:
        """See the class."""
        return self._costs[self.column % 3]

    @property
    def starts(self) -> np.ndarray:
        """See the class."""
        return self._starts[self.column % 3]

    def cheapest(self) -> tuple[np.ndarray, np.ndarray]:
        """Per class the least cost of its whole templates, the first on ties, and its start: float64 and int64 (P,)."""
        ends = self._bounds[1:] - 1
        costs = self.costs[ends]
        cheapest = np.lexsort((costs, self.owner))[np.searchsorted(self.owner, np.unique(self.owner))]
        return costs[cheapest], self.starts[ends][cheapest]
