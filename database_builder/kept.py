"""Intermediate results of a build, stored beside its output until it is written, so that an interrupted build
resumes."""

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
    path : file; None = nothing is stored
    key : names everything that its content depends on
    """

    path: Path | None
    key: str

    def load(self) -> dict[str, np.ndarray] | None:
        """Return the arrays, or None if the file is missing, damaged, or has other inputs."""
        if self.path is None:
            return None
        try:
            arrays = load_archive(self.path, DatabaseError, "it is made again")
            return arrays if str(arrays.pop("key")) == self.key else None
        except Exception:  # an invalid file is computed again
            return None

    def save(self, arrays: Mapping[str, Any]) -> bool:
        """Store arrays and return whether there was room; without room the build continues."""
        if self.path is not None:
            try:
                save_archive(self.path, {**arrays, "key": self.key}, compressed=False)
            except OutputError:
                return False
        return True
