"""Inverted file index over runs of equal feature vectors (thesis, Section 3.3), in memory or mapped from one file.

The file is a header in JSON, then one array after the other, each on a 64-byte boundary, then the SHA-256 of all that.
Opening it compares the checksum and maps the arrays. The runs hold every frame, so the index also gives back the
features of any piece of a document.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.archives import Column, check_columns
from toolkit.errors import RetrievalError
from toolkit.files import atomic_path, is_file, parse_json
from toolkit.retrieval.features.relational import (
    FEATURE_RATE,
    FEATURE_SETS,
    FEATURES,
    FeatureMatrix,
    feature_fingerprint,
)
from toolkit.retrieval.index.runs import REBUILD, RunLists
from toolkit.retrieval.keyframes.query import Keyframe

INDEX_VERSION: int = 2

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
            "version": INDEX_VERSION, "features": feature_fingerprint(), "names": list(self.names), "arrays": table
        }  # fmt: skip
        text = json.dumps(header).encode()
        blocks = [_MAGIC + len(text).to_bytes(8, "little") + text, *(array.tobytes() for array in arrays.values())]
        digest = hashlib.sha256()
        with atomic_path(path) as temporary, temporary.open("wb") as stream:
            for block in blocks:
                whole = block + bytes(_padded(len(block)) - len(block))
                digest.update(whole)
                stream.write(whole)
            stream.write(digest.digest())

    @classmethod
    def open(cls, path: str | Path) -> KeyframeIndex:
        """Open an index file: it is compared with its checksum, and its arrays are mapped.

        Raises
        ------
        RetrievalError
            The file is missing, no index, damaged, of another version, made with other features, or its lists lead
            out of it.
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
        _check_sum(path)
        try:
            arrays = {entry["name"]: _mapped(path, start, entry) for entry in header["arrays"]}
            sets = {
                name: RunLists(**{field.name: arrays[f"{name}.{field.name}"] for field in fields(RunLists)})
                for name in FEATURE_SETS
            }
            index = cls(_distinct([str(name) for name in header["names"]]), arrays["document_starts"], sets)
        except (KeyError, TypeError, ValueError, OverflowError, OSError) as error:
            raise RetrievalError(f"the header of the index {path} is damaged ({error!r}); build it again") from error
        index.check(str(path))
        return index

    def check(self, where: str) -> None:
        """Raise RetrievalError where an array has another type or length than it must, or leads out of the index."""
        starts, frames = self.document_starts, Column("i", (len(self) + 1,), 0)
        check_columns({"document_starts": starts}, {"document_starts": frames}, RetrievalError, where, REBUILD)
        if not len(self) or starts[0] != 0 or (np.diff(starts) <= 0).any():
            raise RetrievalError(f"the documents of {where} are empty or out of order; {REBUILD}")
        for name, lists in self.sets.items():
            lists.check(starts, len(FEATURE_SETS[name]), f"{where}, set {name}")

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
    if not is_file(path):
        raise RetrievalError(f"there is no index {path}; make one with `depthmocap index`")
    try:
        with path.open("rb") as stream:
            if stream.read(len(_MAGIC)) != _MAGIC:
                raise RetrievalError(f"{path} is no keyframe index; make one with `depthmocap index`")
            length = int.from_bytes(stream.read(8), "little")
            text = stream.read(min(length, path.stat().st_size)).decode("utf-8")
            start = _padded(stream.tell())
    except (OSError, UnicodeDecodeError) as error:
        raise RetrievalError(f"cannot read the index {path} ({error}); {REBUILD}") from error
    header = parse_json(text, f"the header of the index {path}", RetrievalError, REBUILD)
    if not isinstance(header, dict) or not {"version", "features", "names", "arrays"} <= header.keys():
        raise RetrievalError(f"the header of the index {path} is damaged; {REBUILD}")
    return header, start


def _check_sum(path: Path) -> None:
    """Raise RetrievalError unless the file ends with the SHA-256 of all before."""
    digest = hashlib.sha256()
    with path.open("rb") as stream:
        left = path.stat().st_size - digest.digest_size
        while left > 0 and (block := stream.read(min(left, 1 << 20))):
            digest.update(block)
            left -= len(block)
        if left or stream.read() != digest.digest():
            raise RetrievalError(f"{path} is cut short or damaged: its checksum does not fit its content; {REBUILD}")


def _mapped(path: Path, start: int, entry: dict[str, Any]) -> np.ndarray:
    """One array of the file; copy-on-write, so that compiled code sees the same array type as in memory."""
    shape, dtype = tuple(entry["shape"]), np.dtype(entry["dtype"])
    if dtype.kind not in "iu" or not dtype.isnative:
        raise ValueError(f"an array is of type {dtype}")
    return np.asarray(np.memmap(path, dtype, "c", start + entry["offset"], shape))
