"""Inverted file index over runs of equal feature vectors (thesis, Section 3.3), in memory or mapped from one file.

The file is a header in JSON, then one array after the other, each on a 64-byte boundary: first those that lead from one
to another, then the SHA-256 of all that, then the grades, nine tenths of the file, whose CRC-32 stand in the header.
Opening it compares both and maps the arrays. The runs hold every frame, so the index also gives back the features of
any piece of a document.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.archives import Column, check_columns
from toolkit.errors import RetrievalError
from toolkit.files import atomic_path, is_file, parse_json
from toolkit.retrieval.features.grades import BLOCK, coarse
from toolkit.retrieval.features.relational import (
    FEATURE_RATE,
    FEATURE_SETS,
    FEATURES,
    FeatureMatrix,
    feature_fingerprint,
)
from toolkit.retrieval.index.runs import REBUILD, RunLists
from toolkit.retrieval.keyframes.query import Keyframe

INDEX_VERSION: int = 3

_MAGIC = b"depthmocap index\n"
_ALIGNMENT = 64
_DIGEST = 64
"""Bytes of the checksum with what fills it up to the boundary."""
GRADED = ("grades", "coarse")
"""Arrays that the checksum leaves out, the last ones of the file."""


@dataclass(frozen=True, eq=False)
class KeyframeIndex:
    """Documents, their inverted lists, one `RunLists` per feature set, and their graded features.

    Attributes
    ----------
    names : name of each document
    document_starts : int64 (D + 1,), first frame of each document at 30 Hz; the last entry is the number of all frames
    sets : feature set name -> runs and lists
    grades : int8 (N, 40), graded features of all frames
    coarse : int8 (M, 40), means of `grades.BLOCK` frames each, in which a search by example begins
    coarse_starts : int64 (D + 1,), first coarse column of each document; the last entry is M
    """

    names: tuple[str, ...]
    document_starts: np.ndarray
    sets: dict[str, RunLists]
    grades: np.ndarray
    coarse: np.ndarray
    coarse_starts: np.ndarray

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
        grades = np.concatenate([np.ascontiguousarray(document.grades.T) for document in documents])
        blocks = [np.ascontiguousarray(coarse(document.grades).T) for document in documents]
        coarse_starts = np.cumsum([0, *map(len, blocks)])
        return cls(names, starts, sets, grades, np.concatenate(blocks), coarse_starts)

    def added(self, documents: Iterable[FeatureMatrix]) -> KeyframeIndex:
        """A new index with further documents behind the present ones.

        Raises
        ------
        RetrievalError
            As `build`, or a name is in the index already.
        """
        new = KeyframeIndex.build(documents)
        names = _distinct([*self.names, *new.names])
        return KeyframeIndex(
            names,
            _continued(self.document_starts, new.document_starts),
            {name: lists.joined(new.sets[name]) for name, lists in self.sets.items()},
            np.concatenate([self.grades, new.grades]),
            np.concatenate([self.coarse, new.coarse]),
            _continued(self.coarse_starts, new.coarse_starts),
        )

    def without(self, names: Iterable[str]) -> KeyframeIndex:
        """A new index without some documents.

        Raises
        ------
        RetrievalError
            A name is not in the index, or nothing would be left.
        """
        leaving = set(names)
        unknown = sorted(leaving - set(self.names))
        if unknown:
            raise RetrievalError(f"there is no document {unknown[0]!r} in the index; see `depthmocap info INDEX`")
        kept = [number for number, name in enumerate(self.names) if name not in leaving]
        if not kept:
            raise RetrievalError("nothing would be left in the index; delete the file instead")
        return KeyframeIndex(
            tuple(self.names[number] for number in kept),
            _restarted(self.document_starts, kept),
            {name: lists.chosen(kept) for name, lists in self.sets.items()},
            _chosen(self.grades, self.document_starts, kept),
            _chosen(self.coarse, self.coarse_starts, kept),
            _restarted(self.coarse_starts, kept),
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

    def features(self, document: int, start: int, stop: int) -> FeatureMatrix:
        """Features of frames start to stop - 1 of a document, put back together from the runs."""
        offset = int(self.document_starts[document])
        values = np.empty((len(FEATURES), stop - start), dtype=bool)
        for name, rows in FEATURE_SETS.items():
            vectors = self.sets[name].frames(offset + start, offset + stop)
            values[rows] = vectors >> np.arange(len(rows), dtype=np.uint16)[:, None] & 1
        measured = np.ascontiguousarray(self.grades[offset + start : offset + stop].T)
        return FeatureMatrix(self.names[document], values, measured=measured)

    def keyframe_list(self, keyframe: Keyframe) -> tuple[np.ndarray, np.ndarray, int]:
        """Inverted keyframe list, Eq. 3.5: first and last frames of its segments, and the number of runs listed."""
        return self.sets[keyframe.feature_set].segments(keyframe.mask, keyframe.value)

    def save(self, path: str | Path) -> None:
        """Write the index as one file, whole or not at all."""
        arrays = self.arrays()
        table: list[dict[str, Any]] = []
        offset = 0
        for name, array in arrays.items():
            if name == GRADED[0]:
                offset += _DIGEST
            table.append({"name": name, "dtype": array.dtype.str, "shape": list(array.shape), "offset": offset})
            if name in GRADED:
                table[-1]["crc32"] = zlib.crc32(np.ascontiguousarray(array).data)
            offset += _padded(array.nbytes)
        header = {
            "version": INDEX_VERSION, "features": feature_fingerprint(), "names": list(self.names), "arrays": table,
            "bytes": offset,
        }  # fmt: skip
        text = json.dumps(header).encode()
        digest = hashlib.sha256()
        with atomic_path(path) as temporary, temporary.open("wb") as stream:

            def write(block: bytes) -> None:
                whole = block + bytes(_padded(len(block)) - len(block))
                digest.update(whole)
                stream.write(whole)

            write(_MAGIC + len(text).to_bytes(8, "little") + text)
            for name, array in arrays.items():
                if name == GRADED[0]:
                    write(digest.digest())
                write(array.tobytes())

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
        try:
            _check_sum(path, start, header)
            arrays = {entry["name"]: _mapped(path, start, entry) for entry in header["arrays"]}
            if any(
                zlib.crc32(arrays[entry["name"]].data) != entry["crc32"]
                for entry in header["arrays"]
                if "crc32" in entry
            ):
                raise RetrievalError(f"the grades of {path} are damaged: their checksum does not fit; {REBUILD}")
            sets = {
                name: RunLists(**{field.name: arrays[f"{name}.{field.name}"] for field in fields(RunLists)})
                for name in FEATURE_SETS
            }
            names = _distinct([str(name) for name in header["names"]])
            index = cls(
                names, arrays["document_starts"], sets, arrays["grades"], arrays["coarse"], arrays["coarse_starts"]
            )
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
        blocks = -(-np.diff(starts) // BLOCK)
        for name, rows in zip(GRADED, (self.frames, int(blocks.sum())), strict=True):
            array = getattr(self, name)
            if array.dtype != np.int8 or array.shape != (rows, len(FEATURES)):
                raise RetrievalError(f"{name} of {where} are {array.dtype} of shape {array.shape}; {REBUILD}")
        if not np.array_equal(self.coarse_starts, np.cumsum([0, *blocks])):
            raise RetrievalError(f"the coarse columns of {where} do not fit its documents; {REBUILD}")
        for name, lists in self.sets.items():
            lists.check(starts, len(FEATURE_SETS[name]), f"{where}, set {name}")

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything of the index by name, as it stands in the file."""
        arrays = {"document_starts": self.document_starts, "coarse_starts": self.coarse_starts}
        for name, lists in self.sets.items():
            arrays |= {f"{name}.{field.name}": getattr(lists, field.name) for field in fields(RunLists)}
        return arrays | {name: getattr(self, name) for name in GRADED}


