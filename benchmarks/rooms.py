"""People in real rooms, annotated by hand: `depthmocap bench rooms [--names um,filinha] [--database POSES]`.

Six sequences of a structured-light camera: a classroom, five people in a row, two views of people who cross a
laboratory. Each is tracked with `--people all` and no other option, and scored by `_room_scores.py` against
`annotations/rooms/`. The figures hold the counts of each sequence, and of all, with a line for each miss, false
person and switch. `--joints colour` registers the colour to the depth by the calibration below.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _room_scores
from benchmarks._record import benchmark, script
from benchmarks._rows import DATABASE, poses_of, track_each
from tests.support.suite import ROOT
from toolkit.app.config import parse_overrides
from toolkit.app.pipeline import TrackerRecipe
from toolkit.app.pipeline.joint_choice import JointChoice
from toolkit.datasets.folder import data_folder
from toolkit.recordings.opening import open_recording
from toolkit.recordings.readers.mkv import FactoryCalibration, registered
from toolkit.recordings.writer import RecordingWriter
from toolkit.sensing.camera import Camera
from toolkit.tracking.tracker_protocol import Tracker

ROOMS = data_folder() / "rooms"
ANNOTATIONS = ROOT / "benchmarks" / "annotations" / "rooms"
RATES = {"filinha": 5.0, "um": 3.5, "lab1_cam1": 1.7, "lab1_cam2": 1.7, "lab2_cam1": 1.7, "lab2_cam2": 1.7}
"""Frame rates of the sequences, within a quarter."""
OFFSETS = {
    **dict.fromkeys(("filinha", "um"), (9.0, 2.5)),
    **dict.fromkeys(("lab1_cam1", "lab2_cam1"), (10.4, -4.8)),
    **dict.fromkeys(("lab1_cam2", "lab2_cam2"), (5.4, 1.4)),
}
"""Sequence -> offset of the colour's edges from the depth's after calibration, pixels."""
COLOR_CAMERA = (534.286, 534.745, 309.567, 243.072)
COLOR_SHIFT = (-0.0263, 0.0003, -0.0008)
"""Intrinsics of the colour camera, and metres from depth to colour; both cameras have the same orientation."""
FILLED = 41
"""Side of the window from which an unmeasured pixel takes its depth, so that the network sees no black holes."""


def annotations_of(name: str) -> dict[str, Any]:
    """Return the annotations of a sequence."""
    truth: dict[str, Any] = json.loads((ANNOTATIONS / f"{name}.json").read_text(encoding="utf-8"))
    return truth


def in_colour(name: str, rooms: Path, work: Path) -> Path:
    """Return a sequence with its colour registered to the depth, as a recording in `work`, made if missing."""
    import cv2

    path = work / "rooms" / f"{name}_colour.npz"
    if path.exists():
        return path
    plain = open_recording(rooms / name, intrinsics=tuple(annotations_of(name)["intrinsics"]))
    (fx, fy, cx, cy), (right, down) = COLOR_CAMERA, OFFSETS[name]
    color_camera = Camera(fx, fy, cx + right, cy + down, plain.camera.width, plain.camera.height)
    lenses = FactoryCalibration(plain.camera, color_camera, np.eye(3), np.array(COLOR_SHIFT), np.eye(3))
    with RecordingWriter(path, plain.camera) as writer:
        for i in range(len(plain)):
            depth, color = plain.depth(i), plain.color(i)
            assert color is not None
            near, share = (cv2.blur(image.astype(np.float64), (FILLED, FILLED)) for image in (depth, depth > 0))
            filled = np.where(depth > 0, depth, near / np.maximum(share, 1e-6))
            writer.append(depth, i / RATES[name], color=registered(filled, color, lenses))
    return path


def track_rooms(
    names: Sequence[str], rooms: Path, work: Path, tracker: Tracker, joints: str = "none"
) -> tuple[dict[str, Path], dict[str, str]]:
    """Track the sequences in `rooms` by name; return run folders in `work`, and the reasons of failures."""
    runs: dict[Path, tuple[Path, dict[str, Any]]] = {}
    for name in names:
        run = work / "runs" / "rooms" / name
        if joints == "colour":
            runs[run] = in_colour(name, rooms, work), {}
        else:
            camera = annotations_of(name)["intrinsics"]
            runs[run] = rooms / name, {"intrinsics": tuple(camera), "frame_rate": RATES.get(name, 5.0)}
    failed = track_each(runs, tracker, people=None, joints=JointChoice(joints))
    return {run.name: run for run in runs}, {run.name: reason for run, reason in failed.items()}


@benchmark(
    DATABASE, rooms=ROOMS, names=",".join(path.stem for path in sorted(ANNOTATIONS.glob("*.json"))),
    joints=("none", "colour"),
)  # fmt: skip
def measured(options: argparse.Namespace) -> tuple[str, Any]:
    """Track and score the sequences."""
    tracker = TrackerRecipe(overrides=parse_overrides(options.set), database=poses_of(options)).build()
    runs, failed = track_rooms(options.names.split(","), options.rooms, options.work, tracker, options.joints)
    figures: dict[str, Any] = {}
    total: dict[str, Any] = {}
    for name, run in runs.items():
        events: list[str] = []
        counts = _room_scores.score(annotations_of(name), _room_scores.load_run(run) if run.is_dir() else [], events)
        figures[name] = {"counts": counts, "events": events}
        _room_scores.add(total, counts)
        print(name, *events, sep="\n  ")
    figures["all"] = {"counts": total, "failed": failed}
    return "rooms" + "_colour" * (options.joints == "colour"), figures


main = script(__name__, __doc__, measured)
