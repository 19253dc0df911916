"""Another program on the frames of the upper bodies: `depthmocap bench upper_peer [--split report] [--command ...]`.

By default Skeltrack, by its GObject bindings for `python3` (`apt install gir1.2-skeltrack-0.1 python3-gi python3-numpy`
where a distribution still has them). `--command` is any other program: it is called with two paths, an NPZ with `depth`
uint16 (T, H, W), millimetres, 0 where the person is not, and a JSON file to write: a list with one object a frame, from
each of the seven joints to its place in the image in pixels, or null. Errors are those of `bench upper` in pixels; a
joint that is missing counts as one not yet found. `--real` takes the stills instead of the takes.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from benchmarks.upper import DEPTH, STILL_CAMERA, annotated
from toolkit.errors import UsageError
from toolkit.evaluation import upper
from toolkit.people.lone import LonePerson
from toolkit.recordings.opening import open_recording
from toolkit.sensing.recording import Recording
from toolkit.sensing.settings import SensingSettings
from toolkit.testing.scenes import record_scene
from toolkit.testing.suite import WORK
from toolkit.testing.upper import GROUPS, upper_scenes

SKELTRACK = f"python3 {shlex.quote(str(Path(__file__).parent / '_skeltrack.py'))}"
MISSING = 2 * upper.BAD
"""Pixels that a missing joint counts."""


def ask(command: str, depth: np.ndarray) -> np.ndarray:
    """Places in the image (T, 7, 2), pixels, that a program finds in `depth` (T, H, W); NaN where it finds none.

    Raises
    ------
    UsageError
        The program is not there, fails, or writes something else.
    """
    with tempfile.TemporaryDirectory() as folder:
        frames, joints = Path(folder) / "frames.npz", Path(folder) / "joints.json"
        np.savez(frames, depth=depth)
        try:
            done = subprocess.run([*shlex.split(command), frames, joints], capture_output=True, text=True, check=False)
        except OSError as error:
            raise UsageError(f"{command!r} cannot be started: {error.strerror}; install it or name another") from None
        if done.returncode != 0:
            said = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
            raise UsageError(f"{command!r} failed: {said}")
        found = json.loads(joints.read_text(encoding="utf-8"))
    if len(found) != len(depth):
        raise UsageError(f"{command!r} answered {len(found)} of {len(depth)} frames; it has to answer each")
    places = [[frame.get(name) or (np.nan, np.nan) for name in upper.JOINTS] for frame in found]
    return np.array(places, dtype=np.float64)


def cut_out(recording: Recording, frames: int, **sensing: str) -> np.ndarray:
    """The person of a recording, uint16 (T, H, W), millimetres."""
    settings = SensingSettings(**sensing)  # type: ignore[arg-type]
    finder = LonePerson(recording.camera, recording.background, settings, recording.up_camera)
    depth = []
    for i in range(min(frames, len(recording))):
        (sighting,) = finder.find(recording.depth(i), float(recording.timestamps[i]), {})
        depth.append((1000.0 * sighting.depth).astype(np.uint16))
    return np.array(depth)


def score(name: str, places: np.ndarray, truth: np.ndarray, width: int) -> upper.UpperScore:
    """Errors of places (T, 7, 2) against the truth (T, 7, 2), both in pixels of an image of this width."""
    away = np.linalg.norm(places - truth, axis=-1) * upper.COLUMNS / width
    pixels = np.minimum(np.where(np.isnan(away), MISSING, away), MISSING)
    return upper.UpperScore(name, pixels, np.full(pixels.shape, np.nan), ~np.isnan(away).all(axis=1))


def score_takes(command: str, recordings: Sequence[Recording], frames: int) -> list[upper.UpperScore]:
    """Scores of simulated takes."""
    scores = []
    for recording in recordings:
        depth = cut_out(recording, frames)
        joints = recording.joints[: len(depth), upper.ROWS].astype(np.float64)
        truth = recording.camera.project(joints.reshape(-1, 3)).reshape(*joints.shape[:2], 2)
        scores.append(score(recording.name, ask(command, depth), truth, recording.camera.width))
    return scores


def score_stills(command: str) -> list[upper.UpperScore]:
    """Scores of the stills."""
    scores = []
    for name, places in annotated("stills.json").items():
        recording = open_recording(DEPTH / "skeltrack" / f"depth-data-{name}", intrinsics=STILL_CAMERA)
        found = ask(command, cut_out(recording, 1, subject="nearest"))
        scores.append(score(name, found, places[None], recording.camera.width))
    return scores


def main() -> None:
    """Ask, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--command", default=SKELTRACK)
    parser.add_argument("--groups", default=",".join(GROUPS))
    parser.add_argument("--takes", type=int, help="at most so many of each group")
    parser.add_argument("--frames", type=int, default=90, help="at most so many of each take")
    parser.add_argument("--real", action="store_true", help="the stills instead of the takes")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    if options.real:
        scores = score_stills(options.command)
    else:
        scenes = upper_scenes(options.split, tuple(options.groups.split(",")), options.takes)
        recordings = [open_recording(record_scene(scene, options.work, options.frames)) for scene in scenes]
        scores = score_takes(options.command, recordings, options.frames)
    figures: dict[str, Any] = {k: v for k, v in upper.upper_figures(scores).items() if k != "upper_mm"}
    figures["missing"] = float(np.mean([np.mean(s.pixels == MISSING) for s in scores]))
    print(f"px {figures['upper_px']:.1f}, hands {figures['hands_px']:.1f}, hands within {upper.FAR:.0f} px "
          f"{100 * figures['hands_near']:.0f} %, missing {100 * figures['missing']:.0f} %")  # fmt: skip
    stem = "upper_peer_real" if options.real else f"upper_peer_{options.split}"
    whole = options.real or (options.takes is None and options.frames >= 60 and options.groups == ",".join(GROUPS))
    print(
        "written:",
        save_figures(stem + ("" if whole else "_part"), figures, {"command": Path(options.command.split()[-1]).name}),
    )


if __name__ == "__main__":
    main()
