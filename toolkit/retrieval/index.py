"""Inverted file index over runs of equal feature vectors (thesis, Section 3.3), in memory or mapped from one file.
 The file is a header in JSON, then one array after the other, each on a 64-byte boundary. Opening it reads the header
alone; the arrays are mapped and only the lists that a query asks for are ever read. The runs hold every frame, so the
index also gives back the features of any piece of a document.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.errors import RetrievalError
from toolkit.files import atomic_path
from toolkit.kernels.keyframe_search import keyframe_list, keyframe_list_near, listed_runs, runs_of
from toolkit.retrieval.features import FEATURE_RATE, FEATURE_SETS, FEATURES, FeatureMatrix, feature_fingerprint
from toolkit.retrieval.keyframes import Keyframe

INDEX_VERSION: int = 1

_MAGIC = b"depthmocap index\n"
_ALIGNMENT = 64


@dataclass(frozen=True, eq=False)
class RunLists:
    """Runs of equal feature vectors of one feature set, and for each vector the inverted list of its runs.

    Attributes
    ----------
    run_starts : int32 (R + 1,), first frame of each run, counted through all documents; the last entry is the number of
        frames
    run_vectors : unsigned (R,), feature vector of each run, bit i being feature i of the set
    document_runs : int32 (D + 1,), first run of each document; the last entry is R
    vectors : unsigned (U,), the feature vectors that occur, ascending
    list_offsets : int64 (U + 1,), the list of `vectors[u]` is `list_runs[list_offsets[u] : list_offsets[u + 1]]`
    list_runs : int32 (R,), run numbers, ascending within each list
    """

    run_starts: np.ndarray
    run_vectors: np.ndarray
    document_runs: np.ndarray
    vectors: np.ndarray
    list_offsets: np.ndarray
    list_runs: np.ndarray

    @classmethod
    def of(cls, vectors: np.ndarray, document_starts: np.ndarray) -> RunLists:
        """Runs and lists of the frames' feature vectors (N,), of documents from `document_starts` (D + 1,)."""
        return cls.from_runs(*runs_of(vectors, document_starts))

    @classmethod
    def from_runs(cls, run_starts: np.ndarray, run_vectors: np.ndarray, document_runs: np.ndarray) -> RunLists:
        """Sort the runs into inverted lists."""
        order = np.argsort(run_vectors, kind="stable").astype(np.int32)
        vectors, first = np.unique(run_vectors[order], return_index=True)
        offsets = np.append(first, len(order)).astype(np.int64)
        return cls(run_starts, run_vectors, document_runs, vectors, offsets, order)

    def joined(self, other: RunLists) -> RunLists:
        """These documents followed by those of `other`."""
        starts = np.concatenate([self.run_starts[:-1], other.run_starts + self.run_starts[-1]])
        runs = np.concatenate([self.document_runs[:-1], other.document_runs + self.document_runs[-1]])
        return RunLists.from_runs(starts, np.concatenate([self.run_vectors, other.run_vectors]), runs)

    def inverted_list(self, vector: int) -> np.ndarray:
        """The inverted list of a feature vector: (document, number of the run in it) per entry, int64 (L, 2), in
        order."""
        u = int(np.searchsorted(self.vectors, vector))
        if u == len(self.vectors) or self.vectors[u] != vector:
            return np.empty((0, 2), np.int64)
        runs = np.asarray(self.list_runs[self.list_offsets[u] : self.list_offsets[u + 1]], np.int64)
        documents = np.searchsorted(self.document_runs, runs, side="right") - 1
        return np.stack([documents, runs - self.document_runs[documents]], axis=1)

    def segments(self, mask: int, value: int) -> tuple[np.ndarray, np.ndarray, int]:
        """Maximal segments of frames whose vector v has `v & mask == value`: first and last frames, and runs listed."""
        return keyframe_list(
            self.vectors, self.list_offsets, self.list_runs, self.run_starts, self.document_runs,
            self.vectors.dtype.type(mask), self.vectors.dtype.type(value),
        )  # fmt: skip

    def count(self, keyframe: Keyframe) -> int:
        """Number of runs in the inverted lists of a keyframe of this set."""
        kind = self.vectors.dtype.type
        return int(listed_runs(self.vectors, self.list_offsets, kind(keyframe.mask), kind(keyframe.value)))

    def segments_near(self, windows: np.ndarray, frames: int, keyframe: Keyframe) -> tuple[np.ndarray, np.ndarray, int]:
        """The parts of a keyframe's `segments` in disjoint windows [first, last], int64 (W, 2), and runs looked at."""
        kind = self.vectors.dtype.type
        return keyframe_list_near(
            windows, self.run_vectors, self.run_starts, kind(keyframe.mask), kind(keyframe.value), frames
        )

    def frames(self, start: int, stop: int) -> np.ndarray:
        """Feature vectors of the frames start to stop - 1."""
        first = int(np.searchsorted(self.run_starts, start, side="right")) - 1
        last = int(np.searchsorted(self.run_starts, stop, side="left"))
        edges = np.clip(self.run_starts[first : last + 1], start, stop)
        return np.repeat(self.run_vectors[first:last], np.diff(edges))


