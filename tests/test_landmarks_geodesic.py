import heapq
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from tests.landmark_helpers import cloud_of, figure, paint
from toolkit.app.config import READER
from toolkit.io.errors import SegmentationError, SettingsError, UsageError
from toolkit.kernels.cloud import cloud_graph
from toolkit.landmarks.extrema import extrema_of_graph, geodesic_extrema, source_node
from toolkit.landmarks.graph import Graph, grid_graph
from toolkit.landmarks.landmark_settings import LandmarkSettings

SETTINGS = LandmarkSettings()


def graph_of(nodes: int, ends: np.ndarray, lengths: np.ndarray, width: int = 2) -> Graph:
    """Return the graph of a list of edges in a table of `width` columns, so that most nodes need several rows."""
    rows = nodes + 2 * len(ends)
    neighbours = np.repeat(np.arange(rows, dtype=np.int32)[:, None], width, axis=1)
    table = np.zeros((rows, width), dtype=np.int32)
    more = np.empty(rows, dtype=np.int32)
    used = cloud_graph.add_bridges(ends, lengths, neighbours, table, more, nodes)
    return Graph(neighbours[:used], table[:used], more[:used], np.zeros(nodes, np.int32), ends)


def edges_of(graph: Graph) -> dict[tuple[int, int], int]:
    """Return lengths by (node, neighbour), both directions, read from the table row by row."""
    edges = {}
    for node in range(len(graph)):
        row = node
        while row >= 0:
            for other, length in zip(graph.neighbours[row], graph.lengths[row], strict=True):
                if length:
                    edges[node, int(other)] = int(length)
            row = int(graph.more[row])
    return edges


def matrix_of(graph: Graph) -> csr_matrix:
    edges = edges_of(graph)
    here, there = np.array(list(edges), dtype=int).reshape(-1, 2).T
    return csr_matrix((np.array(list(edges.values()), dtype=float), (here, there)), shape=(len(graph), len(graph)))


def algorithm_1(graph: Graph, source: int, count: int) -> tuple[list[int], list[int], list[int]]:
    """Return the extrema of Baak 2013, Algorithm 1; a visit is a node's first removal from Q in a pass."""
    adjacency: dict[int, list[tuple[int, int]]] = {node: [] for node in range(len(graph))}
    for (here, there), length in edges_of(graph).items():
        adjacency[here].append((there, length))
    delta = [np.inf] * len(graph)
    delta[source] = 0
    queue = [(0, source)]
    nodes, reach, visits = [], [], []
    for _ in range(count):
        visited = set()
        while queue:
            _, node = heapq.heappop(queue)
            visited.add(node)
            for other, length in adjacency[node]:
                if delta[node] + length < delta[other]:
                    delta[other] = delta[node] + length
                    heapq.heappush(queue, (delta[other], other))
        farthest = int(np.argmax([d if np.isfinite(d) else -1 for d in delta]))
        if delta[farthest] == 0:
            break
        nodes.append(farthest)
        reach.append(delta[farthest])
        visits.append(len(visited))
        delta[farthest] = 0
        queue = [(0, farthest)]
    return nodes, reach, visits


@st.composite
def random_graphs(draw: st.DrawFn) -> tuple[Graph, int]:
    nodes = draw(st.integers(1, 40))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    pairs = np.unique(np.sort(rng.integers(0, nodes, (draw(st.integers(0, 120)), 2)), axis=1), axis=0)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]].astype(np.int32)
    longest = draw(st.sampled_from([3, 5_000, 600_000]))  # many ties, edges within a bucket, edges over many buckets
    lengths = rng.integers(1, longest, len(pairs)).astype(np.int32)
    return graph_of(nodes, pairs, lengths), draw(st.integers(0, nodes - 1))


@settings(max_examples=150, deadline=None)
@given(random_graphs(), st.integers(1, 25))
def test_nodes_distances_and_visits_are_those_of_algorithm_1(graph_and_source: tuple[Graph, int], count: int) -> None:
    graph, source = graph_and_source
    points = np.zeros((len(graph), 3), dtype=np.float32)
    found = extrema_of_graph(graph, points, count, source)
    nodes, reach, visits = algorithm_1(graph, source, count)
    assert found.nodes.tolist() == nodes
    assert (found.distances / cloud_graph.UNIT).tolist() == reach
    assert found.visited.tolist() == visits


