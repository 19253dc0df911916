"""Nearest neighbours among the feature vectors of a database, by one of three providers behind one small interface."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from toolkit.errors import SettingsError
from toolkit.kernels.cloud import nearest
from toolkit.skeleton import END_EFFECTORS

FEATURE_SIZE = 3 * len(END_EFFECTORS)
"""Length of a feature vector: five end effectors, three coordinates each."""


class NearestNeighbours(ABC):
    """Exact search by Euclidean distance among features (N, 15), float32, metres, N at least 1."""

    def __init__(self, features: np.ndarray) -> None:
        self._features = np.ascontiguousarray(features, dtype=np.float32)

    @abstractmethod
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


class LeafSearch(NearestNeighbours):
    """Compiled scan of k-d leaves (`toolkit.kernels.cloud.nearest`).

    It takes any subset of coordinates; its worst case is a plain scan. Of equal distances the lowest index comes first.
    """

    def __init__(self, features: np.ndarray) -> None:
        super().__init__(features)
        self._order, self._starts = nearest.leaf_order(self._features)
        self._columns = np.ascontiguousarray(self._features[self._order].T)
        self._low, self._high = nearest.boxes(self._columns, self._starts)

    def query(self, queries: np.ndarray, k: int, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `NearestNeighbours.query`."""
        distances = np.empty((len(queries), k), dtype=np.float32)
        indices = np.empty((len(queries), k), dtype=np.int64)
        nearest.nearest(
            queries, used, self._columns, self._order, self._starts, self._low, self._high, distances, indices
        )
        return np.sqrt(distances, dtype=np.float64), indices


class _TreeSearch(NearestNeighbours):
    """A library's tree; one more is built for every subset of coordinates that is asked for."""

    def __init__(self, features: np.ndarray) -> None:
        super().__init__(features)
        self._trees: dict[bytes, Any] = {}
        self._tree(np.ones(FEATURE_SIZE, dtype=np.bool_))

    def query(self, queries: np.ndarray, k: int, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `NearestNeighbours.query`."""
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


SEARCHES: dict[str, type[NearestNeighbours]] = {"compiled": LeafSearch, "open3d": Open3DSearch, "scipy": ScipySearch}
"""Providers by the name used in settings; `benchmarks/lookup.py` compares them at equal answers."""
DEFAULT_SEARCH = "compiled"


def make_search(name: str, features: np.ndarray) -> NearestNeighbours:
    """The provider called `name` over features (N, 15).

    Raises
    ------
    SettingsError
        There is no such provider.
    """
    if name not in SEARCHES:
        raise SettingsError(f"no nearest-neighbour search is called {name!r}; there are: {', '.join(SEARCHES)}")
    return SEARCHES[name](features)
