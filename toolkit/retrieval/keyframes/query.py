"""Keyframes and keyframe queries (thesis, Sections 3.4 and 4.1), and their JSON files, which may be written by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, NamedTuple

from toolkit.io.errors import RetrievalError
from toolkit.io.files import save_json
from toolkit.io.typed_values import Range, TypedReader
from toolkit.io.yaml_reader import read_json
from toolkit.retrieval.features.relational import FEATURES, feature_fingerprint

QUERY_VERSION: int = 1
Frames = Annotated[int, Range(0, 10**6)]
"""Number of frames at 30 Hz, at most nine hours."""
Distance = tuple[Frames, Frames | None]
"""Least and greatest number of frames between two keyframes; None is unbounded."""
_ROWS = {f"F{feature.number}": row for row, feature in enumerate(FEATURES)}


class Keyframe(NamedTuple):
    """Required values of some features in one frame: a packed column `v` matches if `v & mask == value`.

    Attributes
    ----------
    mask : bits of the features other than wildcards, bit i being feature F(i+1)
    value : bits of the features that are 1
    """

    mask: int
    value: int

    @classmethod
    def of(cls, features: Mapping[str, int]) -> Keyframe:
        """Return the keyframe of feature values such as `{"F20": 1}`.

        Raises
        ------
        RetrievalError
            A feature is unknown, a value is not 0 or 1, or there is no feature.
        """
        if not features:
            raise RetrievalError("a keyframe without features matches every frame; name at least one feature")
        for name, value in features.items():
            if name not in _ROWS:
                raise RetrievalError(f"unknown feature {name!r}; the features are F1 to F{len(_ROWS)}")
            if value not in (0, 1):
                raise RetrievalError(
                    f"feature {name} has the value {value!r} in a keyframe; give 0 or 1, or leave it out"
                )
        mask = sum(1 << _ROWS[name] for name in features)
        return cls(mask, sum(value << _ROWS[name] for name, value in features.items()))

    @property
    def features(self) -> dict[str, int]:
        """Required value of each feature."""
        return {name: self.value >> row & 1 for name, row in _ROWS.items() if self.mask >> row & 1}


@dataclass(frozen=True)
class KeyframeQuery:
    """Ordered keyframes with the admissible distances between neighbours.

    Attributes
    ----------
    keyframes : at least one
    distances : distances between neighbouring keyframes
    lead : frames of the searched motion before the first keyframe, >= 0
    tail : frames of the searched motion after the last keyframe, >= 0
    label : motion class of the query, "" if none

    Raises
    ------
    RetrievalError
        The distances do not fit the keyframes, or a range of distances is empty.
    """

    keyframes: tuple[Keyframe, ...]
    distances: tuple[Distance, ...] = ()
    lead: int = 0
    tail: int = 0
    label: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if len(self.distances) != len(self.keyframes) - 1:
            raise RetrievalError(
                f"query {self.label!r} has {len(self.keyframes)} keyframes and {len(self.distances)} distances; give "
                "at least one keyframe, and one distance less than keyframes"
            )
        for least, greatest in self.distances:
            if greatest is not None and greatest < least:
                raise RetrievalError(
                    f"distances from {least} to {greatest} frames are an empty range; give least <= greatest"
                )


@dataclass(frozen=True)
class _StoredQuery:
    """Query in a file; see `KeyframeQuery`. A keyframe is `{"F20": 1, ...}`."""

    keyframes: tuple[dict[str, int], ...]
    distances: tuple[Distance, ...] = ()
    lead: Frames = 0
    tail: Frames = 0
    label: str = ""


@dataclass(frozen=True)
class _QueryFile:
    """Content of a query file; `features` is the fingerprint of the features, optional."""

    version: int
    queries: tuple[_StoredQuery, ...]
    features: str = field(default_factory=feature_fingerprint)


def save_queries(path: str | Path, queries: Sequence[KeyframeQuery]) -> None:
    """Write queries with the fingerprint of their features."""
    stored = tuple(
        _StoredQuery(tuple(k.features for k in q.keyframes), q.distances, q.lead, q.tail, q.label) for q in queries
    )
    save_json(path, asdict(_QueryFile(QUERY_VERSION, stored)))


def load_queries(path: str | Path) -> list[KeyframeQuery]:
    """Read a file of `save_queries`.

    Raises
    ------
    RetrievalError
        The file is missing, no query file, of another version or feature definition, or has unknown features.
    """
    content = read_json(path, RetrievalError, "write queries with `depthmocap learn`")
    hint = "write queries as in docs/retrieval.md, or with `depthmocap learn`"
    stored = TypedReader(RetrievalError, hint, loose=True, source=str(path)).read(content, _QueryFile, "")
    if stored.version != QUERY_VERSION:
        raise RetrievalError(f"{path} has queries of version {stored.version}, not {QUERY_VERSION}; make them again")
    if stored.features != feature_fingerprint():
        raise RetrievalError(
            f"{path} has queries about other feature definitions ({stored.features}, here {feature_fingerprint()})"
            "; learn them again"
        )
    return [
        KeyframeQuery(tuple(map(Keyframe.of, q.keyframes)), q.distances, q.lead, q.tail, q.label)
        for q in stored.queries
    ]


def choose_labels(queries: Sequence[KeyframeQuery], labels: Sequence[str] | None) -> list[KeyframeQuery]:
    """Return the queries with these labels, in their order; all without labels.

    Raises
    ------
    RetrievalError
        No query has one of the labels.
    """
    if not labels:
        return list(queries)
    known = {query.label for query in queries}
    for label in labels:
        if label not in known:
            raise RetrievalError(f"no query for the label {label!r}; there are: {', '.join(sorted(known)) or 'none'}")
    return [query for label in labels for query in queries if query.label == label]
