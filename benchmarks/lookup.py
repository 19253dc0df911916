"""Providers of the nearest-neighbour search at equal answers: `depthmocap bench lookup DATABASE [--max-poses 25000]`.

A frame with clear extrema asks for one labeling, one whose extrema jump for 12 or more. Three kinds of frames: end
effectors of database poses, moved by a Gaussian of 5 cm each (a good frame); the same, labelled at random (the wrong
labelings of a frame); points anywhere in a box of the size of a person (the worst case). Every provider must find the
same distances.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks._record import save_figures
from toolkit.database.database import PoseDatabase
from toolkit.database.search import LeafSearch
from toolkit.testing.searches import Open3DSearch, ScipySearch

FRAMES, LABELINGS = 200, 12


def frames(database: PoseDatabase, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Queries (FRAMES, LABELINGS, 15) of each kind."""
    shape = (FRAMES, LABELINGS, 5, 3)
    rows = rng.integers(0, len(database), shape[0])
    near = database.features[rows].reshape(FRAMES, 1, 5, 3) + rng.normal(0.0, 0.05, (FRAMES, 1, 5, 3))
    near = np.broadcast_to(near, shape)
    shuffled = rng.permuted(np.broadcast_to(np.arange(5), shape[:3]), axis=2)
    anywhere = rng.uniform([-0.9, -1.1, -0.9], [0.9, 0.9, 0.9], shape)
    kinds = {"near": near, "labelled at random": np.take_along_axis(near, shuffled[..., None], 2), "anywhere": anywhere}
    return {name: queries.reshape(FRAMES, LABELINGS, 15).astype(np.float32) for name, queries in kinds.items()}


def timed(database: PoseDatabase, queries: np.ndarray, neighbours: int) -> tuple[np.ndarray, np.ndarray]:
    """Seconds of each frame's query (F,) and the distances (F, M, K); a first query builds the index."""
    database.query(queries[0], neighbours)
    seconds, found = [], []
    for frame in queries:
        start = time.perf_counter()
        distances, _ = database.query(frame, neighbours)
        seconds.append(time.perf_counter() - start)
        found.append(distances)
    return np.array(seconds), np.array(found)


def main() -> None:
    """Parse the command line, measure, print and store the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("database", type=Path)
    parser.add_argument("--max-poses", type=int, default=25_000)
    parser.add_argument("--neighbours", type=int, default=10)
    options = parser.parse_args()

    database = PoseDatabase.load(options.database)
    database = database.limited(min(options.max_poses, len(database)))
    figures = []
    for kind, queries in frames(database, np.random.default_rng(0)).items():
        reference, _ = database.query(queries.reshape(-1, 15), options.neighbours)
        for kind_of_search, count in product((LeafSearch, Open3DSearch, ScipySearch), (1, LABELINGS)):
            seconds, distances = timed(replace(database, search=kind_of_search), queries[:, :count], options.neighbours)
            expected = reference.reshape(FRAMES, LABELINGS, -1)[:, :count]
            entry = {
                "frames": kind,
                "provider": kind_of_search.__name__,
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


if __name__ == "__main__":
    main()