def _distinct(names: Sequence[str]) -> tuple[str, ...]:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise RetrievalError(f"two documents have the name {name!r}; give each its own")
        seen.add(name)
    return tuple(names)


def _continued(starts: np.ndarray, further: np.ndarray) -> np.ndarray:
    """Starts of documents followed by those of others."""
    return np.concatenate([starts[:-1], further + starts[-1]])


def _restarted(starts: np.ndarray, kept: Sequence[int]) -> np.ndarray:
    """Starts of some of the documents, without what lay between them."""
    return np.cumsum([0, *np.diff(starts)[kept]])


def _chosen(rows: np.ndarray, starts: np.ndarray, kept: Sequence[int]) -> np.ndarray:
    """The rows of some of the documents."""
    return np.concatenate([rows[starts[number] : starts[number + 1]] for number in kept])


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
    if not isinstance(header, dict) or not {"version", "features", "names", "arrays", "bytes"} <= header.keys():
        raise RetrievalError(f"the header of the index {path} is damaged; {REBUILD}")
    return header, start


def _check_sum(path: Path, start: int, header: dict[str, Any]) -> None:
    """Raise RetrievalError unless the file is whole and holds the SHA-256 of all before its graded arrays."""
    size = path.stat().st_size
    graded = next(int(entry["offset"]) for entry in header["arrays"] if entry["name"] == GRADED[0])
    left = start + graded - _DIGEST
    digest = hashlib.sha256()
    if size == start + int(header["bytes"]):
        with path.open("rb") as stream:
            while left > 0 and (block := stream.read(min(left, 1 << 20))):
                digest.update(block)
                left -= len(block)
            if not left and stream.read(_DIGEST) == digest.digest() + bytes(_DIGEST - digest.digest_size):
                return
    raise RetrievalError(f"{path} is cut short or damaged: its checksum does not fit its content; {REBUILD}")


def _mapped(path: Path, start: int, entry: dict[str, Any]) -> np.ndarray:
    """One array of the file; copy-on-write, so that compiled code sees the same array type as in memory."""
    shape, dtype = tuple(entry["shape"]), np.dtype(entry["dtype"])
    if dtype.kind not in "iu" or not dtype.isnative:
        raise ValueError(f"an array is of type {dtype}")
    return np.asarray(np.memmap(path, dtype, "c", start + entry["offset"], shape))
