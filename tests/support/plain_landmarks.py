"""Landmarks in NumPy and SciPy, the reference for the compiled ones (Baak 2013, 5.3.4 and 5.4.2)."""

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from toolkit.kernels.cloud.cloud_graph import UNIT
from toolkit.kernels.cloud.geodesic import UNREACHED
from toolkit.landmarks.centre import HALF_HEIGHT, HALF_WIDTH, MAX_STEPS, TOLERANCE
from toolkit.landmarks.extrema import Extrema
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.cloud import Cloud


def plain_graph(cloud: Cloud, settings: LandmarkSettings) -> tuple[csr_matrix, np.ndarray]:
    """Return edge lengths (N, N), metres, of the connected grid graph, and the mask (N,) of its largest component."""
    index, points = cloud.index, cloud.points
    here, there = [], []
    for dv, du in ((0, 1), (1, -1), (1, 0), (1, 1)):
        a = index[: index.shape[0] - dv, max(0, -du) : index.shape[1] - max(0, du)]
        b = index[dv:, max(0, du) : index.shape[1] + min(0, du)]
        both = (a >= 0) & (b >= 0)
        here.append(a[both])
        there.append(b[both])
    starts, ends = np.concatenate(here), np.concatenate(there)
    lengths = _in_units(points[ends] - points[starts])
    short = lengths < round(settings.neighbour_distance / UNIT)
    starts, ends, lengths = starts[short], ends[short], lengths[short]
    count = len(points)
    labels = connected_components(csr_matrix((lengths, (starts, ends)), shape=(count, count)), directed=False)[1]
    sizes = np.bincount(labels)
    first = np.full(len(sizes), count)
    np.minimum.at(first, labels, np.arange(count))
    largest = np.lexsort((first, -sizes))[0]
    trunk = np.flatnonzero(labels == largest)
    if len(sizes) > 1:
        tree = cKDTree(points[trunk].astype(np.float64))
        for label in np.flatnonzero(sizes >= settings.smallest_component):
            if label == largest:
                continue
            part = np.flatnonzero(labels == label)
            distances, nearest = tree.query(points[part].astype(np.float64))
            closest = int(distances.argmin())
            if distances[closest] < settings.bridge_distance:
                starts = np.append(starts, part[closest])
                ends = np.append(ends, trunk[nearest[closest]])
                lengths = np.append(lengths, max(1.0, np.floor(distances[closest] / UNIT + 0.5)))
    both_ways = (np.concatenate([starts, ends]), np.concatenate([ends, starts]))
    matrix = csr_matrix((np.tile(lengths * UNIT, 2), both_ways), shape=(count, count))
    return matrix, labels == largest


def _in_units(differences: np.ndarray) -> np.ndarray:
    """Return lengths of differences (E, 3) in whole units of `cloud_graph.UNIT`, float64 (E,)."""
    x, y, z = differences.T
    return np.maximum(np.floor(np.sqrt(x * x + y * y + z * z).astype(np.float64) / UNIT + 0.5), 1.0)


def plain_extrema(matrix: csr_matrix, points: np.ndarray, source: int, count: int) -> Extrema:
    """Return extrema by one whole Dijkstra each; earlier extrema join the source at no cost."""
    nodes: list[int] = []
    reach: list[float] = []
    visited: list[int] = []
    before = np.full(len(points), np.inf)
    first = before
    for i in range(count):
        distances = dijkstra(matrix, indices=[source, *nodes], min_only=True)
        first = distances if i == 0 else first
        farthest = int(np.where(np.isfinite(distances), distances, -1.0).argmax())
        if distances[farthest] <= 0.0:
            break
        visited.append(int((distances < before).sum()))
        nodes.append(farthest)
        reach.append(float(distances[farthest]))
        before = distances
    rows = np.array(nodes, dtype=np.int32)
    units = np.where(np.isfinite(first), np.rint(first / UNIT), UNREACHED).astype(np.int32)
    return Extrema(rows, points[rows], np.array(reach), np.array(visited, dtype=np.int32), source, units)


def plain_source(
    points: np.ndarray, largest: np.ndarray, centre: np.ndarray, settings: LandmarkSettings, scale: float
) -> int:
    """Return the node of the largest component nearest to the hips; see `source_node`."""
    squared = ((points - (centre - [0.0, scale * settings.source_drop, 0.0])) ** 2).sum(axis=1)
    return int(np.where(largest, squared, np.inf).argmin())


def plain_centre(points: np.ndarray, start: np.ndarray | None, scale: float) -> np.ndarray:
    """Return the mean shift with the upright ellipsoid; see `cloud_centre`."""
    axes = scale * np.array([HALF_WIDTH, HALF_HEIGHT, HALF_WIDTH])
    starts = [np.median(points, axis=0).astype(np.float64)]
    if start is not None:
        starts.insert(0, np.array(start, dtype=np.float64))
    for centre in starts:
        for _ in range(MAX_STEPS):
            differences = points - centre
            inside = ((differences / axes) ** 2).sum(axis=1) <= 1.0
            if not inside.any():
                break
            step = differences[inside].mean(axis=0)
            centre = centre + step
            if step @ step < TOLERANCE**2:
                break
        if inside.any():
            return centre
    return centre
