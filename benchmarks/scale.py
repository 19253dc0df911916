"""How much is too much: `depthmocap bench scale PART`, which is one of

- `recordings --database POSES [--recordings 24] [--runs 1000 10000]`: tracks recordings of UTD-MHAD by `depthmocap
  track --workers`, as a batch is tracked, and says how many hours of a core a thousand of them take. Then evaluates as
  many runs as are asked for, each in a process of its own: copies of eight runs of UTD-MHAD's length over small depth
  images, compared with another system's skeleton, which takes the most memory.
- `index DATA [--hours 45] [--workers 2] [--index FILE]`: an index of motion capture. The shared mocap is 11 minutes;
  the rest is made from it, by mirroring, playing it at 0.7 to 1.4 times its speed, and giving its actors other
  proportions (bone lengths between 0.85 and 1.15 of theirs, along each of six chains). A quarter and all of it are
  indexed: features, building, writing, opening, the first search by keyframes, which looks through the lists, later
  ones, searches by example and how many of their first 20 hits an exhaustive search has too, adding and removing a
  document. Documents repeat: of every motion there are some 200 variations, which crowd the first places as no real
  collection does. Times are of processors; those of the features add up over the workers. `--index` keeps the index,
  and where there is one already only searches it.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._keyframe_corpus import load_examples, load_filler
from benchmarks._record import run_part, save_figures
from benchmarks._rows import add_database_options, poses_of
from benchmarks._stiffness import placed_query
from benchmarks.real import RECORDINGS
from toolkit import skeleton
from toolkit.body.shape import load_body
from toolkit.evaluation.evaluate import evaluate_runs
from toolkit.files import sha256_of
from toolkit.pipeline.manifest import DONE, MANIFEST_FILE
from toolkit.recordings.writer import save_recording
from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion
from toolkit.retrieval.features.relational import FeatureMatrix, relational_features
from toolkit.retrieval.index.keyframe_index import KeyframeIndex
from toolkit.retrieval.keyframes.query import KeyframeQuery, keyframes_of_column
from toolkit.retrieval.search.example import Example, coarse_hits, search_example
from toolkit.retrieval.search.find import find
from toolkit.sensing.camera import Camera
from toolkit.track import TRACKED, FrameResult, RunInfo, TrackWriter

FRAMES = 67
"""Of a recording: the mean of UTD-MHAD."""
TURN = np.diag([1.0, -1.0, -1.0])
"""R_level_camera of a camera that looks horizontally."""


def measured_batch(recordings: list[Path], database: Path, workers: int, runs: Path) -> dict[str, Any]:
    """Figures of a batch that is tracked as it is typed."""
    command = [sys.executable, "-m", "toolkit.cli.main", "track", *map(str, recordings), "--database", str(database)]
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([*command, "--output", str(runs), "--workers", str(workers)], check=True, capture_output=True)
    after, seconds = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - start
    rows = [json.loads(line) for line in (runs / MANIFEST_FILE).read_text().splitlines()[1:]]
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    frames = sum(row["frames"] for row in rows)
    return {
        "recordings": len(rows),
        "done": sum(row["status"] == DONE for row in rows),
        "frames": frames,
        "workers": workers,
        "seconds": seconds,
        "processor_seconds": processor,
        "core_hours_per_1000_recordings": processor / len(rows) / 3.6,
        "core_hours_per_million_frames": processor / frames / 3.6e-3,
        "peak_megabytes_of_a_process": after.ru_maxrss / 1024,
    }


def make_runs(folder: Path, count: int) -> None:
    """So many run folders of eight recordings of eight people."""
    rng, body = np.random.default_rng(0), load_body("neutral")
    poses = np.zeros((FRAMES, skeleton.POSE_SIZE))
    poses[:, :3] = 0.0, 0.0, -3.0
    poses[:, 6:] = rng.normal(0.0, 0.1, (FRAMES, skeleton.POSE_SIZE - 6))
    joints = (body.joint_positions(poses) @ TURN).astype(np.float32)
    depth = np.where(rng.random((FRAMES, 24, 32)) < 0.3, 3000, 0).astype(np.uint16)
    for person in range(8):
        recording = folder / f"a1_s{person}_t1.npz"
        other = joints + rng.normal(0.0, 0.03, joints.shape)
        save_recording(
            recording, depth=depth, camera=Camera(30.0, 30.0, 15.5, 11.5, 32, 24), timestamps=np.arange(FRAMES) / 15,
            reference_joints=other,
        )  # fmt: skip
        run = folder / "runs" / f"{person:05}"
        writer = TrackWriter(run, ("fit",), ("local",))
        for i, pose in enumerate(poses):
            ones = np.ones(20, np.float32)
            writer.append(FrameResult(pose, joints[i], ones, TRACKED, 0, np.ones(1, np.float32)), i / 15)
        writer.finish()
        RunInfo(
            str(recording), sha256_of(recording), {}, skeleton.fingerprint(), [0.0], 1.0, "", TURN.ravel().tolist(),
            {}, "0",
        ).save(run)  # fmt: skip
    for number in range(8, count):
        copy = folder / "runs" / f"{number:05}"
        copy.mkdir()
        for file in (folder / "runs" / f"{number % 8:05}").iterdir():
            os.link(file, copy / file.name)


def measured_evaluation(folder: Path) -> dict[str, Any]:
    """Figures of one evaluation, in a process of its own."""
    start = time.perf_counter()
    table = evaluate_runs([folder / "runs"], surface=False)
    return {
        "runs": len(table),
        "seconds": time.perf_counter() - start,
        "peak_megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "agreement": table.mean().agreement_offsets,
    }


def recordings(parser: argparse.ArgumentParser) -> None:
    """Parse the command line, measure, print and store the figures."""
    add_database_options(parser)
    parser.add_argument("--recordings", type=int, default=24, help="of UTD-MHAD, evenly spaced")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--runs", type=int, nargs="+", default=[1000, 10_000])
    options = parser.parse_args()
    figures: dict[str, Any] = {"evaluate": []}
    with tempfile.TemporaryDirectory() as name:
        paths = sorted(RECORDINGS.glob("*_depth.mat"))
        chosen = [paths[i] for i in np.unique(np.linspace(0, len(paths) - 1, options.recordings).astype(int))]
        figures["batch"] = measured_batch(chosen, poses_of(options), options.workers, Path(name) / "batch")
        print(figures["batch"], flush=True)
        for count in options.runs:
            folder = Path(name) / f"of {count}"
            folder.mkdir()
            make_runs(folder, count)
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
                figures["evaluate"].append(process.submit(measured_evaluation, folder).result())
            print(figures["evaluate"][-1], flush=True)
            shutil.rmtree(folder)
    print(save_figures("scale", figures, vars(options)))


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
    queries = [_two_moments(f) for f in wanted]
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


def motion_index(parser: argparse.ArgumentParser) -> None:
    """Parse the command line, measure, print and store the figures."""
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


def _two_moments(features: FeatureMatrix) -> KeyframeQuery:
    """A query of two frames of an example, a third and two thirds through it."""
    moments = [len(features) // 3, 2 * len(features) // 3]
    columns = [(n, keyframes_of_column(features.values[:, n].astype(np.int8))) for n in moments]
    return placed_query(columns, len(features), 0.5)


def _warm(wanted: list[FeatureMatrix]) -> tuple[KeyframeIndex, Any]:
    """A small index and a query, so that compiled code is loaded before anything is timed."""
    return KeyframeIndex.build(replace(f, name=str(i)) for i, f in enumerate(wanted)), _two_moments(wanted[0])


def main() -> None:
    """Run the part that is asked for."""
    run_part(__doc__, {"recordings": recordings, "index": motion_index})


if __name__ == "__main__":
    main()
