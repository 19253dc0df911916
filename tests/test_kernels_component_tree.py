"""Component tree of a function on a graph, against Higra and a plain threshold decomposition."""

import higra as hg
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.landmark_helpers import cloud_of, figure
from toolkit.kernels.cloud import component_tree
from toolkit.landmarks.graph import Graph, grid_graph
from toolkit.landmarks.landmark_settings import LandmarkSettings


def table_of(edges: list[tuple[int, int]], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return edges as the kernels' table: rows of neighbours, and continuation rows (two places in a row)."""
    lists: list[list[int]] = [[] for _ in range(count)]
    for a, b in edges:
        lists[a].append(b)
        lists[b].append(a)
    rows = [[node, node] for node in range(count)]
    more = [-1] * count
    for node, others in enumerate(lists):
        row = node
        for place, other in enumerate(others):
            if place and place % 2 == 0:
                more[row] = len(rows)
                row = len(rows)
                rows.append([node, node])
                more.append(-1)
            rows[row][place % 2] = other
    return np.array(rows, dtype=np.int32), np.array(more, dtype=np.int32)


def summits_of(
    values: np.ndarray, neighbours: np.ndarray, more: np.ndarray, sizes: np.ndarray
) -> dict[int, tuple[float, float]]:
    """Return dynamics and area of each summit by its node."""
    order = np.argsort(-values, kind="stable").astype(np.int64)
    nodes, dynamics, areas = np.empty(len(values), dtype=np.int64), np.empty(len(values)), np.empty(len(values))
    found = component_tree.summits(values, order, neighbours, more, sizes, nodes, dynamics, areas)
    return {int(n): (float(d), float(a)) for n, d, a in zip(nodes[:found], dynamics, areas, strict=False)}


def plain_summits(
    values: np.ndarray, edges: list[tuple[int, int]], sizes: np.ndarray
) -> dict[int, tuple[float, float]]:
    """Return the same by thresholding at each level and merging components."""
    alive: dict[int, float] = {}
    found: dict[int, tuple[float, float]] = {}
    for level in sorted(set(values), reverse=True):
        above = values >= level
        label = np.where(above, np.arange(len(values)), -1)
        changed = True
        while changed:
            changed = False
            for a, b in edges:
                if above[a] and above[b] and label[a] != label[b]:
                    label[[a, b]] = min(label[a], label[b])
                    changed = True
        now: dict[int, float] = {}
        for part in set(label[above]):
            members = np.flatnonzero(label == part)
            best = int(min(members, key=lambda node: (-values[node], node)))
            for other in [node for node in alive if node in members and node != best]:
                found[other] = (values[other] - level, alive[other])
            now[best] = float(sizes[members].sum())
        alive = now
    return found | {node: (values[node] - _lowest(values, edges, node), area) for node, area in alive.items()}


def _lowest(values: np.ndarray, edges: list[tuple[int, int]], start: int) -> float:
    reached, waiting = {start}, [start]
    while waiting:
        node = waiting.pop()
        for a, b in edges:
            other = b if a == node else a if b == node else node
            if other not in reached:
                reached.add(other)
                waiting.append(other)
    return min(values[node] for node in reached)


def random_graph(rng: np.random.Generator, count: int, extra: int) -> list[tuple[int, int]]:
    edges = {(int(rng.integers(node)), node) for node in range(1, count)}
    while len(edges) < count - 1 + extra:
        a, b = sorted(rng.integers(0, count, 2).tolist())
        if a != b:
            edges.add((a, b))
    return sorted(edges)


@given(seed=st.integers(0, 10_000), levels=st.integers(2, 12))
@settings(max_examples=30, deadline=None)
def test_summits_are_those_of_a_threshold_decomposition_ties_included(seed: int, levels: int) -> None:
    rng = np.random.default_rng(seed)
    edges = random_graph(rng, 25, 10)[:: rng.integers(1, 3)]  # every other edge: a forest
    values = rng.integers(0, levels, 25).astype(np.float64)
    sizes = rng.uniform(0.5, 2.0, 25)
    found = summits_of(values, *table_of(edges, 25), sizes)
    plain = plain_summits(values, edges, sizes)
    # a plateau has one summit; one that ends in the level in which it begins has none
    assert found.keys() == plain.keys()
    for node, (dynamics, area) in plain.items():
        assert found[node] == pytest.approx((dynamics, area))


def higra_dynamics(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return dynamics of the regional maxima, sorted."""
    graph = hg.UndirectedGraph(len(values))
    graph.add_edges(edges[:, 0].copy(), edges[:, 1].copy())
    tree, altitudes = hg.component_tree_max_tree(graph, values)
    dynamics = hg.attribute_dynamics(tree, altitudes, "decreasing")
    maxima = np.flatnonzero(hg.attribute_extrema(tree, altitudes))
    return np.sort(dynamics[maxima])


@pytest.mark.parametrize("seed", range(5))
def test_dynamics_are_those_of_higra_on_random_graphs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    edges = random_graph(rng, 400, 300)
    values = rng.permutation(400).astype(np.float64)
    found = summits_of(values, *table_of(edges, 400), np.ones(400))
    np.testing.assert_array_equal(np.sort([d for d, _ in found.values()]), higra_dynamics(values, np.array(edges)))


def edges_of(graph: Graph) -> np.ndarray:
    rows, places = np.nonzero(graph.lengths[: len(graph)])
    edges = np.sort(np.stack([rows, graph.neighbours[rows, places]], axis=1), axis=1)
    return np.unique(edges, axis=0)


def test_dynamics_and_area_are_those_of_higra_on_a_cloud() -> None:
    cloud = cloud_of(figure())
    graph = grid_graph(cloud, LandmarkSettings())
    rng = np.random.default_rng(0)
    values = np.linalg.norm(cloud.points, axis=1) + rng.uniform(0.0, 1e-3, len(cloud))
    edges = edges_of(graph)
    found = summits_of(values, graph.neighbours, graph.more, np.ones(len(cloud)))
    np.testing.assert_array_equal(np.sort([d for d, _ in found.values()]), higra_dynamics(values, edges))
    assert max(area for _, area in found.values()) == len(cloud)
