"""Intermediate results of a build, kept beside its output until that is written, so that nothing is made twice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.io.archives import load_archive, save_archive
from toolkit.io.errors import DatabaseError, OutputError


@dataclass(frozen=True)
class KeptFile:
    """One intermediate file.

    Attributes
    ----------
    path : where it lies; None = nothing is kept
    key : names everything that its content depends on
    """

    path: Path | None
    key: str

    def load(self) -> dict[str, np.ndarray] | None:
        """Its arrays; None where there is no such file, it is damaged, or was made of something else."""
        if self.path is None:
            return None
        try:
            arrays = load_archive(self.path, DatabaseError, "it is made again")
            return arrays if str(arrays.pop("key")) == self.key else None
        except Exception:  # whatever is wrong with it, it is made again
            return None

    def save(self, arrays: Mapping[str, Any]) -> bool:
        """Keep arrays as far as there is room, and whether there was: a build goes on without."""
        if self.path is not None:
            try:
                save_archive(self.path, {**arrays, "key": self.key}, compressed=False)
            except OutputError:
                return False
        return True
