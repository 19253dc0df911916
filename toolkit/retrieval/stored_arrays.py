"""Common format of the files of retrieval: arrays in NPZ with a header that identifies the features."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from toolkit.io.archives import Column, check_columns, load_archive, save_archive
from toolkit.io.errors import RetrievalError
from toolkit.io.typed_values import TypedReader
from toolkit.io.yaml_reader import parse_json
from toolkit.retrieval.features.relational import feature_fingerprint

Header = TypeVar("Header")


@dataclass(frozen=True)
class StoredKind:
    """Kind of file.

    Attributes
    ----------
    name : name in messages, with its article
    version : version of the format; other versions are refused
    remedy : advice about an unreadable file, for messages
    columns : required arrays
    """

    name: str
    version: int
    remedy: str
    columns: Mapping[str, Column]

    def save(
        self, path: str | Path, header: Mapping[str, Any], arrays: Mapping[str, np.ndarray], *, compressed: bool = True
    ) -> None:
        """Write a file atomically, with the version of its kind and the fingerprint of the features."""
        text = json.dumps({"version": self.version, "features": feature_fingerprint(), **header})
        save_archive(path, {"header": np.array(text), **arrays}, compressed=compressed)

    def load(self, path: str | Path, header: type[Header]) -> tuple[Header, dict[str, np.ndarray]]:
        """Read a file of `save`: the header as a dataclass, and all arrays.

        Raises
        ------
        RetrievalError
            The file is missing, of another kind or version, damaged, made with other features, or one of its arrays has
            another type or shape than the kind's.
        """
        arrays = load_archive(path, RetrievalError, self.remedy)
        missing = sorted(({"header"} | self.columns.keys()) - arrays.keys())
        if missing:
            raise RetrievalError(f"{path} is not {self.name}, it has no {missing[0]}; {self.remedy}")
        where = f"the header of {path}"
        reader = TypedReader(RetrievalError, self.remedy, loose=True, source=where)
        text = parse_json(str(arrays["header"]), where, RetrievalError, self.remedy)
        made = reader.read(text, _Made, "")
        if made.version != self.version:
            raise RetrievalError(f"{path} is {self.name} of version {made.version}, not {self.version}; {self.remedy}")
        if made.features != feature_fingerprint():
            raise RetrievalError(
                f"{path} was made with other features ({made.features}, here {feature_fingerprint()}); {self.remedy}"
            )
        known = reader.read(text, header, "")
        check_columns(arrays, self.columns, RetrievalError, str(path), self.remedy)
        return known, arrays


@dataclass(frozen=True)
class _Made:
    """Common entries of every header."""

    version: int
    features: str
