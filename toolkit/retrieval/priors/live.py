"""Which class a motion that goes on belongs to, and how far it has come: alignments of beginnings of templates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from toolkit.kernels import dtw
from toolkit.retrieval.annotation.annotator import MotionClass, PreparedTemplate

BEGUN = 0.25
"""Share of a template that has to be seen before it says how the motion goes on."""


class Going(NamedTuple):
    """A motion that goes on: rows of class and template, the template's column now, and the cost so far."""

    label: int
    template: int
    column: int
    cost: float


class LiveAlignment:
    """The templates of all classes against the columns so far (thesis, Eq. 5.2, column by column).

    Parameters
    ----------
    classes : those without motions take part: they keep others from being mistaken
    threshold : costs at or above it say nothing
    """

    def __init__(self, classes: Sequence[MotionClass], threshold: float) -> None:
        self._threshold = threshold
        self._templates = [
            (row, part, PreparedTemplate(template))
            for row, motion_class in enumerate(classes)
            for part, template in enumerate(motion_class.templates)
        ]
        self._costs = [np.full((3, t.length), np.inf) for _, _, t in self._templates]
        self._starts = [np.full((3, t.length), -1, dtype=np.int64) for _, _, t in self._templates]
        self._columns = 0

    def push(self, word: np.uint64) -> Going | None:
        """One more column, as a bit word; the cheapest beginning of a template that ends in it, if there is one."""
        column, best = self._columns, None
        self._columns += 1
        for (row, part, template), costs, starts in zip(self._templates, self._costs, self._starts, strict=True):
            dtw.push_column(template.bits, template.mask, template.scale, word, column, costs, starts)
            first = max(1, int(np.ceil(BEGUN * template.length)))
            # The cost of a beginning counts for all of the template's columns: per column of its own.
            shares = costs[column % 3, first:] * template.length / np.arange(first + 1, template.length + 1)
            if not len(shares):
                continue
            place = int(shares.argmin())
            if shares[place] < self._threshold and (best is None or shares[place] < best.cost):
                best = Going(row, part, first + place, float(shares[place]))
        return best
