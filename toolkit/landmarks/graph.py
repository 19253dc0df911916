"""The weighted graph of a cloud, on the pixel grid or by nearest neighbours (Baak 2013, 5.4.2, Eq. 5.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.errors import SegmentationError
from toolkit.kernels import geodesic
from toolkit.landmarks.settings import LandmarkSettings
from toolkit.sensing.cloud import Cloud


@dataclass(frozen=True, eq=False)
class Graph:
    """Adjacency lists of N nodes: node n has the edges from `offsets[n]` to `offsets[n + 1]`.

    Attributes
    ----------
    offsets : int32 (N + 1,)
    neighbours : int32 (2 E,), the node at the other end
    lengths : int32 (2 E,), above 0, in units of `geodesic.UNIT` metres
    roots : int32 (N,), lowest node of each node's component before components were joined
    edges : E, of which the last `bridges` join components
    bridges : number of edges that join a component to the largest one
    """

    offsets: np.ndarray
    neighbours: np.ndarray
    lengths: np.ndarray
    roots: np.ndarray
    edges: int
    bridges: int

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def trunk(self) -> int:
        """Root of the largest component, the one with the torso; the lowest of equally large ones."""
        return int(np.bincount(self.roots).argmax())


class Workspace:
    """Arrays for one graph and its extrema, made once and grown where a cloud is larger than all before it.

    A graph or a distance array that was made in a workspace is valid until the next one is made there.
    """

    def __init__(self) -> None:
        self._arrays: dict[str, np.ndarray] = {}

    def take(self, name: str, *shape: int, dtype: type = np.int32) -> np.ndarray:
        """Uninitialised C-contiguous array `name` of a shape."""
        size = int(np.prod(shape))
        held = self._arrays.get(name)
        if held is None or held.size < size or held.dtype != dtype:
            held = self._arrays[name] = np.empty(size + size // 2, dtype=dtype)
        return held[:size].reshape(shape)


def grid_graph(cloud: Cloud, settings: LandmarkSettings, workspace: Workspace | None = None) -> Graph:
    """Graph over the 8-neighbourhood of the pixels of an organised cloud.

    Raises
    ------
    SegmentationError
        The cloud is empty.
    """
    workspace = workspace or Workspace()
    points = _checked(cloud.points)
    ends = workspace.take("ends", 5 * len(points), 2)
    lengths = workspace.take("edge lengths", 5 * len(points))
    threshold = round(settings.neighbour_distance / geodesic.UNIT)
    count = geodesic.grid_edges(points, cloud.pixels, cloud.index, threshold, ends, lengths)
    return _connected(points, ends, lengths, count, settings, workspace)


def nearest_neighbour_graph(
    points: np.ndarray, settings: LandmarkSettings, neighbours: int = 8, workspace: Workspace | None = None
) -> Graph:
    """Graph of an unorganised cloud `points` (N, 3), metres: each point with its `neighbours` nearest points under tau.

    Raises
    ------
    SegmentationError
        The cloud is empty.
    """
    from scipy.spatial import cKDTree

    workspace = workspace or Workspace()
    points = _checked(points)
    nearest = cKDTree(points).query(points, k=min(neighbours + 1, len(points)))[1].reshape(len(points), -1)
    pairs = np.stack([np.repeat(np.arange(len(points)), nearest.shape[1]), nearest.ravel()], axis=1)
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    metres = np.linalg.norm(points[pairs[:, 0]].astype(np.float64) - points[pairs[:, 1]], axis=1)
    units = np.maximum(np.rint(metres / geodesic.UNIT), 1).astype(np.int32)
    near = units < round(settings.neighbour_distance / geodesic.UNIT)
    count = int(near.sum())
    ends = workspace.take("ends", count + len(points), 2)
    lengths = workspace.take("edge lengths", count + len(points))
    ends[:count] = pairs[near]
    lengths[:count] = units[near]
    return _connected(points, ends, lengths, count, settings, workspace)


def _checked(points: np.ndarray) -> np.ndarray:
    if len(points) == 0:
        raise SegmentationError("the cloud has no points, so it has no landmarks; skip frames without a person")
    return np.ascontiguousarray(points, dtype=np.float32)


def _connected(
    points: np.ndarray,
    ends: np.ndarray,
    lengths: np.ndarray,
    count: int,
    settings: LandmarkSettings,
    workspace: Workspace,
) -> Graph:
    """Join the components of the first `count` edges and list the edges by node."""
    nodes = len(points)
    roots = workspace.take("roots", nodes)
    geodesic.components(ends[:count], roots)
    edges = geodesic.bridge_components(
        points, roots, settings.smallest_component, settings.bridge_distance,
        workspace.take("members", nodes), workspace.take("sizes", nodes), workspace.take("starts", nodes),
        workspace.take("boxes", 2 * nodes // geodesic.CHUNK + 2, 6, dtype=np.float64), ends, lengths, count,
    )  # fmt: skip
    offsets = workspace.take("offsets", nodes + 1)
    neighbours = workspace.take("neighbours", 2 * edges)
    both_lengths = workspace.take("lengths", 2 * edges)
    geodesic.adjacency(ends[:edges], lengths[:edges], offsets, neighbours, both_lengths)
    return Graph(offsets, neighbours, both_lengths, roots, edges, edges - count)
