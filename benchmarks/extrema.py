"""Twenty geodesic extrema of a frame: time and visited nodes, against SciPy's Dijkstra restarted for each (Fig. 5.9).

    python -m benchmarks.extrema [--frames 60]

The subjects are rendered, so nothing else is needed. Each frame's extrema and visited counts are compared with SciPy's;
what a visit is, and that the counts are those of Algorithm 1, is in `tests/test_landmarks_geodesic.py`.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from benchmarks._record import RESULTS, save_figures
from benchmarks._timing import percentiles, pin_to_one_processor
from toolkit.files import atomic_path
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.extrema import Extrema, extrema_of_graph, source_node
from toolkit.landmarks.graph import Workspace, grid_graph
from toolkit.landmarks.settings import LandmarkSettings
from toolkit.sensing.cloud import Cloud
from toolkit.testing.subjects import moving_clouds

PIXELS = (3_000, 6_000, 16_000)
REPEATS = 5
"""Samples per frame of the compiled code, whose times are short."""


@dataclass
class Samples:
    """Times in milliseconds and visited nodes of one frame."""

    graph: list[float]
    extrema: list[float]
    scipy: np.ndarray
    visited: np.ndarray
    nodes: int
    equal: bool


def restarted(matrix: csr_matrix, source: int, count: int) -> tuple[list[int], list[int], np.ndarray]:
    """Baseline: a whole Dijkstra per extremum, earlier ones joined to the source at no cost.

    Returns nodes, the nodes whose distance each pass changed, and the time of each pass (count,), milliseconds.
    """
    found: list[int] = []
    visited: list[int] = []
    times = np.zeros(count)
    before = np.full(matrix.shape[0], np.inf)
    for i in range(count):
        start = time.perf_counter()
        distances = dijkstra(matrix, indices=[source, *found], min_only=True)
        farthest = int(np.where(np.isfinite(distances), distances, -1.0).argmax())
        times[i] = 1e3 * (time.perf_counter() - start)
        if distances[farthest] <= 0:
            break
        visited.append(int((distances < before).sum()))
        found.append(farthest)
        before = distances
    return found, visited, times


def measure(cloud: Cloud, count: int, settings: LandmarkSettings, workspace: Workspace) -> Samples:
    """One frame by both ways, in turn."""
    centre = cloud_centre(cloud.points)
    graph_ms, extrema_ms = [], []
    for _ in range(REPEATS):
        start = time.perf_counter()
        graph = grid_graph(cloud, settings, workspace)
        source = source_node(graph, cloud.points, centre)
        middle = time.perf_counter()
        found: Extrema = extrema_of_graph(graph, cloud.points, count, source, workspace)
        end = time.perf_counter()
        graph_ms.append(1e3 * (middle - start))
        extrema_ms.append(1e3 * (end - middle))
    nodes, visited, scipy_ms = restarted(graph.matrix(), source, count)
    equal = found.nodes.tolist() == nodes and found.visited.tolist() == visited
    return Samples(graph_ms, extrema_ms, scipy_ms, found.visited.astype(float), len(cloud), equal)


def run(
    sizes: tuple[int, ...] = PIXELS, frames: int = 60, count: int = 20, settings: LandmarkSettings | None = None
) -> list[dict[str, Any]]:
    """Figures per number of nodes: a list of JSON-able dicts."""
    settings = settings or LandmarkSettings()
    rows = []
    for pixels in sizes:
        workspace = Workspace()
        clouds = moving_clouds(pixels, frames)
        measure(clouds[0], count, settings, workspace)  # compiles
        samples = [measure(cloud, count, settings, workspace) for cloud in clouds]
        graph = np.concatenate([s.graph for s in samples])
        extrema = np.concatenate([s.extrema for s in samples])
        scipy_total = np.array([s.scipy.sum() for s in samples])
        visited = np.array([s.visited for s in samples if len(s.visited) == count])
        rows.append(
            {
                "pixels": pixels,
                "frames": frames,
                "nodes": float(np.mean([s.nodes for s in samples])),
                "extrema": percentiles(extrema),
                "graph": percentiles(graph),
                "graph_and_extrema": percentiles(graph + extrema),
                "scipy_restarted": percentiles(scipy_total),
                "speed_up": float(np.median(scipy_total) / np.median(extrema)),
                "equal_to_scipy": float(np.mean([s.equal for s in samples])),
                "visited_mean": visited.mean(axis=0),
                "visited_std": visited.std(axis=0),
                "scipy_pass_ms": np.mean([s.scipy for s in samples], axis=0),
            }
        )
    return rows


def pass_times(pixels: int, frames: int, count: int, settings: LandmarkSettings) -> np.ndarray:
    """Mean time (count,) of each pass, milliseconds: the difference between finding n and n - 1 extrema."""
    workspace = Workspace()
    total = np.zeros(count)
    clouds = moving_clouds(pixels, frames)
    for cloud in clouds:
        graph = grid_graph(cloud, settings, workspace)
        source = source_node(graph, cloud.points, cloud_centre(cloud.points))
        for n in range(1, count + 1):
            samples = []
            for _ in range(REPEATS):
                start = time.perf_counter()
                extrema_of_graph(graph, cloud.points, n, source, workspace)
                samples.append(1e3 * (time.perf_counter() - start))
            total[n - 1] += min(samples)
    return np.diff(total / len(clouds), prepend=0.0)


def plot(row: dict[str, Any], pass_ms: np.ndarray, path: Path) -> None:
    """Fig. 5.9 from one row of `run`: visited nodes and time per extremum."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    numbers = np.arange(1, len(row["visited_mean"]) + 1)
    left.errorbar(numbers, row["visited_mean"], row["visited_std"], fmt="o-", ms=3, color="green", label="Algorithm 1")
    left.plot(numbers, np.full(len(numbers), row["visited_mean"][0]), "o-", ms=3, color="black", label="restarted")
    left.set_ylabel("nodes visited")
    right.plot(numbers, np.maximum(pass_ms, 1e-4), "o-", ms=3, color="green", label="Algorithm 1, compiled")
    right.plot(numbers, row["scipy_pass_ms"], "o-", ms=3, color="black", label="SciPy, restarted")
    right.set_yscale("log")
    right.set_ylabel("milliseconds")
    for axes in (left, right):
        axes.set_xlabel("geodesic extremum")
        axes.set_xticks([1, 5, 10, 15, 20])
        axes.legend(frameon=False)
    figure.suptitle(f"{row['nodes']:.0f} nodes on average, {row['frames']} frames")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=120)


