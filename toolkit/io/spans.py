"""Stretches of frames in which something holds."""

from __future__ import annotations

import numpy as np


def spans(flags: np.ndarray) -> list[slice]:
    """Longest stretches of True in bool (T,), in order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8))).tolist()
    return [slice(start, stop) for start, stop in zip(edges[::2], edges[1::2], strict=True)]
