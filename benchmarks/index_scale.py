"""An index of 45 hours: `depthmocap bench index_scale DATA [--hours 45] [--workers 2] [--index FILE]`.

The shared mocap is 11 minutes; the rest is made from it, by mirroring, playing it at 0.7 to 1.4 times its speed, and
giving its actors other proportions (bone lengths between 0.85 and 1.15 of theirs, along each of six chains). A quarter
and all of it are indexed: features (reading the files not included), building, writing, opening, the first search
by keyframes, which looks through the lists, later ones, searches by example and how many of their first 20 hits an
exhaustive search has too, adding and removing a document. Documents repeat: of every motion there are some 200
variations, which crowd the first places as no real collection does. Times are of processors, so that what else runs
does not count; those of the features add up over the workers. `--index` keeps the index, and where there is one already
only searches it, which is soon done on a machine that has nothing else to do.
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._keyframe_corpus import load_examples, load_filler
from benchmarks._record import save_figures
from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.automatic import ChoiceSettings, choose_query, template_of
from toolkit.retrieval.search.example import Example, coarse_hits, search_example
from toolkit.retrieval.search.find import find

CHAINS = (
    ("root", "belly", "chest", "neck", "head", "headtop"),
    *(
        (start, *(f"{side}_{joint}" for joint in joints))
        for side in ("left", "right")
        for start, joints in (
            ("neck", ("clavicle", "shoulder", "elbow", "wrist", "fingers")),
            ("root", ("hip", "knee", "ankle", "toes")),
        )
    ),
)
PROPORTIONS, SPEEDS = (0.85, 1.15), (0.7, 1.4)
QUERIES = 10
SHARES = (0.25, 1.0)
"""Of the hours, to see how everything grows."""


def varied(motion: Motion, seed: int) -> Motion:
    """Somebody else's performance, as described above."""
    rng = np.random.default_rng(seed)
    place = {name: number for number, name in enumerate(NAMED_JOINTS)}
    joints = motion.joints.copy()
    for chain in CHAINS:
        factor = rng.uniform(*PROPORTIONS)
        for parent, child in zip(chain[:-1], chain[1:], strict=True):
            step = motion.joints[:, place[child]] - motion.joints[:, place[parent]]
            joints[:, place[child]] = joints[:, place[parent]] + factor * step
    changed = replace(motion, joints=joints).at_speed(float(rng.uniform(*SPEEDS)))
    changed = changed.mirrored() if rng.random() < 0.5 else changed
    return replace(changed, name=f"{motion.name} {seed}")


_motions: list[Motion] = []


def _keep(motions: list[Motion]) -> None:
    """Keep the motions in a worker process, so that they are sent once."""
    _motions[:] = motions


def _made(seed: int) -> FeatureMatrix:
    motion = _motions[seed % len(_motions)]
    return relational_features(motion if seed < len(_motions) else varied(motion, seed))


def documents(motions: list[Motion], hours: float, workers: int) -> Iterator[FeatureMatrix]:
    """As many as needed."""
    seconds, seed = 0.0, 0
    with ProcessPoolExecutor(workers, initializer=_keep, initargs=(motions,)) as pool:
        while seconds < 3600.0 * hours:
            for features in pool.map(_made, range(seed, seed + 1000), chunksize=50):
                if seconds < 3600.0 * hours:
                    yield features
                    seconds += features.duration
            seed += 1000


