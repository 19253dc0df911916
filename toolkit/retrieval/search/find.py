"""Keyframe-based search (thesis, Sections 3.4 to 3.6), and the preselection for annotation (5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.kernels.motion.keyframe_search import UNBOUNDED, keyframe_search
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import Distance, Keyframe, KeyframeQuery


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


def find(index: KeyframeIndex, query: KeyframeQuery, extension: float = 0.0) -> HitRanges:
    """Return all hit-relevant ranges of a query (Algorithm 1), merged where they overlap, inside single documents.

    A query is a hit at frames n_1 <= ... <= n_K of one document if frame n_k matches keyframe k and every distance
    n_(k+1) - n_k lies within the query's bounds (Eq. 3.2 and 3.3).

    Parameters
    ----------
    index : index to search
    query : keyframes and their distances
    extension : multiple of the query's lead and tail by which a range is extended on its sides, for a refined search
        (3.6); the thesis has 3 for retrieval
    """
    lists = [matching_segments(index.words, index.document_starts, keyframe) for keyframe in query.keyframes]
    documents, starts, stops = hits_of(lists, query.distances, index.document_starts)
    if not extension:
        return HitRanges(documents, starts, stops)
    starts = np.maximum(starts - round(extension * query.lead), 0)
    stops = np.minimum(stops + round(extension * query.tail), np.diff(index.document_starts)[documents])
    return HitRanges.union([HitRanges(documents, starts, stops)])


Segments = tuple[np.ndarray, np.ndarray]
"""First and last frames of disjoint segments in order, int64 (S,), counted through all documents."""


def matching_segments(words: np.ndarray, document_starts: np.ndarray, keyframe: Keyframe) -> Segments:
    """Return the keyframe list (Eq. 3.5): the longest segments of packed columns (N,) that match a keyframe.

    No segment contains frames of two documents.
    """
    match = words & np.uint64(keyframe.mask) == np.uint64(keyframe.value)
    changed = np.append(True, match[1:] != match[:-1])
    changed[document_starts[:-1]] = True
    edges = np.append(np.flatnonzero(changed), len(words))
    matching = np.flatnonzero(match[edges[:-1]])
    return edges[matching], edges[matching + 1] - 1


def hits_of(
    lists: Sequence[Segments], distances: Sequence[Distance], document_starts: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the hit-relevant ranges of the keyframes with these lists: documents, first frames and stops, int64 (H,).

    Frames count within the document.
    """
    starts, ends = (np.concatenate(part) for part in zip(*lists, strict=True))
    offsets = np.cumsum([0, *(len(first) for first, _ in lists)])
    minimum = np.array([least for least, _ in distances], np.int64)
    maximum = np.array([UNBOUNDED if greatest is None else greatest for _, greatest in distances], np.int64)
    ranges = keyframe_search(starts, ends, offsets, minimum, maximum, document_starts)
    documents = np.searchsorted(document_starts, ranges[:, 0], side="right") - 1
    first = document_starts[documents]
    return documents, ranges[:, 0] - first, ranges[:, 1] + 1 - first


def preselect(
    index: KeyframeIndex, queries: Sequence[KeyframeQuery], labels: Sequence[str]
) -> list[dict[str, list[tuple[int, int]]]]:
    """Return the frames in which each class can occur (thesis 5.3), per document, for `Annotator.annotate`.

    Parameters
    ----------
    index : index of the documents
    queries : learned keyframe queries, labelled; several of one label are alternatives
    labels : all classes; one without a query is searched everywhere

    Returns
    -------
    Per document of the index: label -> disjoint intervals (first frame, one after the last), ascending.

    Raises
    ------
    RetrievalError
        A query's label is no class.
    """
    alternatives: dict[str, list[KeyframeQuery]] = {}
    for query in queries:
        alternatives.setdefault(query.label, []).append(query)
    unknown = sorted(alternatives.keys() - set(labels))
    if unknown:
        raise RetrievalError(f"keyframes for unknown class {unknown[0]!r}; the classes are {', '.join(labels)}")
    lengths = np.diff(index.document_starts).tolist()
    intervals = [{label: [(0, n)] for label in labels if label not in alternatives} for n in lengths]
    extension = 1.5  # the thesis's factor 2 leaves a sixth more frames to search and finds the same motions
    for label, own in alternatives.items():
        found = HitRanges.union([find(index, query, extension) for query in own])
        ranges = (array.tolist() for array in (found.documents, found.starts, found.stops))
        for document, start, stop in zip(*ranges, strict=True):
            intervals[document].setdefault(label, []).append((start, stop))
    return intervals
