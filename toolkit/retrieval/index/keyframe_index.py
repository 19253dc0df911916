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
from toolkit.retrieval.features.relational import (
    FEATURE_RATE,
    FEATURE_SETS,
    FEATURES,
    FeatureMatrix,
    feature_fingerprint,
)
from toolkit.retrieval.index.runs import RunLists
from toolkit.retrieval.keyframes.query import Keyframe

INDEX_VERSION: int = 1

_MAGIC = b"depthmocap index\n"
_ALIGNMENT = 64


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
