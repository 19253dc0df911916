"""Allocation of frames to columns of class templates (thesis 6.4.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion import dtw
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.annotation.measures import Segment
from toolkit.retrieval.features.relational import FeatureMatrix
from toolkit.retrieval.priors.limb_entries import ROWS_OF_LIMB
from toolkit.retrieval.templates import QuantisedTemplate


@dataclass(frozen=True, eq=False)
class Allocation:
    """Alignment of each of T columns of a document with a class template.

    Attributes
    ----------
    label : int64 (T,), row of the class, -1 for none
    column : int64 (T,), column of the class's template
    cost : float64 (T,), cost of the alignment, infinite for none
    stretch : int64 (T,), number of the aligned segment, -1 for none
    """

    label: np.ndarray
    column: np.ndarray
    cost: np.ndarray
    stretch: np.ndarray

    @classmethod
    def nothing(cls, length: int) -> Allocation:
        """Return an allocation in which no column is aligned."""
        none = np.full(length, -1, dtype=np.int64)
        return cls(none, none.copy(), np.full(length, np.inf), none.copy())

    def at(self, rows: np.ndarray) -> Allocation:
        """Return the allocation of some columns (N,), which may repeat."""
        return Allocation(*(getattr(self, name)[rows] for name in ("label", "column", "cost", "stretch")))


def unknown_rows(hidden: Mapping[str, np.ndarray], length: int) -> np.ndarray:
    """Return the features of occluded limbs as bits, uint64 (length,); `hidden` are bool (length,)."""
    words = np.zeros(length, dtype=np.uint64)
    for limb, flags in hidden.items():
        words[flags] |= np.uint64(ROWS_OF_LIMB[limb])
    return words


def allocate(
    features: FeatureMatrix,
    segments: Sequence[Segment],
    classes: Sequence[MotionClass],
    unknown: np.ndarray | None = None,
) -> Allocation:
    """Align each labelled segment of a document with its class's template.

    Where segments overlap, the alignment with the lower cost is kept.

    Parameters
    ----------
    features : features of the document, 30 Hz
    segments : labelled segments
    classes : all classes
    unknown : uint64 (L,), see `unknown_rows`

    Raises
    ------
    RetrievalError
        A segment has a label of no class.
    """
    labels = [motion_class.label for motion_class in classes]
    words = features.words
    unknown = np.zeros(len(words), dtype=np.uint64) if unknown is None else unknown
    found = Allocation.nothing(len(words))
    for stretch, segment in enumerate(segments):
        if segment.label not in labels:
            known = ", ".join(labels)
            raise RetrievalError(f"label {segment.label!r} is not one of the classes {known}; correct it")
        row = labels.index(segment.label)
        first, stop = (int(np.clip(end, 0, len(words))) for end in segment.frames(features.frame_rate))
        cost, columns = best_end(classes[row].template, words[first:stop], unknown[first:stop])
        here = np.arange(first, first + len(columns))
        better = (columns >= 0) & (cost < found.cost[here])
        at = here[better]
        found.label[at], found.column[at] = row, columns[better]
        found.cost[at], found.stretch[at] = cost, stretch
    return found


def best_end(template: QuantisedTemplate, words: np.ndarray, unknown: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the cost and the columns (L,) of the cheapest alignment that ends in the last part of a segment.

    Unknown features of a document column are ignored, and its other features get their weight. A column outside the
    alignment is -1; a skipped one has the template column of the one before.
    """
    end_share = 0.2  # of a segment, at its end, in which an alignment may end, because labels are wider than hits
    columns = np.full(len(words), -1, dtype=np.int64)
    if not len(words):
        return np.inf, columns
    bits, mask, scale = (part[:, None] for part in template.packed)
    known = mask & ~unknown
    weights = scale * (np.maximum(_bits_set(mask), 1) / np.maximum(_bits_set(known), 1))
    least = max(0, len(words) - int(end_share * len(words)) - 1)
    cost, path = dtw.best_alignment(weights * _bits_set((words ^ bits) & known), least)
    if len(path):
        ends = path[::-1, 1]
        here = np.arange(ends[0], ends[-1] + 1)
        columns[here] = path[::-1, 0][np.searchsorted(ends, here, side="right") - 1]
    return cost, columns


def _bits_set(words: np.ndarray) -> np.ndarray:
    """Return the number of set bits of each word, uint64 (N, M)."""
    return np.unpackbits(np.ascontiguousarray(words)[..., None].view(np.uint8), axis=-1).sum(axis=-1)
