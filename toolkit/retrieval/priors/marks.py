"""MT priors: entries of motion templates that say what a limb does, and what becomes of them in a track (thesis 6.4.1).

Stretches of equal entries of a template are marked by themselves; a file may mark others. Used is what can be demanded
of single poses: bent and abducted joints, hands above the neck and lowered, feet behind and before each other, and feet
that rest; and that a hand moves to the front, of a pose and the place of that hand shortly before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from toolkit.io.errors import RetrievalError
from toolkit.io.spans import spans
from toolkit.io.typed_values import TypedReader
from toolkit.io.yaml_reader import read_yaml
from toolkit.retrieval.annotation.annotator import MotionClass
from toolkit.retrieval.features.relational import FEATURES
from toolkit.retrieval.priors.allocation import Allocation
from toolkit.retrieval.templates import WILDCARD, QuantisedTemplate

DEMANDED = (3, 4, 7, 8, 15, 16, 20, 21, 27, 28, 29, 30, 33, 34)
"""Numbers of the features that a pose fulfils or not: hands above the neck, bent elbows and knees, a foot behind the
other leg (0: it has moved to the front), abducted upper arms and thighs, lowered hands."""
FORWARDS = (1, 2)
"""Numbers of the features that are 1 where a hand moves to the front."""
ASKED = (*FORWARDS, 15, 16)
"""Numbers of the features that are marked by a file only: what they gain unasked is not measured."""
RESTING: dict[str, tuple[int, int]] = {"right_leg": (17, 25), "left_leg": (18, 26)}
"""Leg -> the features that are 0 where its foot rests: raised, and fast."""
USED: tuple[int, ...] = tuple(sorted({*DEMANDED, *FORWARDS, *(number for pair in RESTING.values() for number in pair)}))
"""Numbers of all features that are marked."""
HINT = "write lines such as `kick: [{feature: 26, value: 0, columns: [22, 58]}]`"


SHORTEST = 5
"""Columns of equal entries that are marked by themselves."""


class Mark(NamedTuple):
    """Feature `number` has `value` in the template's columns `first` to `stop` - 1."""

    number: int
    value: bool
    first: int
    stop: int


Marks = Mapping[str, Sequence[Mark]]
"""Class -> the marks of its template."""


def marks_of(template: QuantisedTemplate) -> list[Mark]:
    """Runs of at least `SHORTEST` equal entries, of the features in `USED` that need not be asked for."""
    values, _ = template.expanded
    return [
        Mark(number, bool(value), span.start, span.stop)
        for number in USED
        if number not in ASKED
        for value in (0, 1)
        for span in spans(values[number - 1] == value)
        if span.stop - span.start >= SHORTEST
    ]


def marks_of_classes(classes: Sequence[MotionClass]) -> dict[str, list[Mark]]:
    """What is marked by itself: class -> marks of its template."""
    return {c.label: marks_of(c.template) for c in classes}


@dataclass(frozen=True)
class _Entry:
    """A mark as a file says it: columns count from 1."""

    feature: int
    value: int
    columns: tuple[int, int]


def load_marks(path: str | Path, classes: Sequence[MotionClass]) -> Marks:
    """Marks of a file in place of those that the classes it names have by themselves.

    YAML: class -> list of `{feature: 26, value: 0, columns: [22, 58]}`; columns count from 1, both ends included. An
    empty list marks nothing.

    Raises
    ------
    RetrievalError
        The file is none of that kind, or names a class, a feature or columns that are not there.
    """
    reader = TypedReader(RetrievalError, HINT, source=str(path))
    raw = reader.read(read_yaml(path, str(path), RetrievalError, HINT) or {}, dict[str, list[_Entry] | None], "")
    found = marks_of_classes(classes)
    known = {c.label: c for c in classes}
    for label, entries in raw.items():
        if label not in known:
            raise RetrievalError(f"{path} marks the class {label!r}; there are: {', '.join(known)}")
        length = known[label].template.expanded[0].shape[1]
        found[label] = [_mark(entry, length, f"{label} in {path}") for entry in entries or []]
    return found


def _mark(entry: _Entry, length: int, where: str) -> Mark:
    """The mark of a template with so many columns, from one entry of a file."""
    first, last = entry.columns
    if entry.feature not in USED:
        raise RetrievalError(f"a mark of {where} names feature {entry.feature}; used are {', '.join(map(str, USED))}")
    if entry.value not in (0, 1):
        raise RetrievalError(f"a mark of {where} has the value {entry.value!r}; give 0 or 1")
    if not 1 <= first <= last <= length:
        raise RetrievalError(
            f"a mark of {where} has columns {first} to {last}; give first and last within 1 to {length}"
        )
    return Mark(entry.feature, bool(entry.value), first - 1, last)


def tracking_priors(allocation: Allocation, classes: Sequence[MotionClass], marks: Marks) -> np.ndarray:
    """What the marks say of each frame that bears a label: int8 (40, T), 0, 1 or `WILDCARD` (thesis 6.4.1)."""
    found = np.full((len(FEATURES), len(allocation.label)), WILDCARD, dtype=np.int8)
    for row, motion_class in enumerate(classes):
        for mark in marks.get(motion_class.label, ()):
            inside = (allocation.column >= mark.first) & (allocation.column < mark.stop)
            found[mark.number - 1, inside & (allocation.label == row)] = mark.value
    return found


def rests(priors: np.ndarray, leg: str) -> np.ndarray:
    """Bool (T,): frames in which tracking priors (40, T) say that the foot of a leg rests."""
    return np.asarray((priors[[number - 1 for number in RESTING[leg]]] == 0).all(axis=0))
