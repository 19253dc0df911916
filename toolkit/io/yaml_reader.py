"""Readers of untrusted text, JSON, YAML and CSV files: bounded size, plain values, errors of one sentence."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml

from toolkit.io.errors import DepthMocapError
from toolkit.io.safe_open import read_file

LARGEST_TEXT = 1 << 28
"""Largest size in bytes of a table or motion file."""
LARGEST_JSON, LARGEST_YAML = 1 << 24, 1 << 18
"""Largest sizes in bytes of JSON and YAML files. Their values take many times as much memory, and YAML takes a second
for 100 kB."""
MOST_DIGITS = 300
"""Largest number of digits of an integer in a text; a float holds no more."""


def read_text(
    path: str | Path,
    error: type[DepthMocapError],
    hint: str,
    *,
    encoding: str = "utf-8",
    errors: Literal["strict", "replace"] = "strict",
    most: int = LARGEST_TEXT,
    inside: bool = False,
) -> str:
    """Return the text of a regular file of at most `most` bytes, without a byte order mark.

    With `inside`, the file lies in a folder of an untrusted source and must not be a link, see `toolkit.io.safe_open`.

    Raises
    ------
    DepthMocapError
        `error`, with `hint` as advice: the file is missing, not regular, not text, or too large.
    """
    try:
        return read_file(path, most, inside=inside).decode(encoding, errors).removeprefix("\ufeff")
    except FileNotFoundError as problem:
        raise error(f"there is no file {path}; {hint}") from problem
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise error(f"cannot read {path}: {reason}; {hint}") from problem


def read_json(path: str | Path, error: type[DepthMocapError], hint: str, *, inside: bool = False) -> Any:
    """Return the value of a JSON file; raises as `read_text`, and for invalid JSON."""
    return parse_json(read_text(path, error, hint, most=LARGEST_JSON, inside=inside), str(path), error, hint)


def read_yaml(path: str | Path, where: str, error: type[DepthMocapError], hint: str) -> Any:
    """Return the value of a YAML file, called `where` in messages; raises as `read_text`, and for invalid YAML."""
    return parse_yaml(read_text(path, error, hint, most=LARGEST_YAML), where, error, hint)


def parse_json(text: str, where: str, error: type[DepthMocapError], hint: str) -> Any:
    """Return the value of a JSON text. Raise `error` for NaN, Infinity, deep nesting and numbers above float range."""
    try:
        return json.loads(text, parse_constant=_no_constant, parse_int=_whole, parse_float=_finite)
    except (ValueError, RecursionError) as problem:
        raise error(f"{where} is no JSON ({problem}); {hint}") from problem


def parse_yaml(text: str, where: str, error: type[DepthMocapError], hint: str) -> Any:
    """Return the plain value of a YAML text.

    Invalid dates and numbers, deep nesting, and aliases, which expand a few lines to gigabytes, raise `error`.
    """
    try:
        return yaml.load(text, _PlainLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as problem:
        raise error(f"{where} is no YAML ({' '.join(str(problem).split())}); {hint}") from problem


class _PlainLoader(yaml.SafeLoader):
    """Safe loader that also rejects aliases, repeated keys and integers above float range."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.events.AliasEvent):
            raise ValueError("it holds an alias (*); write the value out")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        twice = [key for i, key in enumerate(keys) if key in keys[:i]]
        if twice:
            raise ValueError(f"the key {twice[0]!r} stands twice")
        return super().construct_mapping(node, deep=deep)

    def construct_yaml_int(self, node: Any) -> int:
        value = super().construct_yaml_int(node)
        if abs(value) >= 10**MOST_DIGITS:
            raise ValueError(f"a number of more than {MOST_DIGITS} digits")
        return value


_PlainLoader.add_constructor("tag:yaml.org,2002:int", _PlainLoader.construct_yaml_int)


def read_table(path: str | Path, error: type[DepthMocapError], hint: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file with a header line; raises as `read_text`, and for invalid CSV."""
    text = read_text(path, error, hint)
    try:
        rows = list(csv.reader(io.StringIO(text, newline="")))
    except csv.Error as problem:
        raise error(f"{path} is no CSV ({problem}); {hint}") from problem
    if not rows:
        raise error(f"{path} is empty; {hint}")
    return [dict(zip(rows[0], row, strict=False)) for row in rows[1:] if row]


def as_numbers(rows: Sequence[Sequence[str]], width: int) -> np.ndarray:
    """Return the numbers of the first `width` cells of each row (N, width), NaN for a cell without a finite one."""
    table = np.full((len(rows), width), np.nan)
    for numbers, cells in zip(table, rows, strict=True):
        for i, cell in enumerate(cells[:width]):
            with suppress(ValueError):
                numbers[i] = float(cell)
    table[~np.isfinite(table)] = np.nan
    return table


def _whole(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise ValueError(f"a number of {len(digits)} digits")
    return int(digits)


def _finite(digits: str) -> float:
    value = float(digits)
    if math.isinf(value):
        raise ValueError(f"{digits[:20]} is more than a float holds")
    return value


def _no_constant(word: str) -> None:
    raise ValueError(f"{word} is not a number")
