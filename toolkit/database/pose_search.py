"""Nearest neighbours among the feature vectors of a database."""

from __future__ import annotations

import numpy as np

from toolkit.body.skeleton import END_EFFECTORS
from toolkit.kernels.cloud import nearest
from toolkit.sensing.kd_tree import KdTree

FEATURE_SIZE = 3 * len(END_EFFECTORS)
"""Length of a feature vector: five end effectors, three coordinates each."""


class ScanSearch:
    """Exact search by Euclidean distance: a compiled scan of all poses (`toolkit.kernels.cloud.nearest`).

    It takes any subset of coordinates. Of equal distances the lowest index comes first.

    Parameters
    ----------
    features : (N, 15), float32, metres, N at least 1
    """

    def __init__(self, features: np.ndarray) -> None:
        self._columns = np.ascontiguousarray(features.T, dtype=np.float32)

    def query(self, queries: np.ndarray, k: int, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the `k` (at most N) nearest features of each query, nearest first.

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
        nearest.weighted_nearest(
            np.where(used, queries, np.float32(0.0)), used.astype(np.float32), self._columns, distances, indices
        )
        return np.sqrt(distances, dtype=np.float64), indices


class Open3DSearch:
    """Exact search by Open3D's kd-tree (Baak 2013, 5.4.3); each subset of coordinates in use has a tree.

    Distances equal those of `ScanSearch` to the bit, because they are summed in the same order. Of equal distances
    either search may take another row.

    Parameters
    ----------
    features : (N, 15), float32, metres, N at least 1
    """

    def __init__(self, features: np.ndarray) -> None:
        self._features = np.ascontiguousarray(features, dtype=np.float32)
        self._trees: dict[bytes, KdTree] = {}

    def query(self, queries: np.ndarray, k: int, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `ScanSearch.query`."""
        indices = np.empty((len(queries), k), dtype=np.int64)
        subsets, members = np.unique(used, axis=0, return_inverse=True)
        for number, columns in enumerate(subsets):
            rows = np.flatnonzero(members.ravel() == number)
            indices[rows] = self._tree(columns).query(queries[rows][:, columns], k)[0]
        squared = np.zeros((len(queries), k), dtype=np.float32)
        for column in range(FEATURE_SIZE):
            difference = self._features[indices, column] - queries[:, column, None].astype(np.float32)
            squared += np.where(used[:, column, None], difference * difference, np.float32(0.0))
        order = np.lexsort((indices, squared), axis=1)
        distances = np.sqrt(np.take_along_axis(squared, order, axis=1), dtype=np.float64)
        return distances, np.take_along_axis(indices, order, axis=1)

    def _tree(self, columns: np.ndarray) -> KdTree:
        key = columns.tobytes()
        if key not in self._trees:
            self._trees[key] = KdTree(self._features[:, columns])
        return self._trees[key]


SEARCHES: dict[str, type[ScanSearch | Open3DSearch]] = {"scan": ScanSearch, "open3d": Open3DSearch}
"""Search by the setting `lookup.search`."""
