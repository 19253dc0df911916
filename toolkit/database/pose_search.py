"""Nearest neighbours among the feature vectors of a database."""

from __future__ import annotations

import numpy as np

from toolkit.body.skeleton import END_EFFECTORS
from toolkit.kernels.cloud import nearest

FEATURE_SIZE = 3 * len(END_EFFECTORS)
"""Length of a feature vector: five end effectors, three coordinates each."""


class LeafSearch:
    """Exact search by Euclidean distance: a compiled scan of k-d leaves (`toolkit.kernels.cloud.nearest`).

    It takes any subset of coordinates; its worst case is a plain scan. Of equal distances the lowest index comes first.

    Parameters
    ----------
    features : (N, 15), float32, metres, N at least 1
    """

    def __init__(self, features: np.ndarray) -> None:
        rows = np.ascontiguousarray(features, dtype=np.float32)
        self._order, self._starts = nearest.leaf_order(rows)
        self._columns = np.ascontiguousarray(rows[self._order].T)
        self._low, self._high = nearest.boxes(self._columns, self._starts)

    def query(self, queries: np.ndarray, k: int, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The `k` (at most N) nearest features of each query, nearest first.

        Parameters
        ----------
        queries : float32 (M, 15), metres
        used : bool (M, 15), the coordinates of each query that count

        Returns
        -------
        distances : float64 (M, k), metres, over the coordinates that count
        indices : int64 (M, k)
        """
        distances = np.empty((len(queries), k), dtype=np.float32)
        indices = np.empty((len(queries), k), dtype=np.int64)
        nearest.nearest(
            queries, used, self._columns, self._order, self._starts, self._low, self._high, distances, indices
        )
        return np.sqrt(distances, dtype=np.float64), indices
