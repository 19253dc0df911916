"""Keyframes and keyframe queries (thesis, Sections 3.4 and 4.1)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from toolkit.errors import RetrievalError
from toolkit.retrieval.features.relational import FEATURE_SETS
from toolkit.retrieval.templates.quantised import WILDCARD

SET_FEATURES: dict[str, tuple[str, ...]] = {
    name: tuple(f"F{row + 1}" for row in rows) for name, rows in FEATURE_SETS.items()
}
"""Names of the features of each set; bit i of a feature vector is the set's feature i."""

SET_OF: dict[str, str] = {feature: name for name, features in SET_FEATURES.items() for feature in features}
"""Feature set of each feature, F1 to F40."""

_ROUNDING = 1e-9
"""Slack of the roundings in Eq. 4.5 and 4.6, so that 0.7 * 10 counts as 7."""


@dataclass(frozen=True)
class Keyframe:
    """A set of feature vectors of one feature set: those that agree with `values` on the features named there.

    Attributes
    ----------
    feature_set : `upper`, `lower` or `mixed`
    values : (feature name, 0 or 1) in the order of the set; every feature not named is a wildcard

    Raises
    ------
    RetrievalError
        Unknown set or feature, a feature of another set, a value other than 0 and 1, or no feature at all.
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
                    "put it into a keyframe of its own set at the same position"
                )
            if value not in (0, 1):
                raise RetrievalError(
                    f"feature {name} has the value {value!r} in a keyframe; give 0 or 1, or leave it out"
                )
        ordered = sorted(dict(self.values).items(), key=lambda item: names.index(item[0]))
        object.__setattr__(self, "values", tuple((name, int(value)) for name, value in ordered))

    @cached_property
    def mask(self) -> int:
        """Bits of the features that are not wildcards."""
        names = SET_FEATURES[self.feature_set]
        return sum(1 << names.index(name) for name, _ in self.values)

    @cached_property
    def value(self) -> int:
        """Bits of the features that have to be 1."""
        names = SET_FEATURES[self.feature_set]
        return sum(bit << names.index(name) for name, bit in self.values)


def _known(name: str) -> None:
    if name not in SET_OF:
        raise RetrievalError(f"unknown feature {name!r}; the features are F1 to F{len(SET_OF)}")


def keyframes_at_once(features: Mapping[str, int]) -> tuple[Keyframe, ...]:
    """Split a condition on features of several sets into one keyframe per set, all meant for the same frame."""
    for name in features:
        _known(name)
    groups = {s: tuple((n, v) for n, v in features.items() if SET_OF[n] == s) for s in SET_FEATURES}
    return tuple(Keyframe(name, values) for name, values in groups.items() if values)


def keyframes_of_column(column: np.ndarray) -> tuple[Keyframe, ...]:
    """Keyframes of a template column, int8 (40,) of 0, 1 and `WILDCARD`: one per set that is not all wildcards."""
    return keyframes_at_once(
        {f"F{row + 1}": int(column[row]) for row in np.flatnonzero(np.asarray(column) != WILDCARD)}
    )


def admissible(distance: float, stiffness: float) -> tuple[int, int | None]:
    """Admissible distances in frames, Eq. 4.5 and 4.6: `ceil(sigma d)` to `floor(d / sigma)`, None for no upper
    bound."""
    if not 0.0 <= stiffness <= 1.0:
        raise RetrievalError(f"stiffness {stiffness} is outside 0 to 1; 1 allows no deformation, 0 any")
    if not (math.isfinite(distance) and distance >= 0):
        raise RetrievalError(f"keyframe distance {distance} is no number of frames; give 0 or more")
    minimum = math.ceil(stiffness * distance - _ROUNDING)
    return minimum, None if stiffness == 0.0 else math.floor(distance / stiffness + _ROUNDING)


@dataclass(frozen=True)
class KeyframeQuery:
    """Keyframes in their order, with the admissible distances between neighbours.

    Several keyframes at the same frame stand one after the other with the bounds (0, 0).

    Attributes
    ----------
    keyframes : at least one
    bounds : (least, greatest) distance in frames between keyframes k and k + 1, one less than keyframes; a greatest
        distance of None is unbounded
    lead : frames of the searched motion before the first keyframe, >= 0
    tail : frames of the searched motion after the last keyframe, >= 0
    label : motion class that the query stands for, "" if none

    Raises
    ------
    RetrievalError
        No keyframe, or bounds that do not fit.
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
                    f"distances from {least} to {greatest} frames admit nothing; give 0 <= least <= greatest"
                )
        if self.lead < 0 or self.tail < 0:
            raise RetrievalError(f"lead {self.lead} and tail {self.tail} of a query are frames; give 0 or more")

    @classmethod
    def from_stiffness(
        cls,
        keyframes: Sequence[Keyframe],
        distances: Sequence[float],
        stiffness: float | Sequence[float],
        **rest: Any,
    ) -> KeyframeQuery:
        """A query (V, d) with one stiffness for all gaps or one per gap, Eq. 3.3."""
        values = [float(stiffness)] * len(distances) if isinstance(stiffness, int | float) else list(stiffness)
        if len(values) != len(distances):
            raise RetrievalError(f"{len(distances)} distances need as many stiffness values, not {len(values)}")
        bounds = tuple(admissible(d, s) for d, s in zip(distances, values, strict=True))
        return cls(tuple(keyframes), bounds, **rest)

    @classmethod
    def from_positions(
        cls, placed: Iterable[tuple[int, Sequence[Keyframe]]], length: int, stiffness: float, label: str = ""
    ) -> KeyframeQuery:
        """A query from keyframes placed at frames (from 0) of a motion of `length` frames.

        Keyframes at the same frame get the bounds (0, 0), others those of `admissible`.
        """
        ordered = sorted(((position, k) for position, group in placed for k in group), key=lambda item: item[0])
        gaps = [b - a for (a, _), (b, _) in zip(ordered, ordered[1:], strict=False)]
        bounds = tuple(admissible(gap, stiffness if gap else 1.0) for gap in gaps)
        lead, tail = (ordered[0][0], length - 1 - ordered[-1][0]) if ordered else (0, 0)
        return cls(tuple(k for _, k in ordered), bounds, lead, tail, label)

    @property
    def stiffness(self) -> tuple[float, ...]:
        """Stiffness per gap, Eq. 4.7; 0/0 counts as 1 for the bounds (0, 0)."""
        return tuple(
            0.0 if greatest is None else 1.0 if greatest == 0 else math.sqrt(least / greatest)
            for least, greatest in self.bounds
        )

    @property
    def distances(self) -> tuple[float, ...]:
        """Distance per gap in frames, Eq. 4.8; the least distance where there is no upper bound.

        With `stiffness` they give back the bounds, except (0, n): there the product under the root of Eq. 4.8 loses n.
        """
        return tuple(
            float(least) if greatest is None else math.sqrt(least * greatest) for least, greatest in self.bounds
        )
