"""Inverted file index over runs of equal feature vectors (thesis, Section 3.3), in memory or mapped from one file.

A file is opened without being read (`storage`): the lists of a feature set are read, compared with their checksums and
looked through when a search first needs them, for compiled code follows where they lead; grades and places are numbers,
read where a hit is. The runs hold every frame, so that documents can be added and taken out without their files.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path

import numpy as np

from toolkit.archives import Column, check_columns
from toolkit.errors import RetrievalError
from toolkit.retrieval.features.grades import BLOCK, coarse_rows
from toolkit.retrieval.features.places import ROWS
from toolkit.retrieval.features.relational import (
    FEATURE_RATE,
    FEATURE_SETS,
    FEATURES,
    FeatureMatrix,
    feature_fingerprint,
)
from toolkit.retrieval.index.runs import RunLists
from toolkit.retrieval.index.storage import REBUILD, StoredArrays, write_arrays
from toolkit.retrieval.keyframes.query import Keyframe

INDEX_VERSION: int = 5

_NUMBERS = {"grades": len(FEATURES), "coarse": len(FEATURES), "places": ROWS}
"""Arrays that are read where a hit is, and their columns."""


@dataclass(frozen=True, eq=False)
class KeyframeIndex:
    """Documents, their inverted lists, one `RunLists` per feature set, and their graded features.

    Attributes
    ----------
    names : name of each document
    document_starts : int64 (D + 1,), first frame of each document at 30 Hz; the last entry is the number of all frames
    sets : feature set name -> runs and lists
    grades : int8 (N, 40), graded features of all frames
    places : int8 (N, 24), places of the limbs in all frames
    coarse : int8 (M, 40), means of `grades.BLOCK` frames each, in which a search by example begins
    coarse_starts : int64 (D + 1,), first coarse column of each document; the last entry is M
    sketch : int8 (40, S), means of `grades.BLOCK` coarse columns each, features first: what a search by example in a
        large index looks through as a whole
    stored : the file that it is mapped from
    """

    names: tuple[str, ...]
    document_starts: np.ndarray
    sets: Mapping[str, RunLists]
    grades: np.ndarray
    places: np.ndarray
    coarse: np.ndarray
    coarse_starts: np.ndarray
    sketch: np.ndarray
    stored: StoredArrays | None = None

    @classmethod
    def build(cls, documents: Iterable[FeatureMatrix]) -> KeyframeIndex:
        """Index documents in the order given.

        Raises
        ------
        RetrievalError
            No document, an empty one, or two with the same name.
        """
        documents = list(documents)
        if not documents:
            raise RetrievalError("there is no document to index; give at least one clip")
        names = _distinct([document.name for document in documents])
        for document in documents:
            if len(document) == 0:
                raise RetrievalError(f"document {document.name!r} has no frame; leave it out of the index")
        starts = np.concatenate([[0], np.cumsum([len(document) for document in documents])]).astype(np.int64)
        words = np.concatenate([document.words for document in documents])
        grades, places = (
            np.concatenate([np.ascontiguousarray(getattr(document, name).T) for document in documents])
            for name in ("grades", "places")
        )
        return cls._of(names, starts, words, grades, places)

    @classmethod
    def _of(
        cls, names: tuple[str, ...], starts: np.ndarray, words: np.ndarray, grades: np.ndarray, places: np.ndarray
    ) -> KeyframeIndex:
        """An index of frames: bit words of their features (N,), grades (N, 40), places (N, 24)."""
        sets: dict[str, RunLists] = {}
        for name, rows in FEATURE_SETS.items():
            vectors = words >> np.uint64(rows[0]) & np.uint64((1 << len(rows)) - 1)
            sets[name] = RunLists.of(vectors.astype(np.uint16), starts)
        coarse, coarse_starts = coarse_rows(grades, starts)
        sketch = np.ascontiguousarray(coarse_rows(coarse, coarse_starts)[0].T)
        return cls(names, starts, sets, grades, places, coarse, coarse_starts, sketch)

    def added(self, documents: Iterable[FeatureMatrix]) -> KeyframeIndex:
        """A new index with further documents behind the present ones.

        Raises
        ------
        RetrievalError
            As `build`, or a name is in the index already, or the index is damaged.
        """
        self.check()
        new = KeyframeIndex.build(documents)
        return KeyframeIndex._of(
            _distinct([*self.names, *new.names]),
            np.concatenate([self.document_starts[:-1], new.document_starts + self.frames]),
            np.concatenate([self.words, new.words]),
            np.concatenate([self.grades, new.grades]),
            np.concatenate([self.places, new.places]),
        )

    def without(self, names: Iterable[str]) -> KeyframeIndex:
        """A new index without some documents.

        Raises
        ------
        RetrievalError
            A name is not in the index, or nothing would be left, or the index is damaged.
        """
        self.check()
        leaving = set(names)
        unknown = sorted(leaving - set(self.names))
        if unknown:
            raise RetrievalError(
                f"there is no document {unknown[0]!r} in the index; `depthmocap search` names those it finds"
            )
        stays = np.array([name not in leaving for name in self.names])
        if not stays.any():
            raise RetrievalError("nothing would be left in the index; delete the file instead")
        lengths = np.diff(self.document_starts)
        frames = np.repeat(stays, lengths)
        return KeyframeIndex._of(
            tuple(name for name in self.names if name not in leaving),
            np.concatenate([[0], np.cumsum(lengths[stays])]),
            self.words[frames],
            self.grades[frames],
            self.places[frames],
        )

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def sketch_starts(self) -> np.ndarray:
        """First column of each document in the sketch, int64 (D + 1,); the last entry is S."""
        return _starts_of_blocks(self.coarse_starts)

    @property
    def frames(self) -> int:
        """Number of frames of all documents."""
        return int(self.document_starts[-1])

    @property
    def duration(self) -> float:
        """Seconds of all documents."""
        return self.frames / FEATURE_RATE

    @property
    def words(self) -> np.ndarray:
        """The features of all frames as bit words, uint64 (N,), put back together from the runs."""
        words = np.zeros(self.frames, dtype=np.uint64)
        for name, rows in FEATURE_SETS.items():
            words |= self.sets[name].frames.astype(np.uint64) << np.uint64(rows[0])
        return words

    def keyframe_list(self, keyframe: Keyframe) -> tuple[np.ndarray, np.ndarray, int]:
        """Inverted keyframe list, Eq. 3.5: first and last frames of its segments, and the number of runs listed."""
        return self.sets[keyframe.feature_set].segments(keyframe.mask, keyframe.value)

    def save(self, path: str | Path) -> None:
        """Write the index as one file, whole or not at all."""
        header = {"version": INDEX_VERSION, "features": feature_fingerprint(), "names": list(self.names)}
        write_arrays(path, header, self.arrays())

    @classmethod
    def open(cls, path: str | Path) -> KeyframeIndex:
        """Open an index file: its header and its table of documents are read, everything else is mapped.

        Raises
        ------
        RetrievalError
            The file is missing, no index, of another version, made with other features, or one of the arrays is not
            what the documents ask for. What is read later can raise it too, where it is damaged.
        """
        stored = StoredArrays.open(path)
        header = stored.header
        if header["version"] != INDEX_VERSION:
            raise RetrievalError(
                f"{path} is an index of version {header['version']}, not {INDEX_VERSION}; build it again"
            )
        if header["features"] != feature_fingerprint():
            raise RetrievalError(
                f"{path} was made with other feature definitions ({header['features']}, here {feature_fingerprint()}); "
                "build it again"
            )
        starts = stored.checked("document_starts")
        index = cls(
            _distinct([str(name) for name in header["names"]]),
            starts,
            _StoredSets(stored, starts),
            **{name: stored.mapped(name) for name in _NUMBERS},
            coarse_starts=stored.checked("coarse_starts"),
            sketch=stored.mapped("sketch"),
            stored=stored,
        )
        index._check_documents()
        return index

    def check(self) -> None:
        """Read everything and compare it with its checksums and with the rest; nothing to do in memory.

        Raises
        ------
        RetrievalError
            The file is damaged, or its lists lead out of it.
        """
        if self.stored is not None:
            self.stored.check()
            for name in self.sets:
                self.sets[name]

    def _check_documents(self) -> None:
        """Raise RetrievalError where an array has another type or length than the documents ask for."""
        where = str(self.stored.path) if self.stored else "the index"
        starts, frames = self.document_starts, Column("i", (len(self) + 1,), 0)
        check_columns({"document_starts": starts}, {"document_starts": frames}, RetrievalError, where, REBUILD)
        if not len(self) or starts[0] != 0 or (np.diff(starts) <= 0).any():
            raise RetrievalError(f"the documents of {where} are empty or out of order; {REBUILD}")
        blocks = _starts_of_blocks(starts)
        if not np.array_equal(self.coarse_starts, blocks):
            raise RetrievalError(f"the coarse columns of {where} do not fit its documents; {REBUILD}")
        rows = {"grades": self.frames, "places": self.frames, "coarse": int(blocks[-1])}
        shapes = {name: (rows[name], columns) for name, columns in _NUMBERS.items()}
        shapes["sketch"] = (len(FEATURES), int(self.sketch_starts[-1]))
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array.dtype != np.int8 or array.shape != shape:
                raise RetrievalError(f"{name} of {where} are {array.dtype} of shape {array.shape}; {REBUILD}")

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything of the index by name, as it stands in the file."""
        arrays = {"document_starts": self.document_starts, "coarse_starts": self.coarse_starts}
        for name, lists in self.sets.items():
            arrays |= {f"{name}.{field.name}": getattr(lists, field.name) for field in fields(RunLists)}
        return arrays | {name: getattr(self, name) for name in (*_NUMBERS, "sketch")}


class _StoredSets(Mapping[str, RunLists]):
    """Runs and lists of a file, read and checked when they are first asked for."""

    def __init__(self, stored: StoredArrays, document_starts: np.ndarray) -> None:
        self._stored, self._document_starts = stored, document_starts
        self._read: dict[str, RunLists] = {}

    def __getitem__(self, name: str) -> RunLists:
        if name not in self._read:
            columns = FEATURE_SETS[name]
            lists = RunLists(**{f.name: self._stored.checked(f"{name}.{f.name}") for f in fields(RunLists)})
            lists.check(self._document_starts, len(columns), f"{self._stored.path}, set {name}")
            self._read[name] = lists
        return self._read[name]

    def __iter__(self) -> Iterator[str]:
        return iter(FEATURE_SETS)

    def __len__(self) -> int:
        return len(FEATURE_SETS)


def _distinct(names: Sequence[str]) -> tuple[str, ...]:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise RetrievalError(f"two documents have the name {name!r}; give each its own")
        seen.add(name)
    return tuple(names)


def _starts_of_blocks(starts: np.ndarray) -> np.ndarray:
    """First block of each document, int64 (D + 1,), from their first columns."""
    return np.concatenate([[0], np.cumsum(-(-np.diff(starts) // BLOCK))])
