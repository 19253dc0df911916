"""Searches of lookup and fit: `depthmocap bench lookup PART`, which is one of

- `extrema [--frames 60]`: twenty geodesic extrema of a frame of a rendered subject: time and visited nodes, against
  SciPy's Dijkstra restarted for each (Baak 2013, Fig. 5.9). What a visit is, and that the counts are those of
  Algorithm 1, is in `tests/test_landmarks_geodesic.py`.
- `queries DATABASE [--max-poses 25000]`: providers of the nearest-neighbour search at equal answers. A frame with clear
  extrema asks for one labeling, one whose extrema jump for 12 or more. Three kinds of frames: end effectors of database
  poses, moved by a Gaussian of 5 cm each (a good frame); the same, labelled at random (the wrong labelings of a frame);
  points anywhere in a box of the size of a person (the worst case). Every provider must find the same distances.
- `correspondences [--frames 20]`: the measured points nearest to the chosen vertices of a body, and the points of the
  drawn body nearest to samples of the frame, by the settings `grid` and `open3d` in turn. Both must find the same.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from benchmarks._record import percentiles, pin_to_one_processor, run_part, save_figures
from tests.support.subjects import LEVEL, camera_for, draw, moving_clouds, moving_poses
from toolkit.app.config import load_settings
from toolkit.body.shape import load_body
from toolkit.database.database import PoseDatabase
from toolkit.database.pose_search import SEARCHES
from toolkit.fitting.open3d_scene import SCENES
from toolkit.fitting.placed import Placer
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.extrema import Extrema, extrema_of_graph, source_node
from toolkit.landmarks.graph import Workspace, grid_graph
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.cloud import Cloud
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings

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
    """Return the baseline: a whole Dijkstra per extremum, earlier extrema joined to the source at no cost.

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
    """Measure one frame by both methods in turn."""
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


def extrema_rows(
    sizes: tuple[int, ...] = PIXELS, frames: int = 60, count: int = 20, settings: LandmarkSettings | None = None
) -> list[dict[str, Any]]:
    """Return figures per number of nodes: a list of JSON-able dicts."""
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


def extrema(parser: argparse.ArgumentParser) -> None:
    """Measure, print one line per number of nodes, write JSON and plot."""
    parser.add_argument("--frames", type=int, default=60)
    options = parser.parse_args()
    settings = LandmarkSettings()
    pin_to_one_processor()
    rows = extrema_rows(frames=options.frames, settings=settings)
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
    path = save_figures("extrema", rows, asdict(settings) | {"frames": options.frames})
    print("written:", path)


FRAMES, LABELINGS = 200, 12