def person(rng: np.random.Generator) -> np.ndarray:
    """Return the figure with noise, holes, and a hand in front of the torso as a separate component."""
    depth = figure()
    paint(depth, (-0.05, 0.0), (0.05, 0.1), 2.3)
    depth[depth > 0] += rng.normal(0.0, 0.01, int((depth > 0).sum())).astype(np.float32)
    depth[rng.random(depth.shape) < 0.05] = 0.0
    return depth


@pytest.mark.parametrize("seed", range(3))
def test_extrema_of_a_person_are_those_of_algorithm_1(seed: int) -> None:
    cloud = cloud_of(person(np.random.default_rng(seed)))
    graph = grid_graph(cloud, SETTINGS)
    assert len(graph.bridges) >= 1
    source = source_node(graph, cloud.points, np.array([0.0, 0.0, -2.6]))
    found = extrema_of_graph(graph, cloud.points, 20, source)
    nodes, reach, visits = algorithm_1(graph, source, 20)
    assert (found.nodes.tolist(), (found.distances / cloud_graph.UNIT).tolist()) == (nodes, reach)
    assert found.visited.tolist() == visits
    assert np.array_equal(found.points, cloud.points[nodes])


def test_the_first_five_extrema_of_a_stretched_figure_are_its_end_effectors() -> None:
    cloud = cloud_of(figure())
    found = geodesic_extrema(cloud, 5)
    tips = np.array([[0.75, 0.23], [-0.75, 0.23], [0.12, -0.95], [-0.12, -0.95], [0.0, 0.55]])
    assert sorted(cdist(tips, found.points[:, :2]).argmin(axis=1)) == [0, 1, 2, 3, 4]
    assert cdist(tips, found.points[:, :2]).min(axis=1).max() < 0.12
    assert (np.diff(found.distances) <= 0).all()
    assert (found.distances <= found.from_source[found.nodes] * cloud_graph.UNIT).all()


def plain_grid_edges(depth: np.ndarray, threshold: float) -> dict[tuple[int, int], int]:
    cloud = cloud_of(depth)
    points = cloud.points.astype(np.float64)
    edges = {}
    for v, u in np.argwhere(cloud.index >= 0):
        for dv in (-1, 0, 1):
            for du in (-1, 0, 1):
                row, column = v + dv, u + du
                if (dv, du) == (0, 0) or not (0 <= row < depth.shape[0] and 0 <= column < depth.shape[1]):
                    continue
                a, b = cloud.index[v, u], cloud.index[row, column]
                if b >= 0:
                    length = np.linalg.norm(points[a] - points[b])
                    if length < threshold:
                        edges[int(a), int(b)] = length
    return edges


