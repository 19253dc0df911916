"""Weighted graph of a cloud on the pixel grid (Baak 2013, 5.4.2, Eq. 5.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.io.errors import SegmentationError
from toolkit.kernels.cloud import cloud_graph
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.cloud import Cloud

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


@dataclass(frozen=True, eq=False)
class Graph:
    """Edges of N nodes as a table of R >= N rows; the first N rows belong to the nodes.

    Attributes
    ----------
    neighbours : int32 (R, D), other nodes of the edges; a free entry holds the node itself
    lengths : int32 (R, D), positive, in units of `cloud_graph.UNIT` metres; 0 in a free entry
    more : int32 (R,), row with further edges of the same node, -1 for none
    roots : int32 (N,), lowest node of each node's component before the components were joined
    bridges : int32 (B, 2), the edges that join a component to the largest one, whose node stands second
    """

    neighbours: np.ndarray
    lengths: np.ndarray
    more: np.ndarray
    roots: np.ndarray
    bridges: np.ndarray

    def __len__(self) -> int:
        return len(self.roots)

    @property
    def trunk(self) -> int:
        """Return the root of the largest component, which contains the torso; the lowest of equally large ones."""
        return int(np.bincount(self.roots).argmax())

    def matrix(self) -> csr_matrix:
        """Return the lengths, float64 (N, N), in metres, as a symmetric SciPy matrix."""
        from scipy.sparse import csr_matrix

        nodes = np.arange(len(self.more))
        for row in range(len(self), len(self.more)):
            nodes[row] = nodes[np.flatnonzero(self.more == row)[0]]
        rows, places = np.nonzero(self.lengths)
        metres = self.lengths[rows, places] * cloud_graph.UNIT
        return csr_matrix((metres, (nodes[rows], self.neighbours[rows, places])), shape=(len(self), len(self)))


class Workspace:
    """Reusable arrays for one graph and its extrema, which grow with the clouds.

    A graph or distance array of a workspace is valid until the next one is made in it.
    """

    def __init__(self) -> None:
        self._arrays: dict[str, np.ndarray] = {}

    def take(self, name: str, *shape: int, dtype: type = np.int32) -> np.ndarray:
        """Return an uninitialised C-contiguous array `name` of a shape."""
        size = math.prod(shape)
        held = self._arrays.get(name)
        if held is None or held.size < size or held.dtype != dtype:
            held = self._arrays[name] = np.empty(size + size // 2, dtype=dtype)
        return held[:size].reshape(shape)


def grid_graph(cloud: Cloud, settings: LandmarkSettings, workspace: Workspace | None = None) -> Graph:
    """Build the graph over the 8-neighbourhood of the pixels of an organised cloud, and join its components.

    Raises
    ------
    SegmentationError
        The cloud is empty.
    """
    nodes = len(cloud.points)
    if nodes == 0:
        raise SegmentationError("the cloud has no points, so it has no landmarks; skip frames without a person")
    workspace = workspace or Workspace()
    points = np.ascontiguousarray(cloud.points, dtype=np.float32)
    most_rows = nodes + 2 * (nodes // settings.smallest_component)  # with all possible bridges
    neighbours = workspace.take("neighbours", most_rows, 8)
    lengths = workspace.take("lengths", most_rows, 8)
    threshold = round(settings.neighbour_distance / cloud_graph.UNIT)
    cloud_graph.grid_table(points, cloud.pixels, cloud.index, threshold, neighbours, lengths)
    roots = workspace.take("roots", nodes)
    cloud_graph.components(neighbours, roots)
    ends = workspace.take("bridge ends", nodes, 2)
    bridge_lengths = workspace.take("bridge lengths", nodes)
    count = cloud_graph.bridge_components(
        points, roots, settings.smallest_component, settings.bridge_distance,
        workspace.take("members", nodes), workspace.take("sizes", nodes), workspace.take("starts", nodes),
        workspace.take("boxes", 2 * nodes // cloud_graph.CHUNK + 2, 6, dtype=np.float64), ends, bridge_lengths,
    )  # fmt: skip
    bridges = ends[:count]
    more = workspace.take("more", most_rows)
    rows = cloud_graph.add_bridges(bridges, bridge_lengths[:count], neighbours, lengths, more, nodes)
    return Graph(neighbours[:rows], lengths[:rows], more[:rows], roots, bridges)
