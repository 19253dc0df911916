"""Quantised motion templates: what a search compares documents with (thesis 2.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

WILDCARD = -1
"""Entry of a quantised template that leaves the feature open."""


@dataclass(frozen=True, eq=False)
class QuantisedTemplate:
    """A template of zeros, ones and wildcards (thesis 2.3).

    Attributes
    ----------
    name : motion class
    values : int8 (40, N), 0, 1 or `WILDCARD`
    weights : float64 (N,), how many frames of an average training clip a column stands for, about 1
    """

    name: str
    values: np.ndarray
    weights: np.ndarray

    def __len__(self) -> int:
        return self.values.shape[1]

    @property
    def wildcards(self) -> np.ndarray:
        """Bool (40, N): the open entries."""
        return self.values == WILDCARD


def expand(values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Replace a column of weight w by max(1, round(w)) equal columns that share its weight."""
    copies = np.maximum(1, np.floor(weights + 0.5)).astype(np.int64)
    return np.ascontiguousarray(np.repeat(values, copies, axis=1)), np.repeat(weights / copies, copies)
