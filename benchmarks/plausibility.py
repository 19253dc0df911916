"""Counts of wrong inputs that are named, of plausible recordings that are doubted, and of attempts at the limits.

python -m benchmarks.plausibility faults [--every 6]    # needs the data of utd-mhad, msr-action3d and the rooms
python -m benchmarks.plausibility limits [--frames 20000]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import run_part, save_figures
from toolkit.database.database import PoseDatabase
from toolkit.database.default import DEFAULT_DATABASE
from toolkit.io.errors import DepthMocapError
from toolkit.people.image_rotation import quarter_turns
from toolkit.people.plausibility import plausibility
from toolkit.recordings.opening import open_recording, recording_of
from toolkit.recordings.writer import RecordingWriter
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording

KINECT = (525.0, 525.0, 319.5, 239.5)
FRAMES = 12
"""Frames of each recording that are changed in memory."""


def _recordings(every: int) -> list[tuple[Path, dict[str, Any], bool]]:
    """Return recordings of others with their reader options, and True if people are segmented."""
    data = Path(os.environ["DEPTHMOCAP_DATA"])
    found: list[tuple[Path, dict[str, Any], bool]] = []
    for name in ("utd_mhad", "msr_action3d"):
        found += [(path, {}, True) for path in sorted((data / "depth" / name).glob("*_depth.mat"))[::every]]
    rooms = [path.parent for path in sorted((data / "rooms").glob("*/depth"))]
    return found + [(path, {"intrinsics": KINECT}, False) for path in rooms[:: max(1, every // 8)]]


def _scaled(metres: float) -> Callable[[np.ndarray, Camera], tuple[np.ndarray, Camera]]:
    return lambda depth, camera: (np.minimum(np.rint(depth * (0.001 / metres)), 64000).astype(np.uint16), camera)


def _turned(turns: int) -> Callable[[np.ndarray, Camera], tuple[np.ndarray, Camera]]:
    return lambda depth, camera: (np.ascontiguousarray(np.rot90(depth, -turns, (1, 2))), camera.rotated(turns))


def _lens(factor: float) -> Callable[[np.ndarray, Camera], tuple[np.ndarray, Camera]]:
    def change(depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, Camera]:
        fx, fy, cx, cy = (factor * camera.intrinsics).tolist()
        return depth, Camera(fx, fy, cx, cy, camera.width, camera.height)

    return change


def _exchanged(depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, Camera]:
    return depth, Camera(camera.fx, camera.fy, camera.cy, camera.cx, camera.width, camera.height)


FAULTS: dict[str, Callable[[np.ndarray, Camera], tuple[np.ndarray, Camera]]] = {
    "none": lambda depth, camera: (depth, camera),
    "centimetres": _scaled(0.01),
    "inches": _scaled(0.0254),
    "1/5000 m": _scaled(0.0002),
    "1/4 mm": _scaled(0.00025),
    "halved": _scaled(0.002),
    "doubled": _scaled(0.0005),
    "turned by 90 degrees": _turned(1),
    "upside down": _turned(2),
    "turned by 270 degrees": _turned(3),
    "intrinsics of twice the size": _lens(2.0),
    "intrinsics of half the size": _lens(0.5),
    "cx and cy exchanged": _exchanged,
}


def faults(parser: argparse.ArgumentParser) -> None:
    """Count the named faults by kind, of segmented people and of rooms."""
    parser.add_argument("--every", type=int, default=6)
    arguments = parser.parse_args()
    classifier = PoseDatabase.load(DEFAULT_DATABASE).regressor
    counts: dict[str, dict[str, list[int]]] = {}
    for path, options, cut_out in _recordings(arguments.every):
        recording = open_recording(path, **options)
        numbers = np.linspace(0, len(recording) - 1, min(FRAMES, len(recording))).astype(int)
        depth, camera = np.stack([recording.depth(int(i)) for i in numbers]), recording.camera.undistorted()
        for name, change in FAULTS.items():
            group = counts.setdefault(name, {}).setdefault("cut out" if cut_out else "room", [0, 0])
            group[0] += _is_named(*change(depth, camera), classifier)
            group[1] += 1
        print(path.name, flush=True)
    for name, groups in counts.items():
        print(name, groups)
    print(save_figures("plausibility_faults", counts, vars(arguments)))


def _is_named(depth: np.ndarray, camera: Camera, classifier: Any) -> bool:
    try:
        recording = recording_of(depth, intrinsics=tuple(camera.intrinsics), frame_rate=30.0)
        return bool(quarter_turns(recording, classifier) or plausibility(recording, classifier))
    except DepthMocapError:
        return True


def limits(parser: argparse.ArgumentParser) -> None:
    """Read a long recording, and run commands with closed streams, an unusable temporary folder and bounds checks."""
    parser.add_argument("--frames", type=int, default=20_000)
    arguments = parser.parse_args()
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        recording = _long(Path(folder) / "long.npz", arguments.frames)
        start, count = time.perf_counter(), sum(1 for _ in recording.stream())
        figures["stream"] = {"frames": count, "expected": arguments.frames, "seconds": time.perf_counter() - start}
        short = _long(Path(folder) / "short.npz", 3).path
        for name, redirection, environment in (
            ("info", "", {}),
            ("info, closed standard error", "2>&-", {}),
            ("info, closed standard output", ">&-", {}),
            ("info, both closed", ">&- 2>&-", {}),
            ("info, broken pipe", "| true", {}),
            ("info, bounds checks", "", {"NUMBA_BOUNDSCHECK": "1"}),
            ("info, unusable temporary folder", "", {"TMPDIR": "/dev/full"}),
        ):
            picture = Path(folder) / "picture.png"
            picture.unlink(missing_ok=True)
            command = (
                f"{sys.executable} -m depthmocap info {short} --output {picture} {redirection}; exit ${{PIPESTATUS[0]}}"
            )
            done = subprocess.run(["bash", "-c", command], env={**os.environ, **environment}, capture_output=True)
            figures[name] = {"exit code": done.returncode, "picture written": picture.exists()}
            print(name, figures[name], flush=True)
    print(save_figures("plausibility_limits", figures, vars(arguments)))


def _long(path: Path, frames: int) -> Recording:
    camera = Camera(100.0, 100.0, 39.5, 29.5, 80, 60)
    depth = np.zeros(camera.shape, dtype=np.uint16)
    depth[10:50, 30:50] = 2500
    with RecordingWriter(path, camera, up_camera=(0.0, -1.0, 0.0)) as writer:
        for i in range(frames):
            writer.append(depth, i / 30.0)
    return open_recording(path)


def main() -> None:
    """Run one part."""
    warnings.simplefilter("ignore")
    run_part(__doc__, {"faults": faults, "limits": limits})


if __name__ == "__main__":
    main()
