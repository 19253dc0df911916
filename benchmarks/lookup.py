"""Searches of lookup and fit: `depthmocap bench lookup PART`, which is one of

- `extrema [--frames 60]`: time of twenty geodesic extrema of a frame of a rendered subject. `tests/
  test_landmarks_geodesic.py` compares them with SciPy's Dijkstra restarted for each (Baak 2013, Fig. 5.9).
- `queries DATABASE`: the nearest-neighbour searches at equal answers, 12 labelings each, as in a frame whose extrema
  jump. Kinds of frames: end effectors of database poses, moved by a Gaussian of 5 cm each, labelled at random (the
  wrong labelings of a frame); points anywhere in a box of the size of a person (the worst case). Every search must find
  the same distances.
- `correspondences [--frames 20]`: the measured points nearest to the chosen vertices of a body, and the points of the
  drawn body nearest to samples of the frame, by the settings `grid` and `open3d` in turn. Both must find the same.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import benchmark, milliseconds_of, percentiles, pin_to_one_processor, script
from tests.support.subjects import LEVEL, camera_for, draw, moving_clouds, moving_poses
from toolkit.app.config import load_settings
from toolkit.body.shape import load_body
from toolkit.database.database import PoseDatabase
from toolkit.database.pose_search import SEARCHES
from toolkit.fitting.open3d_scene import SCENES
from toolkit.fitting.placed import PlacedBody, Placer
from toolkit.landmarks.centre import cloud_centre
from toolkit.landmarks.extrema import extrema_of_graph, source_node
from toolkit.landmarks.graph import Workspace, grid_graph
from toolkit.landmarks.landmark_settings import LandmarkSettings
from toolkit.sensing.cloud import Cloud
from toolkit.trackers.hybrid.hybrid_settings import HybridSettings

PIXELS = (3_000, 6_000, 16_000)
REPEATS = 5
"""Samples per frame of the compiled code, whose times are short."""
EXTREMA = 20


def timed(function: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    """Return the milliseconds of a call and its result."""
    start = time.perf_counter()
    result = function(*arguments)
    return 1e3 * (time.perf_counter() - start), result


def extrema_of(pixels: int, frames: int) -> dict[str, Any]:
    """Return times of the extrema."""
    settings, workspace, milliseconds = LandmarkSettings(), Workspace(), list[float]()
    for cloud in moving_clouds(pixels, frames):
        graph = grid_graph(cloud, settings, workspace)
        source = source_node(graph, cloud.points, cloud_centre(cloud.points))
        find = partial(extrema_of_graph, graph, cloud.points, EXTREMA, source, workspace)
        milliseconds += milliseconds_of(find, REPEATS)
    return {"pixels": pixels, "extrema": percentiles(milliseconds[REPEATS:])}


@benchmark(frames=60)
def extrema(options: argparse.Namespace) -> tuple[str, Any]:
    """Time the extrema of frames of several sizes."""
    pin_to_one_processor()
    return "extrema", [extrema_of(pixels, options.frames) for pixels in PIXELS]


FRAMES, LABELINGS, NEIGHBOURS, POSES = 200, 12, 10, 25_000


def query_frames(database: PoseDatabase, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return queries (FRAMES, LABELINGS, 15) of each kind."""
    shape = (FRAMES, LABELINGS, 5, 3)
    rows = rng.integers(0, len(database), shape[0])
    near = database.features[rows].reshape(FRAMES, 1, 5, 3) + rng.normal(0.0, 0.05, (FRAMES, 1, 5, 3))
    near = np.broadcast_to(near, shape)
    shuffled = rng.permuted(np.broadcast_to(np.arange(5), shape[:3]), axis=2)
    anywhere = rng.uniform([-0.9, -1.1, -0.9], [0.9, 0.9, 0.9], shape)
    kinds = {"labelled at random": np.take_along_axis(near, shuffled[..., None], 2), "anywhere": anywhere}
    return {name: queries.reshape(FRAMES, LABELINGS, 15).astype(np.float32) for name, queries in kinds.items()}


@benchmark(database=Path)
def queries_of_providers(options: argparse.Namespace) -> tuple[str, Any]:
    """Time all searches of the database."""
    database = PoseDatabase.load(options.database).limited(POSES)
    figures = []
    for kind, queries in query_frames(database, np.random.default_rng(0)).items():
        reference, _ = database.query(queries.reshape(-1, 15), NEIGHBOURS)
        for name in SEARCHES:
            query = replace(database, search=name).query
            query(queries[0], NEIGHBOURS)  # builds the index
            spent, found = zip(*(timed(query, frame, NEIGHBOURS) for frame in queries), strict=True)
            apart = float(np.abs(np.concatenate([distances for distances, _ in found]) - reference).max())
            times = {"median_ms": float(np.median(spent)), "worst_ms": float(np.max(spent))}
            figures.append({"frames": kind, "search": name, **times, "largest_difference_m": apart})
    return "lookup", figures


def search_times(kind: Any, cloud: Cloud, placed: PlacedBody) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Return milliseconds (3,) of tree, vertices to cloud, and cloud to body, and what was found."""
    settings, front = load_settings(HybridSettings, "baak2013").fitting, placed.placer.front
    points, reach, rounds = placed.chosen_points, settings.reach, []
    for _ in range(REPEATS):  # the first call compiles; the minimum counts
        scene, nearest = kind(cloud, np.zeros((0, 3)), 400), np.full(points.shape, np.nan)
        built, _ = timed(scene.medians, points[:1], np.ones(1, dtype=np.bool_), reach, 1, nearest[:1])
        chosen, _ = timed(scene.medians, points, front, reach, settings.neighbours, nearest)
        back, drawn = timed(scene.nearest_drawn, placed, scene.samples, reach)
        rounds.append((built, chosen, back))
    return np.min(rounds, axis=0), (nearest[front], *drawn)


@benchmark(frames=20)
def correspondences(options: argparse.Namespace) -> tuple[str, Any]:
    """Time both searches of correspondences in turn."""
    pin_to_one_processor()
    body, figures = load_body("neutral"), []
    for pixels in PIXELS:
        camera, rng = camera_for(pixels), np.random.default_rng(0)
        placer, poses = Placer(body, camera, LEVEL), moving_poses(options.frames, rng)
        times: dict[str, list[np.ndarray]] = {name: [] for name in SCENES}
        equal = True
        for i, pose in enumerate(poses):
            cloud = Cloud.from_depth(draw(body, pose, camera, rng), camera, LEVEL)
            placed = placer.place(body, poses[max(i - 1, 0)])
            placed.drawn  # noqa: B018  # drawn for both
            found = {name: search_times(kind, cloud, placed) for name, kind in SCENES.items()}
            for name, (spent, _) in found.items():
                times[name].append(spent)
            equal &= all(np.array_equal(a, b) for a, b in zip(*(points for _, points in found.values()), strict=True))
        for name, rows in times.items():
            columns = zip(("build_ms", "chosen_5_ms", "cloud_to_body_ms"), np.median(rows, axis=0), strict=True)
            figures.append({"search": name, "pixels": pixels, **dict(columns), "equal": equal})
    return "correspondences", figures


main = script(
    __name__, __doc__, {"extrema": extrema, "queries": queries_of_providers, "correspondences": correspondences}
)
