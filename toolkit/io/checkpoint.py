"""Checkpoints: nested states of arrays, numbers, text and None in one NPZ file, without pickling."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.archives import Column, check_columns, load_archive, save_archive
from toolkit.io.errors import TrackError
from toolkit.io.yaml_reader import parse_json

VERSION = 1
HEADER = "header"
HINT = "track the recording again"


def save_checkpoint(path: str | Path, kind: str, state: Mapping[str, Any]) -> None:
    """Write a state atomically.

    Parameters
    ----------
    path : file to write
    kind : kind of the state; `load_checkpoint` requires the same
    state : values by name: arrays of numbers, numbers, text, None, tuples of these, or nested states
    """
    arrays: dict[str, np.ndarray] = {}
    header = {"version": VERSION, "kind": kind, "state": _described(state, "state", arrays)}
    save_archive(path, {HEADER: np.array(json.dumps(header)), **arrays}, compressed=False)


def load_checkpoint(path: str | Path, kind: str) -> dict[str, Any]:
    """Read a state.

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


def check_state(state: Any, columns: Mapping[str, Column], nested: Collection[str] = (), what: str = "tracker") -> None:
    """Check one level of a state before it is used; a valid checksum does not identify its author.

    Parameters
    ----------
    state : value that `load_checkpoint` returned
    columns : requirements on each of its arrays and numbers; there are no others
    nested : names of the nested states
    what : owner of the state, for the message

    Raises
    ------
    TrackError
        A name is missing or unknown, or a value has another type, shape or range.
    """
    wanted = {*columns, *nested}
    if not isinstance(state, Mapping) or set(state) != wanted:
        names = ", ".join(sorted(map(str, state))) if isinstance(state, Mapping) else type(state).__name__
        raise TrackError(f"the state of the {what} holds {names or 'nothing'} and not {', '.join(wanted)}; {HINT}")
    check_columns(state, columns, TrackError, f"the state of the {what}", HINT)


def numbered(state: Any, what: str) -> dict[int, Any]:
    """Return the states of people or frames by their numbers; raise TrackError if a name is no number."""
    # Largest number of digits in the index of a person or a frame: below 10**9, which a 32-bit integer holds.
    index_digits = 9
    if not isinstance(state, Mapping) or not all(name.isdecimal() and len(name) <= index_digits for name in state):
        raise TrackError(f"the state of the {what} has names where numbers belong; {HINT}")
    return {int(name): value for name, value in state.items()}


def _described(value: Any, where: str, arrays: dict[str, np.ndarray]) -> Any:
    """Return `value` as JSON; its arrays move into `arrays` under generated names."""
    if isinstance(value, np.ndarray):
        arrays[where] = value
        return {"array": where}
    if isinstance(value, Mapping):
        return {"names": {name: _described(item, f"{where}/{name}", arrays) for name, item in value.items()}}
    if isinstance(value, tuple):
        return {"tuple": [_described(item, f"{where}/{i}", arrays) for i, item in enumerate(value)]}
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return {"plain": value}
    raise TypeError(f"{where} of a state is {type(value).__name__}; keep arrays, numbers, text and None")


def _rebuilt(described: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Any:
    ((kind, value),) = described.items()
    if kind == "array":
        return arrays[value]
    if kind == "names":
        return {name: _rebuilt(item, arrays) for name, item in value.items()}
    if kind == "tuple":
        return tuple(_rebuilt(item, arrays) for item in value)
    return value
