"""Image joints of the pose network: `depthmocap bench joints followed [--rows swarm,hybrid,not told]`.

The RealSense clip has 40 frames of two people in a room, one of them seated. The joints of all people are detected in
colour once; the swarm tracker and the hybrid tracker use them, and `not told` is the hybrid tracker without joints.
There is no truth: the figure is the image distance of fitted from detected joints, at the depth of the joint.
Needs the pose model (`depthmocap joints --fetch`).
"""

import argparse
import shutil
from typing import Any

import numpy as np

from benchmarks._record import benchmark, script
from benchmarks._rows import DATABASE, poses_of
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline import TrackerRecipe, track_recording
from toolkit.app.pipeline.image_joints import JointChoice, store_joints
from toolkit.datasets.folder import data_folder
from toolkit.recordings.opening import open_recording, open_upright
from toolkit.sensing.recording import Recording
from toolkit.tracks import TRACKED, Track
from toolkit.tracks.runs import load_people

CLIP = data_folder() / "depth" / "realsense" / "images_n40"


def apart_mm(track: Track, recording: Recording) -> np.ndarray:
    """Return distances (N,) of tracked joints from those detected for the nearest person, millimetres in the image."""
    found = []
    camera = recording.camera
    frames = np.searchsorted(recording.timestamps, track.timestamps - 1e-6)
    for i, joints, state in zip(frames, track.joints, track.state, strict=True):
        if state != TRACKED:
            continue
        pixels = camera.project(joints)
        each = []
        for seen in recording.joints_2d(int(i)):
            offsets = ((seen.pixels - pixels)[seen.sure] / (camera.fx, camera.fy)).T
            each.append(1000.0 * np.hypot(*offsets) * joints[seen.sure, 2])
        if each := [off for off in each if len(off)]:
            found.append(min(each, key=lambda off: float(np.median(off))))
    return np.concatenate(found) if found else np.empty(0)


@benchmark(DATABASE, rows="swarm,hybrid,not told")
def followed(options: argparse.Namespace) -> tuple[str, Any]:
    """Track the clip by each row (settings files, or `not told`), and compare with the detected joints."""
    stored = options.work / "joints" / "realsense.npz"
    stored.unlink(missing_ok=True)
    recording = store_joints(open_recording(CLIP), stored, JointChoice("colour"), people=None)
    figures: dict[str, Any] = {}
    for row in options.rows.split(","):
        run = options.work / "runs" / "realsense" / row
        shutil.rmtree(run, ignore_errors=True)
        config, joints = ("hybrid", JointChoice("none")) if row == "not told" else (row, JointChoice())
        database = None if row in ("swarm", "qammaz") else poses_of(options)
        tracker = TrackerRecipe(config, parse_overrides(options.set), database=database).build()
        track_recording(open_upright(stored), tracker, run, people=None, joints=joints)
        for person in load_people(run).people:
            track = Track.load(run / person.folder)
            off = apart_mm(track, recording)
            figures[f"{row}, {person.folder}"] = {"apart_median_mm": float(np.median(off)) if len(off) else None}
    return "realsense", figures


main = script(__name__, __doc__, {"followed": followed})
