"""Checkpoints: states of nested values in one NPZ file, without pickling.

A state is made of dataclasses, mappings, lists, arrays, numbers, text and None. An object that changes lists the
attributes of its state in `CHECKPOINT`. Type hints define what is read: an array is `Annotated` with a `Column`, a
number with a `Range`. An attribute without a hint keeps the type, and an array the shape, of its present value.
"""

from __future__ import annotations

import json
import math
import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import GenericAlias, UnionType
from typing import Annotated, Any, TypeVar

import numpy as np

from toolkit.io.archives import Column, check_columns, load_archive, save_archive
from toolkit.io.errors import TrackError
from toolkit.io.typed_values import TypedReader
from toolkit.io.yaml_reader import parse_json

VERSION = 2
HEADER = "header"
HINT = "track the recording again"

Made = TypeVar("Made")


def save_checkpoint(path: str | Path, kind: str, state: Any) -> None:
    """Write a state atomically; `load_checkpoint` requires the same `kind`."""
    arrays: dict[str, np.ndarray] = {}
    header = {"version": VERSION, "kind": kind, "state": _described(plain(state), "state", arrays)}
    save_archive(path, {HEADER: np.array(json.dumps(header)), **arrays}, compressed=False)


def load_checkpoint(path: str | Path, kind: str) -> dict[str, Any]:
    """Read a state as `plain` returned it, for `read_state` or `restore`.

    Raises
    ------
    TrackError
        The file is damaged, of another version or of another kind.
    """
    arrays = load_archive(path, TrackError, HINT, inside=True)
    if HEADER not in arrays:
        raise TrackError(f"{path} holds no state of a tracker; {HINT}")
    header = parse_json(str(arrays[HEADER]), f"the header of {path}", TrackError, HINT)
    try:
        if (header["version"], header["kind"]) != (VERSION, kind):
            raise TrackError(
                f"{path} is version {header['version']} of the state of {header['kind']!r}, not version {VERSION} "
                f"of {kind!r}; {HINT}"
            )
        return dict(_rebuilt(header["state"], arrays))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise TrackError(f"{path} holds no state of a tracker ({error}); {HINT}") from error


def plain(value: Any) -> Any:
    """Return a state as nested dicts, lists, arrays, numbers, text and None."""
    if (names := getattr(value, "CHECKPOINT", None)) is not None:
        return {name.lstrip("_"): plain(getattr(value, name)) for name in names}
    if is_dataclass(value):
        return {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value.value if isinstance(value, Enum) else value


def read_state(state: Any, kind: type[Made], where: str) -> Made:
    """Return a state of a type from its plain values; a valid checksum does not identify their author.

    Raises
    ------
    TrackError
        A name is missing or unknown, or a value has another type, shape or range.
    """
    return _StateReader(TrackError, HINT, source="the state").read(state, kind, where)


def restore(owner: Any, state: Any, where: str) -> None:
    """Set the attributes of an object's state from their plain values; raises as `read_state`.

    The objects in these attributes are restored too. A method `check_restored` raises ValueError for values that do not
    fit together.
    """
    hints = typing.get_type_hints(type(owner), include_extras=True)
    names = {name.lstrip("_"): name for name in owner.CHECKPOINT}
    if not isinstance(state, Mapping) or state.keys() != names.keys():
        raise TrackError(f"the state of the {where} does not hold {', '.join(names)} alone; {HINT}")
    for key, name in names.items():
        setattr(owner, name, _restored(getattr(owner, name), state[key], hints.get(name), f"{where}.{key}"))
    if hasattr(owner, "check_restored"):
        try:
            owner.check_restored()
        except (ValueError, TypeError, KeyError) as error:
            raise TrackError(f"the state of the {where} cannot be used ({error}); {HINT}") from error


def _restored(present: Any, value: Any, hint: Any, where: str) -> Any:
    """Return the restored value of an attribute."""
    if hasattr(present, "CHECKPOINT") and not hasattr(present, "of_checkpoint"):
        restore(present, value, where)
        return present
    if isinstance(present, dict) and present:
        return {key: _restored(one, value[key], None, f"{where}.{key}") for key, one in present.items()}
    if isinstance(present, np.ndarray):
        hint = hint or Annotated[np.ndarray, Column(present.dtype.kind, present.shape)]
    return read_state(value, hint or type(present), where)


class _StateReader(TypedReader):
    """Reader that also reads arrays, enumerations and classes with a constructor `of_checkpoint`."""

    def _any(self, value: Any, kind: Any, where: str) -> Any:
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if origin is Annotated and isinstance(arguments[1], Column):
            array = self._expect(value, np.ndarray, where, "an array")
            check_columns({where: array}, {where: arguments[1]}, self.error, "the state", self.hint)
            return array
        if isinstance(value, np.ndarray) and value.ndim < 2 and origin not in (typing.Union, UnionType):
            value = value.tolist()
        if origin is Mapping:
            kind = GenericAlias(dict, arguments)
        elif isinstance(kind, type) and issubclass(kind, Enum):
            if value not in [choice.value for choice in kind]:
                raise self._wrong(f"{where} is none of {', '.join(str(choice.value) for choice in kind)}")
            return kind(value)
        elif hasattr(kind, "of_checkpoint"):
            hints = typing.get_type_hints(kind, include_extras=True)
            named = self._expect(value, dict, where, "names with values")
            if named.keys() != {*kind.CHECKPOINT}:
                raise self._wrong(f"{where} does not hold {', '.join(kind.CHECKPOINT)} alone")
            return kind.of_checkpoint(**{k: self._any(v, hints[k], f"{where}.{k}") for k, v in named.items()})
        return super()._any(value, kind, where)


def _described(value: Any, where: str, arrays: dict[str, np.ndarray]) -> Any:
    """Return a plain value as JSON; arrays, lists of numbers and numbers that JSON lacks move into `arrays`."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, list) and value and all(type(item) is float for item in value):
        value = np.array(value)
    if isinstance(value, float) and not math.isfinite(value):
        value = np.array(value)
    if isinstance(value, np.ndarray):
        arrays[where] = value
        return {"array": where}
    if isinstance(value, dict):
        return {"names": [[key, _described(item, f"{where}/{key}", arrays)] for key, item in value.items()]}
    if isinstance(value, list):
        return {"list": [_described(item, f"{where}/{i}", arrays) for i, item in enumerate(value)]}
    if value is None or isinstance(value, (bool, int, float, str)):
        return {"plain": value}
    raise TypeError(f"{where} of a state is {type(value).__name__}; keep arrays, numbers, text and None")


def _rebuilt(described: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Any:
    ((kind, value),) = described.items()
    if kind == "array":
        return arrays[value]
    if kind == "names":
        return {name: _rebuilt(item, arrays) for name, item in value}
    return [_rebuilt(item, arrays) for item in value] if kind == "list" else value
