"""Preselection by keyframes: frames of a collection in which each class can occur (thesis 5.3)."""

from __future__ import annotations

from collections.abc import Sequence

from toolkit.io.errors import RetrievalError
from toolkit.retrieval.features.relational import FeatureMatrix
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery
from toolkit.retrieval.search.find import HitRanges, find, pieces


def preselect(
    index: KeyframeIndex, queries: Sequence[KeyframeQuery], labels: Sequence[str]
) -> list[dict[str, list[tuple[int, int]]]]:
    """Return the frames to search per document and class, for `Annotator.annotate`.

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
    unknown = sorted({query.label for query in queries} - set(labels))
    if unknown:
        raise RetrievalError(f"keyframes for unknown class {unknown[0]!r}; the classes are {', '.join(labels)}")
    lengths = [int(stop - start) for start, stop in zip(index.document_starts, index.document_starts[1:], strict=False)]
    without = [label for label in labels if label not in {query.label for query in queries}]
    intervals: list[dict[str, list[tuple[int, int]]]] = [{label: [(0, n)] for label in without} for n in lengths]
    # Factor by which hits are extended: this many times the query's frames before its first and after its last
    # keyframe. The thesis's factor 2 leaves a sixth more frames to search and finds the same motions.
    extension = 1.5
    for label in {query.label: None for query in queries}:
        searched = [pieces(index, query, find(index, query), extension) for query in queries if query.label == label]
        found = HitRanges.union(searched)
        ranges = (array.tolist() for array in (found.documents, found.starts, found.stops))
        for document, start, stop in zip(*ranges, strict=True):
            intervals[document].setdefault(label, []).append((start, stop))
    return intervals


def preselect_in(
    documents: Sequence[FeatureMatrix], queries: Sequence[KeyframeQuery], labels: Sequence[str]
) -> list[dict[str, list[tuple[int, int]]]]:
    """Return `preselect` for documents without an index."""
    return preselect(KeyframeIndex.build(documents), queries, labels)
