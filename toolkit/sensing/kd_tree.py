"""Exact nearest neighbours by Open3D's kd-tree."""

from __future__ import annotations

from typing import Any

import numpy as np


class KdTree:
    """A kd-tree of `open3d.core.nns.NearestNeighborSearch` over points of any dimension.

    Its search for the k nearest is exact and gives the same answer on every call and number of threads.

    Parameters
    ----------
    points : float32 or float64 (N, D), N at least 1
    """

    def __init__(self, points: np.ndarray) -> None:
        from open3d.core import Tensor, nns

        self._tree: Any = nns.NearestNeighborSearch(Tensor.from_numpy(np.ascontiguousarray(points)))
        self._tree.knn_index()
        self._type = points.dtype

    def query(self, queries: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows of the `k` (at most N) points nearest to each of `queries` (M, D), nearest first.

        Returns
        -------
        rows : int64 (M, k)
        squared : (M, k), squared Euclidean distances, of the type of the points
        """
        if len(queries) == 0:
            return np.empty((0, k), dtype=np.int64), np.empty((0, k), dtype=self._type)
        from open3d.core import Tensor

        asked = Tensor.from_numpy(np.ascontiguousarray(queries, dtype=self._type))
        rows, squared = self._tree.knn_search(asked, k)
        return rows.numpy().astype(np.int64), squared.numpy()
