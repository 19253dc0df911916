"""Bodies from scans: `depthmocap bench scan [--names MS_1,FS_1]`.

The subjects of the four sequences (`toolkit/testing/sequences.py`) stand in a T-pose before a simulated Kinect, turned
to their left by 0, 90, 180 and 270 degrees. Their bodies are scanned and compared with what they are, in the rest pose:
how far the skin lies from the subject's along its normals, and the joints, millimetres. Beside them the neutral body
scaled to the subject's stature.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._record import save_figures
from benchmarks._sequences import TURNS, view_of
from toolkit.body.body import Body
from toolkit.body.shape import load_body
from toolkit.pipeline.scan import scan_recordings
from toolkit.testing.sequences import SEQUENCES, sequence_body
from toolkit.testing.suite import WORK


def skin_mm(body: Body, truth: Body) -> np.ndarray:
    """Distances along the normal from each vertex of a body to the nearest vertex of the truth, millimetres."""
    nearest = cKDTree(truth.vertices).query(body.vertices)[1]
    off = (body.vertices - truth.vertices[nearest]) * truth.normals[nearest]
    return 1000.0 * np.abs(off.sum(axis=1))


def row(body: Body, truth: Body) -> dict[str, float]:
    """Errors of a body."""
    skin = skin_mm(body, truth)
    joints = 1000.0 * np.linalg.norm(body.joints - truth.joints, axis=1)
    return {
        "skin_median_mm": float(np.median(skin)),
        "skin_p90_mm": float(np.percentile(skin, 90)),
        "joints_median_mm": float(np.median(joints)),
        "joints_worst_mm": float(joints.max()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--names", default=",".join(SEQUENCES), help="of the sequences")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    figures = {}
    for name in options.names.split(","):
        truth = sequence_body(name)
        views = [view_of(name, degrees, options.work) for degrees in TURNS]
        begun = time.process_time()
        scan = scan_recordings(views)
        seconds = time.process_time() - begun
        neutral = load_body("neutral")
        figures[name] = {
            "scanned": row(scan.body, truth) | {"seen": float(scan.seen.mean()), "processor_seconds": seconds},
            "neutral": row(neutral.scaled(truth.height / neutral.height), truth),
        }
        for what, found in figures[name].items():
            print(f"{name} {what:8}", ", ".join(f"{key} {value:.2f}" for key, value in found.items()), flush=True)
    print(save_figures("scan", figures, vars(options)))


if __name__ == "__main__":
    main()
