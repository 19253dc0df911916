"""How fine to sample: `depthmocap bench threshold MOCAP --held-out _bk_`.

A database is built from the mocap without the held-out files for each threshold of Eq. 5.1, with and without mirror
images. Poses of the held-out files are drawn as depth clouds seen from the front and turned by 40 degrees to either
side. Their true end effectors, about the centre and facing found on the cloud, ask for one pose. Figures: mean joint
error of the pose of the database that is best of all, which no lookup can beat, and of the pose that the lookup
finds; time of 12 queries.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from database_builder.build import build_database
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.database.canonical import canonicalise, feature_vectors, place
from toolkit.database.database import PoseDatabase
from toolkit.database.origin import View, observed_offsets
from toolkit.mocap.clip import PoseClip
from toolkit.mocap.read import find_clips, read_clip
from toolkit.mocap.retarget import retarget

THRESHOLDS = (0.03, 0.024, 0.018, 0.014, 0.011, 0.009, 0.007, 0.0055)
YAWS = (-40.0, 0.0, 40.0)
ASKED = 600
"""Held-out poses."""


def joint_errors(joints: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Mean distance of the 20 joints (..., 20, 3), millimetres."""
    return 1000 * np.linalg.norm(joints - others, axis=-1).mean(axis=-1)


def figures_of(database: PoseDatabase, body: Body, poses: np.ndarray, seen: dict[float, np.ndarray]) -> dict[str, Any]:
    """Errors of the best and of the found pose for canonical `poses` (N, P) with the offsets seen from each yaw."""
    joints = body.joint_positions(poses)
    best = [joint_errors(database.joints, one).min() for one in joints]
    found = []
    for offsets in seen.values():
        features = feature_vectors(body.end_effector_positions(poses), offsets)
        rows = database.query(features, 1)[1][:, 0]
        answers = place(database.poses[rows], database.offsets[rows], offsets[:, :3], offsets[:, 3])
        found.append(joint_errors(body.joint_positions(answers), joints))
    times = []
    for start in range(0, len(features) - 12, 12):
        begin = time.perf_counter()
        database.query(features[start : start + 12], 5)
        times.append(time.perf_counter() - begin)
    return {
        "poses": len(database),
        "best_mm": float(np.mean(best)),
        "found_mm": float(np.mean(found)),
        "found_90_mm": float(np.quantile(found, 0.9)),
        "query_ms": float(1000 * np.median(times)),
    }


def main() -> None:
    """Parse the command line, measure, print and store the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mocap", type=Path)
    parser.add_argument("--held-out", default="_bk_", help="files whose name contains this are asked for, not stored")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()

    body = load_body("neutral")
    files = find_clips(options.mocap)
    clips = [retarget(read_clip(path), body) for path in files]
    stored = [clip for path, clip in zip(files, clips, strict=True) if options.held_out not in path.name]
    asked = np.concatenate(
        [clip.poses for path, clip in zip(files, clips, strict=True) if options.held_out in path.name]
    )
    poses = canonicalise(asked[np.linspace(0, len(asked) - 1, ASKED).astype(np.int64)])[0]
    seen = {yaw: observed_offsets(body, poses, View(yaw=np.radians(yaw))) for yaw in YAWS}
    table = [
        {
            "threshold": threshold,
            "mirror": mirror,
            **figures_of(built(stored, threshold, mirror, options.workers), body, poses, seen),
        }
        for mirror in (False, True)
        for threshold in THRESHOLDS
    ]
    for entry in table:
        print("  ".join(f"{key} {value:<8.4g}" for key, value in entry.items()))
    print(
        save_figures(
            "threshold", table, {**vars(options), "stored_clips": len(stored), "asked_poses": ASKED, "yaws": YAWS}
        )
    )


def built(clips: list[PoseClip], threshold: float, mirror: bool, workers: int) -> PoseDatabase:
    """Database of the clips."""
    with tempfile.TemporaryDirectory() as folder:
        return build_database(
            clips,
            Path(folder) / "poses.npz",
            threshold=threshold,
            mirror=mirror,
            seated=False,
            parts=None,
            workers=workers,
        ).database


if __name__ == "__main__":
    main()
