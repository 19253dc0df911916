"""Kernels that detect people and assign their pixels, each against a slow plain reference."""

import heapq

import numpy as np
import pytest

from toolkit.kernels.cloud.nearest import smallest_gap
from toolkit.kernels.cloud.planes import best_plane
from toolkit.kernels.image.growth import FAR, UNIT, grow, mark_near, mark_seeds, refine_labels, take_label
from toolkit.kernels.image.sharing import draw_body, nearest_owner

STEPS = np.array([0.05, 0.003, 0.4, 3.0, 0.5])


def plain_growth(points, measured, seeds, axes, reach, limits, steps, longest):
    """Return Dijkstra over a dictionary of nodes with Python's heap."""
    height, width = measured.shape
    distances, labels, heap = {}, {}, []
    for v, u in zip(*np.nonzero((seeds > 0) & (measured > 0)), strict=True):
        distances[v, u], labels[v, u] = 0, seeds[v, u]
        heapq.heappush(heap, (0, v * width + u))
    while heap:
        far, node = heapq.heappop(heap)
        v, u = divmod(node, width)
        if far > distances[v, u]:
            continue
        for vv in range(max(v - 1, 0), min(v + 2, height)):
            for uu in range(max(u - 1, 0), min(u + 2, width)):
                if (vv, uu) == (v, u) or measured[vv, uu] == 0:
                    continue
                jump, near = abs(measured[vv, uu] - measured[v, u]), min(measured[vv, uu], measured[v, u])
                smooth = jump <= steps[0] + steps[1] * near * near
                if not smooth and jump > steps[2]:
                    continue
                step = (points[vv, uu] - points[v, u]).astype(np.float64) * (1, steps[4], 1)
                way = far + max(1, int((1 if smooth else steps[3]) * np.sqrt((step**2).sum()) / UNIT))
                from_head = points[vv, uu] - axes[labels[v, u] - 1]
                inside = (
                    np.hypot(from_head[0], from_head[2]) <= reach[vv, uu] and -limits[1] <= from_head[1] <= limits[0]
                )
                if inside and way <= longest / UNIT and way < distances.get((vv, uu), FAR):
                    distances[vv, uu], labels[vv, uu] = way, labels[v, u]
                    heapq.heappush(heap, (way, vv * width + uu))
    return distances


@pytest.mark.parametrize("seed", range(4))
def test_growth_finds_the_shortest_paths_of_plain_dijkstra(seed):
    rng = np.random.default_rng(seed)
    shape = (17, 23)
    measured = rng.choice([0, 1.0, 1.04, 1.3, 2.0], p=[0.1, 0.4, 0.3, 0.15, 0.05], size=shape).astype(np.float32)
    v, u = np.mgrid[: shape[0], : shape[1]]
    points = np.dstack([0.05 * u * measured, -0.05 * v * measured, -measured]).astype(np.float32)
    seeds = np.zeros(shape, dtype=np.int32)
    seeds[3, 4], seeds[12, 18] = 1, 2
    measured[3, 4] = measured[12, 18] = 1.0
    axes = points[[3, 12], [4, 18]].astype(np.float64)
    reach, limits = np.where(rng.random(shape) < 0.5, 0.3, 0.6).astype(np.float32), np.array([0.3, 0.5])
    labels, distances = np.empty(shape, dtype=np.int32), np.empty(shape, dtype=np.int32)
    grow(points, measured, seeds, axes, reach, limits, STEPS, 0.8, labels, distances)
    expected = plain_growth(points, measured, seeds, axes, reach, limits, STEPS, 0.8)
    assert len(expected) > 30
    found = {(int(v), int(u)): distances[v, u] for v, u in zip(*np.nonzero(distances != FAR), strict=True)}
    assert found.keys() == expected.keys()
    # lengths are rounded in single or double precision: a few units at most
    assert max(abs(int(found[k]) - int(expected[k])) for k in found) <= 30
    assert ((labels > 0) == (distances != FAR)).all()


def test_the_best_plane_is_that_of_brute_force():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(60, 3))
    points[:40, 2] = 0.3 * points[:40, 0] + 1.0 + rng.normal(scale=0.01, size=40)
    tolerances, weights = np.full(60, 0.03), rng.uniform(0.5, 2.0, 60)
    triples = rng.integers(0, 60, (200, 3))
    plane = np.zeros(4)
    best = best_plane(points, tolerances, weights, triples, plane)
    totals = []
    for a, b, c in triples:
        normal = np.cross(points[b] - points[a], points[c] - points[a])
        if np.linalg.norm(normal) < 1e-6:
            continue
        normal /= np.linalg.norm(normal)
        totals.append(weights[np.abs((points - points[a]) @ normal) <= tolerances].sum())
    assert best == pytest.approx(max(totals))
    assert weights[np.abs(points @ plane[:3] + plane[3]) <= tolerances].sum() == pytest.approx(best)


