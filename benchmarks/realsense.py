"""A real clip in colour and depth: `depthmocap bench realsense [--rows swarm,hybrid] [--database POSES]`.

The RealSense clip among the shared recordings, 40 frames of two people in a room, one seated. Joints are found by the
network in the colour, of everybody, once (the pose model is needed); the swarm tracker, and the hybrid one beside it
with a database, follow with them. There is no truth: printed is how far the fitted joints lie from the detected ones in
the image, at the joint's distance.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._options import add_database_options, poses_of
from benchmarks._record import save_figures
from toolkit.config import parse_overrides
from toolkit.pipeline import load_tracker, track_recordings
from toolkit.pipeline.joints import JointChoice
from toolkit.pipeline.store_joints import store_joints
from toolkit.recordings.opening import open_recording
from toolkit.runs import load_people
from toolkit.sensing.joints2d import Joints2D
from toolkit.sensing.recording import Recording
from toolkit.testing.suite import ROOT
from toolkit.track import TRACKED, Track

CLIP = ROOT.parent / "shared" / "data" / "depth" / "realsense" / "images_n40"


def apart_mm(track: Track, recording: Recording) -> np.ndarray:
    """Distances (N,) of tracked joints from detected ones of whoever is nearest, millimetres in the image."""
    found = []
    camera = recording.camera
    frames = np.searchsorted(recording.timestamps, track.timestamps - 1e-6)
    for i, joints, state in zip(frames, track.joints, track.state, strict=True):
        if state != TRACKED:
            continue
        pixels = camera.project(joints)
        each = [_off(seen, pixels, (camera.fx, camera.fy), joints[:, 2]) for seen in recording.joints_2d(int(i))]
        if each := [off for off in each if len(off)]:
            found.append(min(each, key=lambda off: float(np.median(off))))
    return np.concatenate(found) if found else np.empty(0)


def _off(seen: Joints2D, pixels: np.ndarray, focal: tuple[float, float], z: np.ndarray) -> np.ndarray:
    sure = seen.sure
    return 1000.0 * np.hypot(*((seen.pixels - pixels)[sure] / focal).T) * z[sure]


def main() -> None:
    """Track, compare, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clip", type=Path, default=CLIP)
    parser.add_argument("--rows", default="swarm", help="names of settings files, with commas between them")
    add_database_options(parser)
    options = parser.parse_args()
    stored = options.work / "joints" / "realsense.npz"
    stored.unlink(missing_ok=True)
    recording = store_joints(open_recording(options.clip), stored, JointChoice("colour"), people=None)
    figures: dict[str, Any] = {}
    for row in options.rows.split(","):
        run = options.work / "runs" / "realsense" / row
        shutil.rmtree(run, ignore_errors=True)
        database = None if row in ("swarm", "qammaz") else poses_of(options)
        tracker = load_tracker(row, parse_overrides(options.set), database=database)
        track_recordings([stored], tracker, run, people=None)
        for person in load_people(run):
            track = Track.load(run / person.folder)
            off = apart_mm(track, recording)
            figures[f"{row}, {person.folder}"] = {
                "tracked_frames": int((track.state == TRACKED).sum()),
                "stature_m": person.stature,
                "apart_median_mm": float(np.median(off)) if len(off) else None,
            }
            print(f"{row}, {person.folder}:", figures[f"{row}, {person.folder}"], flush=True)
    print("written:", save_figures("realsense", figures, {"rows": options.rows, "set": options.set}))


if __name__ == "__main__":
    main()
