"""How our joints differ from a Kinect SDK's, joint by joint: `depthmocap bench kinect_offsets --database all.npz`.

Every `--stride`-th recording of UTD-MHAD and MSR Action3D (Kinect v1, the SDK's skeletons) is tracked. For each joint
the mean offset from the SDK's place to ours in the frame of the torso (left, up, forwards), the mean distance, what is
left of it once the offset is taken away, and the share within 100 mm. The SDK's skeleton is a reference and no truth.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from toolkit import skeleton
from toolkit.evaluation.agreement import torso_frames
from toolkit.pipeline import load_tracker
from toolkit.pipeline.run import track_recording
from toolkit.recordings.opening import open_recording
from toolkit.testing.suite import ROOT, WORK
from toolkit.track import TRACK_FILE, TRACKED, Track

DEPTH = ROOT.parent / "shared" / "data" / "depth"
SETS = ("utd_mhad", "msr_action3d")


def offsets_of(recording: Path, run: Path, database: Path) -> np.ndarray:
    """From the SDK's joints to ours in the torso's frame: float64 (F, 20, 3), metres, of the frames that both have."""
    opened = open_recording(recording)
    if not (run / TRACK_FILE).exists():
        track_recording(opened, load_tracker("hybrid", {}, database=database), run, resume=True)
    track, reference = Track.load(run), opened.reference_joints
    known = (track.state == TRACKED) & np.isfinite(reference).all(axis=(1, 2))
    ours = track.joints[known].astype(np.float64)
    return np.einsum("tca,tjc->tja", torso_frames(ours), ours - reference[known])


def table(differences: np.ndarray) -> dict[str, dict[str, Any]]:
    """Figures by joint of differences (F, 20, 3)."""
    mean = differences.mean(axis=0)
    distance = np.linalg.norm(differences, axis=2)
    rest = np.linalg.norm(differences - mean, axis=2)
    return {
        name: {
            "left_up_forwards_mm": (1000.0 * mean[j]).round(0).tolist(),
            "distance_mm": round(1000.0 * float(distance[:, j].mean()), 1),
            "without_offset_mm": round(1000.0 * float(rest[:, j].mean()), 1),
            "within_100_mm": round(float((distance[:, j] < 0.1).mean()), 3),
        }
        for j, name in enumerate(skeleton.REPORTED)
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--database", type=Path, required=True)
    parser.add_argument("--stride", type=int, default=6)
    parser.add_argument("--work", type=Path, default=WORK / "kinect_offsets")
    options = parser.parse_args()
    figures: dict[str, Any] = {}
    for name in SETS:
        files = sorted((DEPTH / name).glob("*_depth.mat"))[:: options.stride]
        rows = [offsets_of(file, options.work / name / file.stem, options.database) for file in files]
        figures[name] = {"recordings": len(rows), "frames": sum(map(len, rows)), "joints": table(np.concatenate(rows))}
        for joint, values in figures[name]["joints"].items():
            print(f"{name:13} {joint:15}", values, flush=True)
    print(save_figures("kinect_offsets", figures, vars(options)))


if __name__ == "__main__":
    main()
