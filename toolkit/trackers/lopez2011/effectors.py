"""Candidates for head and hands of a person from the waist up (Lopez-Mendez 2011, 2.2 and 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from toolkit.io.errors import SettingsError
from toolkit.io.typed_values import AtLeastOne
from toolkit.kernels.cloud import component_tree, geodesic
from toolkit.landmarks.extrema import Extrema, extrema_of_graph, source_node
from toolkit.landmarks.graph import Graph, Workspace, grid_graph
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.cloud import Cloud

GRAPH = LandmarkSettings(neighbour_distance=0.10, bridge_distance=0.5, smallest_component=8)
"""Graph settings of upper bodies: neighbours within 0.1 m (with bridges, results are stable from 0.05 to 0.12), bridges
up to 0.5 m, because forearms that point at the camera are not measured; a hand at 2 m has 30 pixels of 160x120."""


@dataclass(frozen=True)
class EffectorSettings:
    """Settings of the search for head and hands.

    Attributes
    ----------
    count : number of candidates per frame ("the 3 most prominent geodesic extrema", 2.2)
    source_drop : metres of the source below the centre of mass ("we find more convenient to lower the center of mass")
    prong : path length at which the direction of a prong is measured, metres: outside the source's neighbourhood,
        before the shoulder. The paper gives neither number; of 15 pairs these label head and hands right in the most
        frames of the tuning takes (38 of 96)
    narrowest, widest : range of the angle between neighbouring prongs of the fork, degrees: cosines in [0.5, 0.9] (3).
        Of all three pairs, as it is printed, this finds no person in the 8 stills of Skeltrack
    """

    count: AtLeastOne = 3
    source_drop: float = 0.2
    prong: float = 0.35
    narrowest: float = 25.84
    widest: float = 60.0

    def __post_init__(self) -> None:
        if not 0 <= self.narrowest < self.widest <= 180:
            raise SettingsError(
                f"effectors.narrowest and widest are {self.narrowest} and {self.widest}; give rising degrees up to 180"
            )


@dataclass(frozen=True, eq=False)
class Effectors:
    """Unlabelled candidates for head and hands, most prominent first.

    Attributes
    ----------
    points : float64 (n, 3), metres, frame of the cloud
    source : float64 (3,), metres, where the geodesic map begins
    paths : for each candidate the points of its shortest path, float64 (k, 3), metres, from the source on
    """

    points: np.ndarray
    source: np.ndarray
    paths: tuple[np.ndarray, ...]

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True)
class Fork:
    """Labelled head and hands; left and right are the subject's."""

    head: int
    left_hand: int
    right_hand: int


def find_effectors(
    cloud: Cloud, settings: EffectorSettings | None = None, workspace: Workspace | None = None
) -> Effectors:
    """Return the candidates in an organised cloud of one person: summits of a component tree (2.2).

    Parameters
    ----------
    cloud : level frame
    settings : number of candidates, and place of the source
    workspace : kept from frame to frame, it saves the allocations

    Raises
    ------
    SegmentationError
        The cloud is empty.
    """
    settings = settings or EffectorSettings()
    workspace = workspace or Workspace()
    graph = grid_graph(cloud, GRAPH, workspace)
    middle = cloud.points.mean(axis=0, dtype=np.float64)
    lowered = replace(GRAPH, source_drop=settings.source_drop)
    source = source_node(graph, cloud.points, middle, lowered)
    extrema = extrema_of_graph(graph, cloud.points, 1, source, workspace)
    nodes = _summits(cloud, graph, extrema)[: settings.count]
    paths = tuple(_path(graph, extrema, int(node), cloud.points) for node in nodes)
    return Effectors(cloud.points[nodes].astype(np.float64), cloud.points[source].astype(np.float64), paths)


def _summits(cloud: Cloud, graph: Graph, extrema: Extrema) -> np.ndarray:
    """Return the nodes of summits of geodesic distance of at least half a fist, by decreasing dynamics."""
    count = len(graph)
    distances = extrema.from_source
    reached = np.flatnonzero(distances != geodesic.UNREACHED)
    order = reached[np.argsort(-distances[reached], kind="stable")]
    nodes, dynamics, areas = np.empty(count, dtype=np.int64), np.empty(count), np.empty(count)
    depth = cloud.depth.reshape(-1)[cloud.pixels].astype(np.float64)
    sizes = depth**2 / (cloud.camera.fx * cloud.camera.fy)
    found = component_tree.summits(distances, order, graph.neighbours, graph.more, sizes, nodes, dynamics, areas)
    smallest_area = 0.004  # square metres, half a fist
    large = np.flatnonzero(areas[:found] >= smallest_area)
    return nodes[large[np.argsort(-dynamics[large], kind="stable")]]


def _path(graph: Graph, extrema: Extrema, node: int, points: np.ndarray) -> np.ndarray:
    out = np.empty(len(graph), dtype=np.int64)
    count = geodesic.path_to_source(graph.neighbours, graph.lengths, graph.more, extrema.from_source, node, out)
    return points[out[:count][::-1]].astype(np.float64)


def direction(path: np.ndarray, prong: float) -> float:
    """Return the angle, radians from upwards towards the image's right, of a path (k, 3) at the source, level frame.

    It is measured after `prong` metres of the path, or at its end.
    """
    lengths = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(path, axis=0) ** 2).sum(axis=1)))])
    at = min(int(np.searchsorted(lengths, prong)), len(path) - 1)
    return math.atan2(path[at, 0] - path[0, 0], path[at, 1] - path[0, 1])


def find_fork(effectors: Effectors, settings: EffectorSettings | None = None) -> Fork | None:
    """Return head and hands by the fork of their paths, the head in the middle (Lopez-Mendez 2011, 3), or None.

    Valid for a person who faces the camera. Of several forks the one with the most prominent candidates is selected.
    The paper requires cosines in [0.5, 0.9] for all three pairs of prongs, which a fork with prongs at 45 degrees
    violates; here only the angle of neighbouring prongs is limited.
    """
    settings = settings or EffectorSettings()
    angles = [direction(path, settings.prong) for path in effectors.paths]
    low, high = math.radians(settings.narrowest), math.radians(settings.widest)
    triples = combinations(range(len(angles)), 3)
    for triple in sorted(triples, key=lambda rows: (sum(rows), rows)):
        right, head, left = sorted(triple, key=lambda row: angles[row])
        if all(low <= gap <= high for gap in (angles[head] - angles[right], angles[left] - angles[head])):
            return Fork(head, left, right)
    return None