def main() -> None:
    """Measure, print one line per number of nodes, write JSON and plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=60)
    arguments = parser.parse_args()
    settings = LandmarkSettings()
    pin_to_one_processor()
    rows = run(frames=arguments.frames, settings=settings)
    print(f"{'nodes':>7} {'20 extrema':>22} {'with graph':>22} {'SciPy restarted':>16} {'faster':>7} {'equal':>6}")
    for row in rows:
        ours, both = (row[key] for key in ("extrema", "graph_and_extrema"))
        print(
            f"{row['nodes']:7.0f} {ours['median_ms']:8.3f} ms, p99 {ours['p99_ms']:6.3f}"
            f" {both['median_ms']:8.3f} ms, p99 {both['p99_ms']:6.3f} {row['scipy_restarted']['median_ms']:13.1f} ms"
            f" {row['speed_up']:6.0f}x {row['equal_to_scipy']:6.0%}"
        )
    middle = rows[1]
    print("visited:", " ".join(f"{value:.0f}" for value in middle["visited_mean"]))
    path = save_figures("extrema", rows, asdict(settings) | {"frames": arguments.frames})
    picture = RESULTS / "extrema.png"
    plot(middle, pass_times(middle["pixels"], 10, 20, settings), picture)
    print(f"written: {path}, {picture}")


if __name__ == "__main__":
    main()
