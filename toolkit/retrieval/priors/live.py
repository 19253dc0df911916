"""Which class a motion that goes on belongs to, and how far it has come: alignments of beginnings of templates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.causal import CausalAlignments

BEGUN = 0.25
"""Share of a template that has to be seen before it says how the motion goes on."""


class Going(NamedTuple):
    """A motion that goes on: rows of class and template, the template's column now, and the cost so far."""

    label: int
    template: int
    column: int
    cost: float


class LiveAlignment:
    """The templates of all classes against the columns so far.

    Parameters
    ----------
    classes : those without motions take part: they keep others from being mistaken
    threshold : costs at or above it say nothing
    """

    def __init__(self, classes: Sequence[MotionClass], threshold: float) -> None:
        self._threshold, self._aligned = threshold, CausalAlignments(classes)
        # The cost of a beginning counts for all of the template's columns: per column of its own.
        columns = [np.arange(1, length + 1) for length in self._aligned.lengths]
        begun = [column > max(1.0, np.ceil(BEGUN * len(column))) for column in columns]
        self._open = np.flatnonzero(np.concatenate(begun))
        self._shares = np.concatenate([len(column) / column for column in columns])[self._open]

    def push(self, word: np.uint64) -> Going | None:
        """One more column, as a bit word; the cheapest beginning of a template that ends in it, if there is one."""
        aligned = self._aligned
        aligned.push(word)
        shares = aligned.costs[self._open] * self._shares
        cheapest = int(shares.argmin()) if len(shares) else -1
        if cheapest < 0 or not shares[cheapest] < self._threshold:
            return None
        place = int(self._open[cheapest])
        row = int(np.searchsorted(aligned.first, place, side="right")) - 1
        column = place - int(aligned.first[row])
        return Going(int(aligned.owner[row]), int(aligned.part[row]), column, float(shares[cheapest]))
