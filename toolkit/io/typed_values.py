"""Reader of plain values from JSON and YAML into dataclasses and typed containers.

A file may come from an untrusted source. A value of another type, a number out of range and a list of excessive length
raise one sentence that names the value.
"""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from toolkit.io.errors import DepthMocapError

Made = TypeVar("Made")
_MARK = "constant"
MOST_ITEMS = 1_000_000
"""Largest number of entries of one list or table of a settings, notes or people file."""


def constant(value: Any) -> Any:
    """Declare a field of a settings dataclass that is not a user setting.

    An experiment can change it by its dotted name, as the papers' variants do in `configs/`. A changed constant is
    written beside the results like any setting.
    """
    return field(default=value, metadata={_MARK: True})


def is_constant(item: Field[Any]) -> bool:
    """Return True if a field was made by `constant`."""
    return _MARK in item.metadata


@dataclass(frozen=True)
class Range:
    """Inclusive range of a number, written beside its type as `Annotated[float, Range(0.0, 1.0)]`."""

    low: float = -math.inf
    high: float = math.inf


Share = Annotated[float, Range(0.0, 1.0)]
NotNegative = Annotated[float, Range(0.0)]
AtLeastOne = Annotated[int, Range(1)]


_PLAIN: dict[Any, tuple[Any, str]] = {
    bool: (bool, "true or false"), int: (int, "a whole number"), float: ((int, float), "a number"),
    str: (str, "text"), Path: (str, "a path"),
}  # fmt: skip
"""Plain type -> accepted types and the word for them."""


@dataclass(frozen=True)
class TypedReader:
    """Converter of plain values to typed values.

    Attributes
    ----------
    error : error class to raise
    hint : advice for the message
    loose : ignore unknown names instead of raising, because a later version may have added them
    written_by_hand : accept text that is a number, because YAML 1.1 reads 1e-3 as text
    what : word for a name with a value, for the message
    source : file of the values, for the message
    """

    error: type[DepthMocapError]
    hint: str = ""
    loose: bool = False
    written_by_hand: bool = False
    what: str = "entry"
    source: str = ""

    def read(self, value: Any, kind: type[Made], where: str) -> Made:
        """Return `value` as a dataclass, number, text, Boolean, list, tuple, dict, Literal, None or path.

        Parameters
        ----------
        kind : wanted type, also a generic such as `dict[str, tuple[float, ...]]`; a dataclass's fields may be
            `Annotated` with a `Range`
        where : name of the value, for the message

        Raises
        ------
        DepthMocapError
            `error`: an entry is missing, unknown, of another type or out of range.
        """
        return typing.cast(Made, self._any(value, kind, where))

    def _any(self, value: Any, kind: Any, where: str) -> Any:
        if is_dataclass(kind) and isinstance(kind, type):
            return self._fields(self._expect(value, dict, where, "names with values"), kind, where)
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if origin is Annotated:
            return self._within(self._any(value, arguments[0], where), arguments[1:], where)
        if origin in (typing.Union, types.UnionType):
            return self._union(value, arguments, where)
        if origin is Literal:
            if not any(value == choice and type(value) is type(choice) for choice in arguments):
                raise self._wrong(f"{where} is {kind_of(value)}; it can be: {', '.join(map(str, arguments))}")
            return value
        if origin in (tuple, list):
            items = self._items(self._expect(value, (list, tuple), where, "a list"), origin, arguments, where)
            return origin(items)
        if origin is dict:
            table = self._bounded(self._expect(value, dict, where, "names with values"), where)
            return {
                self._any(key, arguments[0], f"a name in {where}"): self._any(item, arguments[1], _inside(where, key))
                for key, item in table.items()
            }
        return value if kind is Any else self._plain(value, kind, where)

    def _fields(self, values: Mapping[Any, Any], kind: type, where: str, base: Any = None) -> Any:
        """Return a dataclass of the values; missing fields come from `base`, else from their defaults."""
        hints = typing.get_type_hints(kind, include_extras=True)
        wanted = {item.name: item for item in fields(kind)}
        if (unknown := [name for name in values if name not in wanted]) and not self.loose:
            there = ", ".join(name for name, item in wanted.items() if not is_constant(item))
            raise self._wrong(f"unknown {self.what} {_inside(where, unknown[0])}; there are: {there}", hinted=False)
        needed = [n for n, item in wanted.items() if item.default is MISSING and item.default_factory is MISSING]
        if base is None and (missing := [name for name in needed if name not in values]):
            raise self._wrong(f"{where or 'it'} lacks {', '.join(missing)}")
        made = {}
        for name in (name for name in wanted if name in values):
            inside, usual = _inside(where, name), wanted[name].default
            if is_dataclass(usual) and not isinstance(usual, type):
                group = self._expect(values[name], dict, inside, "names with values")
                made[name] = self._fields(group, type(usual), inside, usual)
            else:
                made[name] = self._any(values[name], hints[name], inside)
        return kind(**made) if base is None else replace(base, **made)

    def _items(self, values: Any, origin: type, arguments: tuple[Any, ...], where: str) -> list[Any]:
        self._bounded(values, where)
        alike = origin is list or arguments[1:] == (Ellipsis,)
        kinds = [arguments[0]] * len(values) if alike else list(arguments)
        if len(kinds) != len(values):
            raise self._wrong(f"{where} has {len(values)} values; it must have {len(kinds)}")
        return [self._any(v, k, f"{where}[{i}]") for i, (v, k) in enumerate(zip(values, kinds, strict=True))]

    def _union(self, value: Any, arguments: tuple[Any, ...], where: str) -> Any:
        if value is None and type(None) in arguments:
            return None
        errors = []
        for argument in arguments:
            if argument is type(None):
                continue
            try:
                return self._any(value, argument, where)
            except DepthMocapError as error:
                errors.append(error)
        raise errors[0]

    def _plain(self, value: Any, kind: Any, where: str) -> Any:
        if kind is float and self.written_by_hand and isinstance(value, str):
            with suppress(ValueError):
                return float(value)
        accepted, words = _PLAIN.get(kind, (kind, "something else"))
        self._expect(value, accepted, where, words)
        return kind(value) if kind in (float, Path) else value

    def _within(self, value: Any, marks: tuple[Any, ...], where: str) -> Any:
        for mark in marks:
            if isinstance(mark, Range) and not mark.low <= value <= mark.high:
                bounded = mark.high < math.inf
                limits = f", outside {mark.low:g} to {mark.high:g}" if bounded else f"; give at least {mark.low:g}"
                raise self._wrong(f"{where} is {value:g}{limits}")
        return value

    def _bounded(self, values: Any, where: str) -> Any:
        if len(values) > MOST_ITEMS:
            raise self._wrong(f"{where} has {len(values)} entries, more than {MOST_ITEMS}")
        return values

    def _expect(self, value: Any, kind: Any, where: str, words: str) -> Any:
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise self._wrong(f"{where or 'it'} is {kind_of(value)}; it must be {words}")
        return value

    def _wrong(self, sentence: str, *, hinted: bool = True) -> DepthMocapError:
        where = f"{self.source}: " if self.source else ""
        return self.error(f"{where}{sentence}; {self.hint}" if self.hint and hinted else f"{where}{sentence}")


def _inside(where: str, name: object) -> str:
    return f"{where}.{name}" if where else str(name)


def kind_of(value: Any) -> str:
    """Return a value in words, for a message."""
    if value is None:
        return "empty"
    shown = repr(value) if not isinstance(value, (list, dict)) else ""
    return "a list" if isinstance(value, list) else shown[:80] or "names with values"
