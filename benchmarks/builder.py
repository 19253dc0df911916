"""Time and memory of a database build: `depthmocap bench builder MOCAP [--poses 200000] [--selected 25000]`.

The poses are those of the mocap folder, then their mirror images, then copies of both with every angle jittered by a
Gaussian of 0.05 rad, until there are enough. Reading and retargeting are timed apart, on the files as they are. A
part of the poses is also sampled by plain farthest-first, in NumPy, which must select the same poses in the same order.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from database_builder.build import build_database
from database_builder.sampling import farthest_first, pose_distance
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.database.canonical import canonicalise, mirrored
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.read import find_clips, read_clip
from toolkit.mocap.retarget import retarget

JITTER = 0.05
"""Radians, standard deviation."""
CLIP = 10_000
"""Frames of one clip: long for mocap."""
CHECKED_POSES, CHECKED_SELECTED = 40_000, 2_000


def corpus(folder: Path, count: int) -> list[PoseClip]:
    """`count` poses as clips: the mocap, its mirror images, jittered copies of both."""
    body, rng = load_body("neutral"), np.random.default_rng(0)
    clips = [retarget(read_clip(path), body) for path in find_clips(folder)]
    base = np.concatenate([clip.poses for clip in clips])
    base = np.concatenate([base, mirrored(base)])
    low, high = skeleton.POSE_LIMITS.T
    out = []
    for copy in range(-(-count // len(base))):
        poses = base[: count - copy * len(base)].copy()
        if copy:
            poses[:, 3:] += rng.normal(0.0, JITTER, poses[:, 3:].shape)
            poses = np.clip(poses, low, high)
        parts = np.array_split(poses, -(-len(poses) // CLIP))
        out += [PoseClip(f"copy {copy} part {i}", part, 120.0, "mirrored, jittered") for i, part in enumerate(parts)]
    return out


def plain_selection(joints: np.ndarray, count: int) -> np.ndarray:
    """Plain farthest-first over float32 (N, 60)."""
    selected = [0]
    nearest = np.sum((joints - joints[0]) ** 2, axis=1)
    while len(selected) < count:
        selected.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.sum((joints - joints[selected[-1]]) ** 2, axis=1))
    return np.array(selected)


def same_as_plain(clips: list[PoseClip]) -> tuple[bool, float]:
    """Whether a part of the poses is selected as plainly, and how many times faster, both on one thread."""
    poses = np.concatenate([clip.poses for clip in clips])
    poses = poses[:: max(1, len(poses) // CHECKED_POSES)]
    joints = load_body("neutral").joint_positions(canonicalise(poses)[0]).astype(np.float32).reshape(len(poses), -1)
    farthest_first(joints[:10])
    start = time.process_time()
    fast = farthest_first(joints, max_count=CHECKED_SELECTED)
    between = time.process_time()
    plain = plain_selection(joints, CHECKED_SELECTED)
    return bool(np.array_equal(fast, plain)), (time.process_time() - between) / (between - start)


def measured_build(poses: Path, output: Path, selected: int, workers: int) -> dict[str, Any]:
    """Figures of one build from the poses in a file; run in a process of its own, so that the memory is the build's."""
    with np.load(poses) as parts:
        clips = [PoseClip(name, part, 120.0, "mirrored, jittered") for name, part in parts.items()]
    start = time.perf_counter()
    report = build_database(
        clips, output, threshold=0.0, max_poses=selected, mirror=False, seated=False, parts=None, workers=workers
    )
    seconds = time.perf_counter() - start
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    joints = report.database.joints
    return {
        "poses_in": report.poses_read,
        "poses_out": len(report.database),
        "seconds": seconds,
        "seconds_by_stage": report.seconds,
        "processor_seconds": own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime,
        "peak_megabytes": (own.ru_maxrss + workers * children.ru_maxrss) / 1024,
        "file_megabytes": output.stat().st_size / 1e6,
        "distance_of_last_pose_mm": float(1000 * pose_distance(joints[:-1], joints[-1]).min()),
    }


def main() -> None:
    """Parse the command line, build, print and store the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mocap", type=Path, help="folder of BVH and AMC files")
    parser.add_argument("--poses", type=int, default=200_000)
    parser.add_argument("--selected", type=int, default=25_000)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        start = time.perf_counter()
        real = build_database(
            [options.mocap], folder / "real.npz", mirror=False, seated=False, parts=None, workers=options.workers
        )
        seconds = time.perf_counter() - start
        clips = corpus(options.mocap, options.poses)
        same, times = same_as_plain(clips)
        np.savez(folder / "corpus.npz", **{clip.name: clip.poses for clip in clips})
        del clips
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            build = pool.submit(
                measured_build, folder / "corpus.npz", folder / "poses.npz", options.selected, options.workers
            ).result()
    figures = {
        **build,
        "same_as_plain": same,
        "times_faster_than_plain": times,
        "mocap_files": {
            "poses_in": real.poses_read, "poses_out": len(real.database), "seconds": seconds,
            "seconds_by_stage": real.seconds,
        },
    }  # fmt: skip
    for key, value in figures.items():
        print(f"{key:28} {value}")
    print(save_figures(f"builder_{options.poses}", figures, {**vars(options), "jitter_radians": JITTER}))


if __name__ == "__main__":
    main()
