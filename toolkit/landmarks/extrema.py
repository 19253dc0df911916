"""Geodesic extrema of a cloud: points with maximum geodesic distance from the torso (Baak 2013, 5.4.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.io.errors import UsageError
from toolkit.kernels.cloud import cloud_graph, geodesic
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.graph import Graph, Workspace, grid_graph
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.cloud import Cloud


@dataclass(frozen=True, eq=False)
class Extrema:
    """The first n geodesic extrema (`E_I^n`, Eq. 5.2), in the order found.

    Attributes
    ----------
    nodes : int32 (n,), rows of the cloud
    points : float32 (n, 3), metres, frame of the cloud
    distances : float64 (n,), metres, decreasing: geodesic distance to the source or the nearest earlier extremum
    visited : int32 (n,), nodes whose distance was settled in the pass that found the extremum (Fig. 5.9). The first
        pass visits all that can be reached
    source : the source node
    from_source : int32 (N,), geodesic distance of each node from the source, in units of `cloud_graph.UNIT` metres,
        `geodesic.UNREACHED` without a path; valid as long as the graph
    """

    nodes: np.ndarray
    points: np.ndarray
    distances: np.ndarray
    visited: np.ndarray
    source: int
    from_source: np.ndarray

    def __len__(self) -> int:
        return len(self.nodes)


def geodesic_extrema(cloud: Cloud, count: int, settings: LandmarkSettings | None = None) -> Extrema:
    """Return the first `count` geodesic extrema of an organised cloud, with the source at the hips.

    Fewer are returned if fewer nodes are reachable. Raises as `grid_graph` and `extrema_of_graph`.
    """
    graph = grid_graph(cloud, settings or LandmarkSettings())
    source = source_node(graph, cloud.points, cloud_centre(cloud.points), settings)
    return extrema_of_graph(graph, cloud.points, count, source)


def source_node(
    graph: Graph, points: np.ndarray, centre: np.ndarray, settings: LandmarkSettings | None = None, scale: float = 1.0
) -> int:
    """Return the source node at the hips, `source_drop` below a centre (3,) in the level frame.

    It is the nearest node of the largest component, the lowest index of equally near ones. A hand in front of the belly
    is another component and is not selected. `scale` is the size of the person relative to an adult.
    """
    settings = settings or LandmarkSettings()
    hips = np.array(centre, dtype=np.float64)
    hips[1] -= scale * settings.source_drop
    return int(geodesic.nearest_in_component(points, graph.roots, graph.trunk, hips))


def extrema_of_graph(
    graph: Graph, points: np.ndarray, count: int, source: int, workspace: Workspace | None = None
) -> Extrema:
    """Return the first `count` geodesic extrema of a graph over `points` (N, 3) from node `source` (Algorithm 1).

    Ties go to the lowest node. Unreachable nodes are ignored.

    Raises
    ------
    UsageError
        `count` is below 1 or `source` is not a node.
    """
    if count < 1:
        raise UsageError(f"count is {count}; ask for at least 1 geodesic extremum")
    if not 0 <= source < len(graph):
        raise UsageError(f"source node {source} is not in a graph of {len(graph)} nodes; use a row of the cloud")
    workspace = workspace or Workspace()
    total = len(graph)
    nodes, reach, visited = (np.empty(count, dtype=np.int32) for _ in range(3))
    from_source = workspace.take("from source", total)
    found = geodesic.extrema(
        graph.neighbours, graph.lengths, graph.more, source, workspace.take("distances", total), from_source,
        workspace.take("queue", total), workspace.take("waiting", total, dtype=np.bool_),
        workspace.take("stamps", total), nodes, reach, visited,
    )  # fmt: skip
    nodes = nodes[:found]
    return Extrema(
        nodes=nodes,
        points=points[nodes],
        distances=reach[:found] * cloud_graph.UNIT,
        visited=visited[:found],
        source=source,
        from_source=from_source,
    )