def query_frames(database: PoseDatabase, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return queries (FRAMES, LABELINGS, 15) of each kind."""
    shape = (FRAMES, LABELINGS, 5, 3)
    rows = rng.integers(0, len(database), shape[0])
    near = database.features[rows].reshape(FRAMES, 1, 5, 3) + rng.normal(0.0, 0.05, (FRAMES, 1, 5, 3))
    near = np.broadcast_to(near, shape)
    shuffled = rng.permuted(np.broadcast_to(np.arange(5), shape[:3]), axis=2)
    anywhere = rng.uniform([-0.9, -1.1, -0.9], [0.9, 0.9, 0.9], shape)
    kinds = {"near": near, "labelled at random": np.take_along_axis(near, shuffled[..., None], 2), "anywhere": anywhere}
    return {name: queries.reshape(FRAMES, LABELINGS, 15).astype(np.float32) for name, queries in kinds.items()}


def asked(database: PoseDatabase, queries: np.ndarray, neighbours: int) -> tuple[np.ndarray, np.ndarray]:
    """Return seconds of each frame's query (F,) and the distances (F, M, K); a first query builds the index."""
    database.query(queries[0], neighbours)
    seconds, found = [], []
    for frame in queries:
        start = time.perf_counter()
        distances, _ = database.query(frame, neighbours)
        seconds.append(time.perf_counter() - start)
        found.append(distances)
    return np.array(seconds), np.array(found)


def queries_of_providers(parser: argparse.ArgumentParser) -> None:
    """Parse the command line, measure, print and store the figures."""
    parser.add_argument("database", type=Path)
    parser.add_argument("--max-poses", type=int, default=25_000)
    parser.add_argument("--neighbours", type=int, default=10)
    options = parser.parse_args()

    database = PoseDatabase.load(options.database)
    database = database.limited(min(options.max_poses, len(database)))
    figures = []
    for kind, queries in query_frames(database, np.random.default_rng(0)).items():
        reference, _ = database.query(queries.reshape(-1, 15), options.neighbours)
        for (name, search), count in product(SEARCHES.items(), (1, LABELINGS)):
            seconds, distances = asked(replace(database, search=search), queries[:, :count], options.neighbours)
            expected = reference.reshape(FRAMES, LABELINGS, -1)[:, :count]
            entry = {
                "frames": kind,
                "search": name,
                "labelings": count,
                "median_ms": float(1000 * np.median(seconds)),
                "worst_ms": float(1000 * np.max(seconds)),
                "largest_difference_m": float(np.abs(distances - expected).max()),
            }
            figures.append(entry)
            print(
                "  ".join(f"{value:.2g}" if isinstance(value, float) else f"{value!s:18}" for value in entry.values())
            )
    settings = {**vars(options), "poses": len(database)}
    print(save_figures("lookup", figures, settings))


def correspondences(parser: argparse.ArgumentParser) -> None:
    """Measure both searches in turn, print and store the figures."""
    parser.add_argument("--frames", type=int, default=20)
    options = parser.parse_args()
    pin_to_one_processor()
    settings, body, figures = load_settings(HybridSettings, "baak2013").fitting, load_body("neutral"), []
    for pixels in PIXELS:
        camera, rng = camera_for(pixels), np.random.default_rng(0)
        placer, poses = Placer(body, camera, LEVEL), moving_poses(options.frames, rng)
        times: dict[str, list[np.ndarray]] = {name: [] for name in SCENES}
        equal = True
        for i, pose in enumerate(poses):
            cloud = Cloud.from_depth(draw(body, pose, camera, rng), camera, LEVEL)
            placed = placer.place(body, poses[max(i - 1, 0)])
            placed.drawn  # noqa: B018  # drawn for both
            found = []
            for name, kind in SCENES.items():
                rounds = []
                for _ in range(REPEATS):  # the first call compiles; the minimum counts
                    scene, nearest = kind(cloud, np.zeros((0, 3)), 400), np.full(placed.chosen_points.shape, np.nan)
                    marks = [time.perf_counter()]
                    scene.medians(placed.chosen_points[:1], np.ones(1, dtype=np.bool_), settings.reach, 1, nearest[:1])
                    marks.append(time.perf_counter())
                    scene.medians(placed.chosen_points, placer.front, settings.reach, settings.neighbours, nearest)
                    marks.append(time.perf_counter())
                    drawn = scene.nearest_drawn(placed, scene.samples, settings.reach)
                    marks.append(time.perf_counter())
                    rounds.append(1e3 * np.diff(marks))
                times[name].append(np.min(rounds, axis=0))
                found.append((nearest[placer.front], *drawn))
            equal &= all(np.array_equal(a, b) for a, b in zip(*found, strict=True))
        for name, rows in times.items():
            build, medians, back = np.median(rows, axis=0)
            entry = {
                "search": name, "pixels": pixels, "build_ms": build, "chosen_5_ms": medians, "cloud_to_body_ms": back,
                "equal": equal,
            }  # fmt: skip
            figures.append(entry)
            print("  ".join(f"{v:.3f}" if isinstance(v, float) else f"{v!s:8}" for v in entry.values()))
    print(save_figures("correspondences", figures, vars(options)))


def main() -> None:
    """Run the named part."""
    parts = {"extrema": extrema, "queries": queries_of_providers, "correspondences": correspondences}
    run_part(__doc__, parts)


if __name__ == "__main__":
    main()
