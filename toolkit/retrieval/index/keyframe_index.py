"""Index of motions: the feature columns of all documents, one after the other, for searches by keyframes and examples.

The thesis has inverted lists of feature vectors (Section 3.3). Here a keyframe is compared with all packed columns,
which takes 0.3 ms for 3.5 hours (`search.find`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from toolkit.io.archives import Column
from toolkit.io.errors import RetrievalError
from toolkit.retrieval.features.grades import coarse_rows
from toolkit.retrieval.features.places import ROWS
from toolkit.retrieval.features.relational import FEATURE_RATE, FEATURES, FeatureMatrix
from toolkit.retrieval.stored_arrays import StoredKind

REBUILD = "build it again with `depthmocap index`"
KIND = StoredKind("a keyframe index", 6, REBUILD, {
    "document_starts": Column("i", ("documents",), 0),
    "words": Column("u", ("frames",), 0, 2 ** len(FEATURES) - 1),
    "grades": Column("i", ("frames", len(FEATURES)), -128, 127),
    "places": Column("i", ("frames", ROWS), -128, 127),
})  # fmt: skip


@dataclass(frozen=True)
class _Header:
    """Header of an index file."""

    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class KeyframeIndex:
    """Features of D documents, N frames at 30 Hz in total.

    Attributes
    ----------
    names : name of each document
    document_starts : int64 (D + 1,), first frame of each document; the last entry is N
    words : uint64 (N,), features of each frame, bit i being feature F(i+1)
    grades : int8 (N, 40), graded features
    places : int8 (N, 24), limb positions
    """

    names: tuple[str, ...]
    document_starts: np.ndarray
    words: np.ndarray
    grades: np.ndarray
    places: np.ndarray

    @classmethod
    def build(cls, documents: Iterable[FeatureMatrix]) -> KeyframeIndex:
        """Index documents in their order.

        Raises
        ------
        RetrievalError
            There is no document, one is empty, or two have the same name.
        """
        documents = list(documents)
        if not documents:
            raise RetrievalError("there is no document to index; give at least one clip")
        for document in documents:
            if len(document) == 0:
                raise RetrievalError(f"document {document.name!r} has no frame; leave it out of the index")
        return cls(
            _distinct([document.name for document in documents]),
            np.concatenate([[0], np.cumsum([len(document) for document in documents])]).astype(np.int64),
            np.concatenate([document.words for document in documents]),
            np.concatenate([np.ascontiguousarray(document.grades.T) for document in documents]),
            np.concatenate([np.ascontiguousarray(document.places.T) for document in documents]),
        )

    def __len__(self) -> int:
        return len(self.names)

    @property
    def frames(self) -> int:
        """Number of frames of all documents."""
        return int(self.document_starts[-1])

    @property
    def duration(self) -> float:
        """Seconds of all documents."""
        return self.frames / FEATURE_RATE

    @cached_property
    def coarse(self) -> tuple[np.ndarray, np.ndarray]:
        """Grades at 7.5 Hz, int8 (M, 40), and their starts per document, int64 (D + 1,), ending with M.

        Searches by example and by class start with these.
        """
        return coarse_rows(self.grades, self.document_starts)

    def save(self, path: str | Path) -> None:
        """Write the index as one NPZ file, atomically, with the fingerprint of the features."""
        arrays = {name: getattr(self, name) for name in KIND.columns}
        KIND.save(path, {"names": self.names}, arrays, compressed=False)

    @classmethod
    def open(cls, path: str | Path) -> KeyframeIndex:
        """Read a file of `save`.

        Raises
        ------
        RetrievalError
            The file is missing, no index, damaged, of another version, or made with other features.
        """
        header, arrays = KIND.load(path, _Header)
        starts = arrays["document_starts"].astype(np.int64)
        rises = len(starts) == len(header.names) + 1 > 1 and bool((np.diff(starts) > 0).all())
        if not rises or starts[0] != 0 or starts[-1] != len(arrays["words"]):
            raise RetrievalError(f"the documents of {path} are empty or out of order; {REBUILD}")
        words, grades, places = arrays["words"].astype(np.uint64), arrays["grades"], arrays["places"]
        return cls(_distinct(header.names), starts, words, grades.astype(np.int8), places.astype(np.int8))


def _distinct(names: Sequence[str]) -> tuple[str, ...]:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise RetrievalError(f"two documents have the name {name!r}; give each its own")
        seen.add(name)
    return tuple(names)
