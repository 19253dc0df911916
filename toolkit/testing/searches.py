"""Nearest neighbours by the trees of libraries: what tests and benchmarks hold the compiled search against."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np

from toolkit.database.search import FEATURE_SIZE, LeafSearch


class _TreeSearch(LeafSearch):
    """A library's tree in the place of the leaves, one for every subset of coordinates that is asked for."""

    def __init__(self, features: np.ndarray) -> None:
        self._features = np.ascontiguousarray(features, dtype=np.float32)
        self._trees: dict[bytes, Any] = {}
        self._tree(np.ones(FEATURE_SIZE, dtype=np.bool_))

    def query(self, queries: np.ndarray, k: int, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `LeafSearch.query`."""
        distances = np.empty((len(queries), k))
        indices = np.empty((len(queries), k), dtype=np.int64)
        subsets, members = np.unique(used, axis=0, return_inverse=True)
        for number, columns in enumerate(subsets):
            rows = np.flatnonzero(members.ravel() == number)
            part = np.ascontiguousarray(queries[rows][:, columns])
            distances[rows], indices[rows] = self._search(self._tree(columns), part, k)
        return distances, indices

    def _tree(self, columns: np.ndarray) -> Any:
        key = columns.tobytes()
        if key not in self._trees:
            self._trees[key] = self._build(np.ascontiguousarray(self._features[:, columns]))
        return self._trees[key]

    @abstractmethod
    def _build(self, rows: np.ndarray) -> Any:
        """Tree over rows (N, D)."""

    @abstractmethod
    def _search(self, tree: Any, queries: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Distances and indices (M, k)."""


class Open3DSearch(_TreeSearch):
    """Open3D's nearest-neighbour search, the reference."""

    def _build(self, rows: np.ndarray) -> Any:
        import open3d as o3d

        tree = o3d.core.nns.NearestNeighborSearch(o3d.core.Tensor.from_numpy(rows))
        tree.knn_index()
        return tree

    def _search(self, tree: Any, queries: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        import open3d as o3d

        indices, squares = tree.knn_search(o3d.core.Tensor.from_numpy(queries), k)
        return np.sqrt(squares.numpy().astype(np.float64)), indices.numpy()


class ScipySearch(_TreeSearch):
    """SciPy's k-d tree."""

    def _build(self, rows: np.ndarray) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(rows)

    def _search(self, tree: Any, queries: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        return tree.query(queries, np.arange(1, k + 1))
