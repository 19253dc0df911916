"""Whether a stretch of features meets a query, without an index."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from toolkit.retrieval.keyframes.query import Keyframe, KeyframeQuery


def met_within(query: KeyframeQuery, values: np.ndarray) -> bool:
    """Whether the keyframes of a query occur in order, at admissible distances, in features bool (40, T)."""
    reached = np.ones(values.shape[1], dtype=bool)
    for k, keyframe in enumerate(query.keyframes):
        rows, wanted = _conditions(keyframe)
        here = (values[rows] == wanted).all(axis=0)
        if k > 0:
            reached = _moved_on(reached, *query.bounds[k - 1])
        reached = here & reached
        if not reached.any():
            return False
    return True


@lru_cache(maxsize=4096)
def _conditions(keyframe: Keyframe) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a matrix (K,) and what they have to be, bool (K, 1)."""
    rows = np.array([int(name.removeprefix("F")) - 1 for name, _ in keyframe.values])
    return rows, np.array([[bool(value)] for _, value in keyframe.values])


def _moved_on(reached: np.ndarray, least: int, greatest: int | None) -> np.ndarray:
    """Columns (T,) that lie between `least` and `greatest` columns behind a reached one."""
    count = len(reached)
    sums = np.concatenate([[0], np.cumsum(reached)])
    stop = np.clip(np.arange(count) - least + 1, 0, count)
    start = np.zeros(count, dtype=np.int64) if greatest is None else np.clip(np.arange(count) - greatest, 0, count)
    return sums[stop] > sums[np.minimum(start, stop)]