def test_points_go_to_the_body_that_is_nearest_in_space():
    rng = np.random.default_rng(2)
    shape, intrinsics = (14, 18), np.array([20.0, 21.0, 8.5, 6.5])
    nearest, owner = np.zeros(shape), np.zeros(shape, dtype=np.int32)
    for number in (1, 2):
        drawn = np.where(rng.random(shape) < 0.3, 1 / rng.uniform(1.0, 1.4, shape), 0.0)
        draw_body(drawn, number, nearest, owner)
        assert (nearest >= drawn).all()
    depth = rng.uniform(0.9, 1.5, shape).astype(np.float32)
    foreground = rng.random(shape) < 0.8
    seeds = np.zeros(shape, dtype=np.int32)
    seeds[0, 0] = 7
    nearest_owner(depth, foreground, nearest, owner, intrinsics, 0.2, seeds)

    def point(v, u, z):
        return np.array([(u - 8.5) * z / 20.0, (v - 6.5) * z / 21.0, z])

    drawn = [(point(v, u, 1 / nearest[v, u]), owner[v, u]) for v, u in zip(*np.nonzero(owner), strict=True)]
    for v, u in np.ndindex(shape):
        away = [np.linalg.norm(p - point(v, u, float(depth[v, u]))) for p, _ in drawn]
        k = int(np.argmin(away))
        expected = drawn[k][1] if foreground[v, u] and away[k] < 0.2 else 0
        assert seeds[v, u] == (7 if (v, u) == (0, 0) else expected)
    assert {1, 2} <= set(seeds.ravel().tolist())


def test_labels_come_back_to_full_resolution_by_depth():
    depth = np.full((6, 8), 2000, dtype=np.uint16)
    depth[:, :3] = 1000
    depth[0, 0] = 0
    coarse, labels = depth[::2, ::2].copy(), np.zeros((3, 4), dtype=np.int32)
    coarse[0, 0] = 1000
    labels[coarse == 1000] = 5
    out = np.full(depth.shape, -1, dtype=np.int32)
    refine_labels(depth, coarse, labels, 2, 50.0, out)
    np.testing.assert_array_equal(out, np.where(depth == 1000, 5, 0))
    padded, box = np.ones((8, 10), dtype=np.uint16), np.zeros(4, dtype=np.int64)
    assert take_label(depth, out, 5, padded, box) == 17
    np.testing.assert_array_equal(padded[1:-1, 1:-1], np.where(out == 5, depth, 0))
    assert box.tolist() == [1, 7, 1, 4]


def test_heads_and_what_stayed_of_torsos_are_marked():
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.5, 0.5, (9, 11, 3)).astype(np.float32)
    foreground, stayed = rng.random((9, 11)) < 0.8, rng.integers(0, 3, (9, 11)).astype(np.int32)
    places = np.array([[0.1, 0.2, 0.0], [-0.2, 0.1, 0.1]])
    seeds = np.zeros((9, 11), dtype=np.int32)
    seeds[4, 4] = 9
    mark_seeds(points, foreground, stayed, places, 0.25, 0.3, seeds)
    for v, u in np.ndindex(9, 11):
        off = points[v, u] - places
        own = (np.linalg.norm(off, axis=1) < 0.25) | ((stayed[v, u] == [1, 2]) & (np.hypot(off[:, 0], off[:, 2]) < 0.3))
        expected = 9 if (v, u) == (4, 4) else int(np.argmax(own)) + 1 if foreground[v, u] and own.any() else 0
        assert seeds[v, u] == expected
    assert set(seeds.ravel().tolist()) == {0, 1, 2, 9}


def test_pixels_near_a_place_are_those_within_the_radius():
    points = np.random.default_rng(3).normal(size=(12, 16, 3)).astype(np.float32)
    near, place = np.empty((12, 16), dtype=np.bool_), np.array([0.1, 0.0, -0.2], dtype=np.float32)
    mark_near(points, place, 0.9, near)
    assert 0 < near.sum() < near.size
    np.testing.assert_array_equal(near, np.linalg.norm(points - place, axis=2) < 0.9)


def test_the_smallest_gap_between_two_sets_of_points_is_that_of_all_pairs() -> None:
    rng = np.random.default_rng(3)
    first, second = rng.normal(size=(40, 3)), rng.normal(size=(25, 3)) + [3.0, 0.0, 0.0]
    assert smallest_gap(first, second) == pytest.approx(np.linalg.norm(first[:, None] - second, axis=2).min())
    assert smallest_gap(first, second[:0]) == np.inf