@pytest.mark.parametrize("seed", range(4))
def test_the_grid_has_exactly_the_near_pairs_of_the_8_neighbourhood(seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = np.where(rng.random((240, 320)) < 0.02, 0.0, 1.0).astype(np.float32)
    depth[:200, 20:300] = 0.0  # touches all four borders, no pixel of one border is next to the opposite one
    depth[depth > 0] += rng.uniform(0.0, 0.05, int((depth > 0).sum())).astype(np.float32)
    depth[:, 60:] *= rng.random((240, 260)) < 0.2
    graph = grid_graph(cloud_of(depth), replace(SETTINGS, neighbour_distance=0.03, bridge_distance=1e-6))
    expected = plain_grid_edges(depth, 0.03)
    edges = edges_of(graph)
    assert edges.keys() == expected.keys()
    assert np.count_nonzero(graph.lengths) == len(expected)
    difference = [edges[pair] * cloud_graph.UNIT - expected[pair] for pair in expected]
    assert np.abs(difference).max() < 1e-6


@settings(max_examples=100, deadline=None)
@given(random_graphs())
def test_components_are_those_of_scipy_and_named_by_their_lowest_node(graph_and_source: tuple[Graph, int]) -> None:
    graph, _ = graph_and_source
    matrix = matrix_of(graph).tolil()
    width = max((len(row) for row in matrix.rows), default=0)
    table = np.array([[*row, *[node] * (width - len(row))] for node, row in enumerate(matrix.rows)], dtype=np.int32)
    roots = np.empty(len(graph), dtype=np.int32)
    cloud_graph.components(table.reshape(len(graph), width), roots)
    labels = connected_components(matrix.tocsr(), directed=False)[1]
    assert roots.tolist() == [int(np.flatnonzero(labels == label)[0]) for label in labels]


@pytest.mark.parametrize("seed", range(20))
def test_the_closest_pair_of_two_components_is_exact_and_the_lowest_of_equal_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 6, (rng.integers(2, 150), 3)).astype(np.float32)  # a coarse lattice: many ties
    if seed % 2:
        points = rng.normal(size=(400, 3)).astype(np.float32)
    side = rng.random(len(points)) < 0.3
    side[:2] = True, False
    a, b = np.flatnonzero(side), np.flatnonzero(~side)
    boxes = np.empty((2 * len(points) // cloud_graph.CHUNK + 2, 6))
    used = cloud_graph.bounding_boxes(points, a, boxes)
    boxes_b = boxes[used:]
    boxes_b = boxes_b[: cloud_graph.bounding_boxes(points, b, boxes_b)]
    found = cloud_graph.closest_pair(points, a, boxes[:used], b, boxes_b)
    squared = cdist(points[a].astype(float), points[b].astype(float), "sqeuclidean")
    i, j = np.unravel_index(squared.argmin(), squared.shape)
    assert found[2] == pytest.approx(squared.min(), abs=1e-12)
    if seed % 2 == 0:
        assert found[:2] == (a[i], b[j])


def test_components_are_joined_to_the_largest_by_their_closest_pair() -> None:
    depth = figure()
    paint(depth, (-0.05, 0.0), (0.05, 0.1), 2.3)  # a hand, 0.3 m in front of the torso
    paint(depth, (0.9, 0.18), (1.0, 0.28), 2.6)  # 0.15 m beyond the left hand
    paint(depth, (-1.4, 0.18), (-1.3, 0.28), 2.6)  # 0.55 m beyond the right hand
    depth[5:7, 5:7] = 2.6  # noise
    cloud = cloud_of(depth)
    graph = grid_graph(cloud, SETTINGS)
    parts = [graph.roots == root for root in np.unique(graph.roots)]
    largest = graph.roots == graph.trunk
    near = {}
    for part in parts:
        if part is not largest and not np.array_equal(part, largest):
            distances = cdist(cloud.points[part].astype(float), cloud.points[largest].astype(float))
            near[int(part.sum())] = distances.min()
    assert len(parts) == 5
    expected = sorted(d for size, d in near.items() if size >= SETTINGS.smallest_component and d < 0.5)
    ends = cloud.points[graph.bridges].astype(float)
    assert sorted(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)) == pytest.approx(expected)
    assert len(expected) == 2
    found = geodesic_extrema(cloud, 20)
    unreachable = cloud.points[:, 0] < -1.2  # the part beyond the right hand and the noise
    assert found.visited[0] == (~unreachable).sum()
    assert not unreachable[found.nodes].any()


def test_an_empty_cloud_and_wrong_arguments_are_refused_in_one_sentence() -> None:
    with pytest.raises(SegmentationError, match="no points"):
        geodesic_extrema(cloud_of(np.zeros((240, 320))), 5)
    cloud = cloud_of(figure())
    with pytest.raises(UsageError, match="ask for at least 1"):
        geodesic_extrema(cloud, 0)
    with pytest.raises(UsageError, match="source node"):
        extrema_of_graph(grid_graph(cloud, SETTINGS), cloud.points, 5, len(cloud))
    for wrong in ({"neighbour_distance": 0.0}, {"bridge_distance": 20.0}):
        with pytest.raises(SettingsError, match=next(iter(wrong))):
            READER.read(wrong, LandmarkSettings, "")


def test_the_source_lies_at_the_hips_and_not_on_a_hand_before_them() -> None:
    depth = figure()
    paint(depth, (-0.05, -0.35), (0.05, -0.25), 2.3)
    cloud = cloud_of(depth)
    graph = grid_graph(cloud, SETTINGS)
    centre = np.array([0.0, 0.0, -2.3])
    source = source_node(graph, cloud.points, centre)
    torso = np.flatnonzero(cloud.points[:, 2] < -2.5)
    hips = centre - [0.0, SETTINGS.source_drop, 0.0]
    assert source == torso[np.linalg.norm(cloud.points[torso] - hips, axis=1).argmin()]