@dataclass(frozen=True, eq=False)
class KeyframeIndex:
    """Documents and their inverted lists, one `RunLists` per feature set.

    Attributes
    ----------
    names : name of each document
    document_starts : int64 (D + 1,), first frame of each document at 30 Hz; the last entry is the number of all frames
    sets : feature set name -> runs and lists
    """

    names: tuple[str, ...]
    document_starts: np.ndarray
    sets: dict[str, RunLists]

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
        sets = {}
        words = np.concatenate([document.words for document in documents])
        for name, rows in FEATURE_SETS.items():
            vectors = words >> np.uint64(rows[0]) & np.uint64((1 << len(rows)) - 1)
            sets[name] = RunLists.of(vectors.astype(np.uint16), starts)
        return cls(names, starts, sets)

    def added(self, documents: Iterable[FeatureMatrix]) -> KeyframeIndex:
        """A new index with further documents behind the present ones.

        Raises
        ------
        RetrievalError
            As `build`, or a name is in the index already.
        """
        new = KeyframeIndex.build(documents)
        names = _distinct([*self.names, *new.names])
        starts = np.concatenate([self.document_starts[:-1], new.document_starts + self.document_starts[-1]])
        return KeyframeIndex(names, starts, {name: lists.joined(new.sets[name]) for name, lists in self.sets.items()})

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

    def features(self, document: int, start: int, stop: int) -> FeatureMatrix:
        """Features of frames start to stop - 1 of a document, put back together from the runs."""
        offset = int(self.document_starts[document])
        values = np.empty((len(FEATURES), stop - start), dtype=bool)
        for name, rows in FEATURE_SETS.items():
            vectors = self.sets[name].frames(offset + start, offset + stop)
            values[rows] = vectors >> np.arange(len(rows), dtype=np.uint16)[:, None] & 1
        return FeatureMatrix(self.names[document], values)

    def keyframe_list(self, keyframe: Keyframe) -> tuple[np.ndarray, np.ndarray, int]:
        """Inverted keyframe list, Eq. 3.5: first and last frames of its segments, and the number of runs listed."""
        return self.sets[keyframe.feature_set].segments(keyframe.mask, keyframe.value)

    def save(self, path: str | Path) -> None:
        """Write the index as one file, whole or not at all."""
        arrays = self._arrays()
        table, offset = [], 0
        for name, array in arrays.items():
            table.append({"name": name, "dtype": array.dtype.str, "shape": list(array.shape), "offset": offset})
            offset += _padded(array.nbytes)
        header = {
            "version": INDEX_VERSION, "features": feature_fingerprint(), "names": list(self.names), "arrays": table,
            "bytes": offset,
        }  # fmt: skip
        text = json.dumps(header).encode()
        with atomic_path(path) as temporary, temporary.open("wb") as stream:
            stream.write(_MAGIC + len(text).to_bytes(8, "little") + text)
            stream.write(bytes(_padded(stream.tell()) - stream.tell()))
            for array in arrays.values():
                stream.write(array.tobytes())
                stream.write(bytes(_padded(array.nbytes) - array.nbytes))

    @classmethod
    def open(cls, path: str | Path) -> KeyframeIndex:
        """Open an index file: its header is read, its arrays are mapped.

        Raises
        ------
        RetrievalError
            The file is missing, no index, cut short, of another version, or made with other features.
        """
        path = Path(path)
        header, start = _read_header(path)
        if header["version"] != INDEX_VERSION:
            raise RetrievalError(
                f"{path} is an index of version {header['version']}, not {INDEX_VERSION}; build it again"
            )
        if header["features"] != feature_fingerprint():
            raise RetrievalError(
                f"{path} was made with other feature definitions ({header['features']}, here {feature_fingerprint()}); "
                "build it again"
            )
        if path.stat().st_size != start + header["bytes"]:
            raise RetrievalError(
                f"{path} has {path.stat().st_size} bytes instead of {start + header['bytes']}; build it again"
            )
        arrays = {entry["name"]: _mapped(path, start, entry) for entry in header["arrays"]}
        sets = {
            name: RunLists(**{field.name: arrays[f"{name}.{field.name}"] for field in fields(RunLists)})
            for name in FEATURE_SETS
        }
        return cls(tuple(header["names"]), arrays["document_starts"], sets)

    def _arrays(self) -> dict[str, np.ndarray]:
        arrays = {"document_starts": self.document_starts}
        for name, lists in self.sets.items():
            arrays |= {f"{name}.{field.name}": getattr(lists, field.name) for field in fields(RunLists)}
        return arrays


def _distinct(names: Sequence[str]) -> tuple[str, ...]:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise RetrievalError(f"two documents have the name {name!r}; give each its own")
        seen.add(name)
    return tuple(names)


def _padded(size: int) -> int:
    return -(-size // _ALIGNMENT) * _ALIGNMENT


def _read_header(path: Path) -> tuple[dict[str, Any], int]:
    """Header of an index file and the position of its first array."""
    try:
        with path.open("rb") as stream:
            if stream.read(len(_MAGIC)) != _MAGIC:
                raise RetrievalError(f"{path} is no keyframe index; make one with `depthmocap index`")
            length = int.from_bytes(stream.read(8), "little")
            return json.loads(stream.read(length)), _padded(stream.tell())
    except OSError as error:
        raise RetrievalError(f"cannot open the index {path}: {error.strerror or error}; check the path") from error
    except (ValueError, OverflowError, MemoryError) as error:
        raise RetrievalError(f"the header of the index {path} is damaged; build it again") from error


def _mapped(path: Path, start: int, entry: dict[str, Any]) -> np.ndarray:
    """One array of the file; copy-on-write, so that compiled code sees the same array type as in memory."""
    shape = tuple(entry["shape"])
    return np.asarray(np.memmap(path, np.dtype(entry["dtype"]), "c", start + entry["offset"], shape))
