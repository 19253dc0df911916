"""Nearest neighbours by SciPy's k-d tree: what tests and benchmarks hold the compiled search against."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from toolkit.database.pose_search import FEATURE_SIZE, LeafSearch


class ScipySearch(LeafSearch):
    """A k-d tree; one more is built for every subset of coordinates that is asked for."""

    def __init__(self, features: np.ndarray) -> None:
        self._features = np.ascontiguousarray(features, dtype=np.float32)
        self._trees: dict[bytes, cKDTree] = {}
        self._tree(np.ones(FEATURE_SIZE, dtype=np.bool_))

    def query(self, queries: np.ndarray, k: int, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `LeafSearch.query`."""
        distances = np.empty((len(queries), k))
        indices = np.empty((len(queries), k), dtype=np.int64)
        subsets, members = np.unique(used, axis=0, return_inverse=True)
        for number, columns in enumerate(subsets):
            rows = np.flatnonzero(members.ravel() == number)
            part = np.ascontiguousarray(queries[rows][:, columns])
            distances[rows], indices[rows] = self._tree(columns).query(part, np.arange(1, k + 1))
        return distances, indices

    def _tree(self, columns: np.ndarray) -> cKDTree:
        key = columns.tobytes()
        if key not in self._trees:
            self._trees[key] = cKDTree(np.ascontiguousarray(self._features[:, columns]))
        return self._trees[key]