def milliseconds(run: Callable[[], object], repeats: int = 1) -> float:
    """Least processor time."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        run()
        times.append(1000.0 * (time.process_time() - begin))
    return min(times)


def made_figures(made: list[FeatureMatrix], path: Path) -> dict[str, Any]:
    """What it takes to build an index of some documents."""
    begin = time.process_time()
    built = KeyframeIndex.build(made)
    middle = time.process_time()
    built.save(path)
    return {
        "hours": built.duration / 3600.0, "documents": len(built), "build_seconds": middle - begin,
        "save_seconds": time.process_time() - middle, "megabytes": path.stat().st_size / 1e6,
    }  # fmt: skip


def changed_figures(path: Path, document: FeatureMatrix) -> dict[str, float]:
    """What it takes to add a document to an index and to remove it."""
    index, new = KeyframeIndex.open(path), replace(document, name="one more")
    added = milliseconds(lambda: index.added([new]).save(path)) / 1000.0
    index = KeyframeIndex.open(path)
    removed = milliseconds(lambda: index.without(["one more"]).save(path)) / 1000.0
    return {"add_and_save_seconds": added, "remove_and_save_seconds": removed}


def searched_figures(path: Path, wanted: list[FeatureMatrix]) -> dict[str, Any]:
    """What it takes to open an index and to search it."""
    figures: dict[str, Any] = {"open_milliseconds": milliseconds(lambda: KeyframeIndex.open(path), 3)}
    index = KeyframeIndex.open(path)
    queries = [choose_query(template_of(f), ChoiceSettings(least_score=0.3, most=1)) for f in wanted]
    examples = [Example.of(features) for features in wanted]
    figures["first_keyframe_search_milliseconds"] = milliseconds(lambda: find(index, queries[0]))
    search_example(index, examples[0], 20)
    by_keyframes = [milliseconds(lambda q=query: find(index, q), 3) for query in queries]  # type: ignore[misc]
    by_example = [milliseconds(lambda e=example: search_example(index, e, 20), 3) for example in examples]  # type: ignore[misc]
    for name, times in (("keyframe_search", by_keyframes), ("by_example", by_example)):
        figures[f"{name}_milliseconds"] = {
            "mean": float(np.mean(times)), "median": float(np.median(times)), "worst": max(times),
        }  # fmt: skip
    same = [shared_hits(index, example) for example in examples]
    figures["hits_of_an_exhaustive_search"] = {"mean": float(np.mean(same)), "worst": min(same)}
    return figures


def shared_hits(index: KeyframeIndex, example: Example, count: int = 20) -> float:
    """Share of the first hits of a comparison with every coarse column that overlap one of the search's by half."""
    thorough = coarse_hits(index, example, count, everywhere=True)
    found = coarse_hits(index, example, count)
    hit = [
        any(d == e and 2 * (min(b, y) - max(a, x) + 1) >= min(b - a, y - x) + 1 for e, x, y in found)
        for d, a, b in thorough
    ]
    return float(np.mean(hit))


def main() -> None:
    """Parse the command line, measure, print and store the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="the shared data folder")
    parser.add_argument("--hours", type=float, default=45.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0, help="of the examples")
    parser.add_argument("--index", type=Path, help="where the index stays; one that is there is searched only")
    options = parser.parse_args()

    motions = [*load_filler(options.data), *(example.motion for example in load_examples(options.data))]
    rng = np.random.default_rng(options.seed)
    wanted = [relational_features(varied(motions[i], 10**6 + int(i))) for i in rng.integers(50, len(motions), QUERIES)]
    wanted = [features for features in wanted if len(features) >= 20]
    find(*_warm(wanted))
    if options.index is not None and options.index.exists():
        figures = searched_figures(options.index, wanted)
        print(json.dumps(figures))
        print(save_figures("index_scale_searched", figures, {"seed": options.seed}))
        return
    begin = time.perf_counter()
    made = list(documents(motions, options.hours, options.workers))
    usage = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    figures = {
        "features": {
            "wall_seconds": time.perf_counter() - begin,
            "processor_seconds": sum(u.ru_utime + u.ru_stime for u in usage), "workers": options.workers,
        }
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = options.index or Path(folder) / "motions.index"
        for share in SHARES:
            part = made[: max(1, round(share * len(made)))]
            figures[f"{share:g}"] = (
                made_figures(part, path) | searched_figures(path, wanted) | changed_figures(path, wanted[0])
            )
            print(json.dumps(figures[f"{share:g}"]), flush=True)
    figures["peak_megabytes"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(json.dumps({name: figures[name] for name in ("features", "peak_megabytes")}))
    print(save_figures("index_scale", figures, {"hours": options.hours, "workers": options.workers}))


def _warm(wanted: list[FeatureMatrix]) -> tuple[KeyframeIndex, Any]:
    """A small index and a query, so that compiled code is loaded before anything is timed."""
    query = choose_query(template_of(wanted[0]), ChoiceSettings(least_score=0.3, most=1))
    return KeyframeIndex.build(replace(f, name=str(i)) for i, f in enumerate(wanted)), query


if __name__ == "__main__":
    main()
