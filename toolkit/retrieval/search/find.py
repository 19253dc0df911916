"""Keyframe-based search and its candidates for a refined search (thesis, Sections 3.4 to 3.6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.kernels.motion.keyframe_search import UNBOUNDED, keyframe_search, windows_around
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery


@dataclass(frozen=True)
class Match:
    """Result of a search.

    Attributes
    ----------
    document : name of the document
    start, end : seconds from the start of the document
    cost : difference from the query, 0 = equal
    """

    document: str
    start: float
    end: float
    cost: float


@dataclass(frozen=True, eq=False)
class HitRanges:
    """Disjoint ranges of documents, in order.

    Attributes
    ----------
    documents : int64 (H,), number of the document
    starts : int64 (H,), first frame in the document, from 0, at 30 Hz
    stops : int64 (H,), frame after the last one
    """

    documents: np.ndarray
    starts: np.ndarray
    stops: np.ndarray

    def __len__(self) -> int:
        return len(self.documents)

    @property
    def frames(self) -> int:
        """Number of frames in all ranges."""
        return int((self.stops - self.starts).sum())

    @classmethod
    def union(cls, parts: Sequence[HitRanges]) -> HitRanges:
        """Return the union of ranges; overlapping and adjacent ones are merged."""
        documents, starts, stops = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("documents", "starts", "stops")
        )
        if not len(documents):
            return cls(documents, starts, stops)
        order = np.lexsort((starts, documents))
        shift = documents[order].astype(np.int64) * (int(stops.max()) + 1)  # one axis with disjoint documents
        starts, stops = starts[order] + shift, np.maximum.accumulate(stops[order] + shift)
        heads = np.flatnonzero(np.append(True, starts[1:] > stops[:-1]))
        ends = np.append(heads[1:], len(starts)) - 1
        return cls(documents[order][heads], starts[heads] - shift[heads], stops[ends] - shift[heads])

    def extended(self, index: KeyframeIndex, left: int, right: int) -> HitRanges:
        """Return every range extended by `left` and `right` frames inside its document, merged as by `union`."""
        lengths = np.diff(index.document_starts)[self.documents]
        starts = np.maximum(self.starts - left, 0)
        return HitRanges.union([HitRanges(self.documents, starts, np.minimum(self.stops + right, lengths))])


def find(index: KeyframeIndex, query: KeyframeQuery) -> HitRanges:
    """Return all hit-relevant ranges of a query (Algorithm 1), merged where they overlap, inside single documents.

    A query is a hit at frames n_1 <= ... <= n_K of one document if frame n_k matches keyframe k and every distance
    n_(k+1) - n_k lies within the query's bounds (Eq. 3.2 and 3.3).
    """
    minimum = np.array([least for least, _ in query.bounds], np.int64)
    maximum = np.array([UNBOUNDED if greatest is None else greatest for _, greatest in query.bounds], np.int64)
    lists = _keyframe_lists(index, query.keyframes, minimum, maximum)
    offsets = np.cumsum([0, *(len(starts) for starts, _ in lists)])
    starts, ends = (np.concatenate([part[i] for part in lists]) for i in (0, 1))
    ranges = keyframe_search(starts, ends, offsets, minimum, maximum, index.document_starts)
    documents = np.searchsorted(index.document_starts, ranges[:, 0], side="right") - 1
    first = index.document_starts[documents]
    return HitRanges(documents, ranges[:, 0] - first, ranges[:, 1] + 1 - first)


def _keyframe_lists(
    index: KeyframeIndex, keyframes: Sequence[Keyframe], minimum: np.ndarray, maximum: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return inverted keyframe lists without frames that cannot be part of a hit.

    The list of the rarest keyframe is merged first, and restricted to the frames that also match the keyframes at the
    same frame. From there in both directions, the next keyframe is at a bounded distance from a segment of the previous
    one. It is read from the runs there if that is less work than merging its own list. Excluded frames are in no hit,
    and the parts of a segment of one match stay together.
    """
    counts = [index.sets[keyframe.feature_set].count(keyframe) for keyframe in keyframes]
    first = last = rarest = int(np.argmin(counts))
    while first > 0 and maximum[first - 1] == 0:
        first -= 1
    while last + 1 < len(keyframes) and maximum[last] == 0:
        last += 1
    starts, ends = index.keyframe_list(keyframes[rarest])
    for k in range(first, last + 1):
        if k != rarest:
            windows, frames = windows_around(starts, ends, 0, 0, index.document_starts)
            starts, ends = index.sets[keyframes[k].feature_set].segments_near(windows, frames, keyframes[k])
    lists = {k: (starts, ends) for k in range(first, last + 1)}

    def add(k: int, neighbour: int, least: int, greatest: int) -> None:
        runs = index.sets[keyframes[k].feature_set]
        windows, frames = windows_around(*lists[neighbour], least, greatest, index.document_starts)
        if frames * len(runs.run_vectors) < counts[k] * index.frames:
            lists[k] = runs.segments_near(windows, frames, keyframes[k])
        else:
            lists[k] = index.keyframe_list(keyframes[k])

    for k in range(last + 1, len(keyframes)):
        add(k, k - 1, minimum[k - 1], maximum[k - 1])
    for k in range(first - 1, -1, -1):
        add(k, k + 1, -maximum[k], -minimum[k])
    return [lists[k] for k in range(len(keyframes))]


def pieces(index: KeyframeIndex, query: KeyframeQuery, ranges: HitRanges, factor: float = 3.0) -> HitRanges:
    """Return the ranges of the refined search: hits extended by `factor` times the query's lead and tail.

    The thesis has 3 for retrieval; annotation has another factor (`preselection.preselect`).
    """
    return ranges.extended(index, round(factor * query.lead), round(factor * query.tail))
