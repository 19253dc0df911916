"""Runs of consecutive frames."""

from __future__ import annotations

import numpy as np


def spans(flags: np.ndarray) -> list[slice]:
    """Return the maximal runs of True in a bool (T,) array, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8))).tolist()
    return [slice(start, stop) for start, stop in zip(edges[::2], edges[1::2], strict=True)]
