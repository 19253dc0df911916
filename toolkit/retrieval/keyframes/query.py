"""Keyframes and keyframe queries (thesis, Sections 3.4 and 4.1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.retrieval.features.relational import FEATURE_SETS
from toolkit.retrieval.templates import WILDCARD

SET_FEATURES: dict[str, tuple[str, ...]] = {
    name: tuple(f"F{row + 1}" for row in rows) for name, rows in FEATURE_SETS.items()
}
"""Names of the features of each set; bit i of a feature vector is the set's feature i."""

SET_OF: dict[str, str] = {feature: name for name, features in SET_FEATURES.items() for feature in features}
"""Feature set of each feature, F1 to F40."""


@dataclass(frozen=True)
class Keyframe:
    """Set of feature vectors of one feature set that agree with `values` on the named features.

    Attributes
    ----------
    feature_set : `upper`, `lower` or `mixed`
    values : (feature name, 0 or 1) in the order of the set; other features are wildcards

    Raises
    ------
    RetrievalError
        The set or a feature is unknown, a feature is of another set, a value is not 0 or 1, or there is no feature.
    """

    feature_set: str
    values: tuple[tuple[str, int], ...]

    def __post_init__(self) -> None:
        if self.feature_set not in SET_FEATURES:
            raise RetrievalError(f"unknown feature set {self.feature_set!r}; choose one of {', '.join(SET_FEATURES)}")
        if not self.values:
            raise RetrievalError("a keyframe without features matches every frame; name at least one feature")
        names = SET_FEATURES[self.feature_set]
        for name, value in self.values:
            _known(name)
            if name not in names:
                raise RetrievalError(
                    f"feature {name} is not in the set {self.feature_set!r} ({names[0]} to {names[-1]}); "
                    "use another keyframe of its set at the same position"
                )
            if value not in (0, 1):
                raise RetrievalError(
                    f"feature {name} has the value {value!r} in a keyframe; give 0 or 1, or leave it out"
                )
        ordered = sorted(dict(self.values).items(), key=lambda item: names.index(item[0]))
        object.__setattr__(self, "values", tuple((name, int(value)) for name, value in ordered))

    @cached_property
    def mask(self) -> int:
        """Bits of the features other than wildcards."""
        names = SET_FEATURES[self.feature_set]
        return sum(1 << names.index(name) for name, _ in self.values)

    @cached_property
    def value(self) -> int:
        """Bits of the features that are 1."""
        names = SET_FEATURES[self.feature_set]
        return sum(bit << names.index(name) for name, bit in self.values)


def _known(name: str) -> None:
    if name not in SET_OF:
        raise RetrievalError(f"unknown feature {name!r}; the features are F1 to F{len(SET_OF)}")


def keyframes_at_once(features: Mapping[str, int]) -> tuple[Keyframe, ...]:
    """Split a condition on features of several sets into one keyframe per set, for the same frame."""
    for name in features:
        _known(name)
    groups = {s: tuple((n, v) for n, v in features.items() if SET_OF[n] == s) for s in SET_FEATURES}
    return tuple(Keyframe(name, values) for name, values in groups.items() if values)


def keyframes_of_column(column: np.ndarray) -> tuple[Keyframe, ...]:
    """Return the keyframes of a template column, int8 (40,): one per set with an entry other than `WILDCARD`."""
    return keyframes_at_once(
        {f"F{row + 1}": int(column[row]) for row in np.flatnonzero(np.asarray(column) != WILDCARD)}
    )


@dataclass(frozen=True)
class KeyframeQuery:
    """Ordered keyframes with the admissible distances between neighbours.

    Several keyframes at the same frame are adjacent with the bounds (0, 0).

    Attributes
    ----------
    keyframes : at least one
    bounds : (least, greatest) distance in frames between keyframes k and k + 1, one less than keyframes; a greatest
        distance of None is unbounded
    lead : frames of the searched motion before the first keyframe, >= 0
    tail : frames of the searched motion after the last keyframe, >= 0
    label : motion class of the query, "" if none

    Raises
    ------
    RetrievalError
        There is no keyframe, or the bounds do not fit.
    """

    keyframes: tuple[Keyframe, ...]
    bounds: tuple[tuple[int, int | None], ...] = ()
    lead: int = 0
    tail: int = 0
    label: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if not self.keyframes:
            raise RetrievalError("a keyframe query needs at least one keyframe; none was given")
        if len(self.bounds) != len(self.keyframes) - 1:
            raise RetrievalError(
                f"{len(self.keyframes)} keyframes need {len(self.keyframes) - 1} distances, not {len(self.bounds)}"
            )
        for least, greatest in self.bounds:
            if least < 0 or (greatest is not None and greatest < least):
                raise RetrievalError(
                    f"distances from {least} to {greatest} frames are an empty range; give 0 <= least <= greatest"
                )
        if self.lead < 0 or self.tail < 0:
            raise RetrievalError(f"lead {self.lead} and tail {self.tail} of a query are frames; give 0 or more")
