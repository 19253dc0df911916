"""Tracks that inertial sensors guide: `depthmocap bench fused [--split report] [--sequences NAME] [--takes NAME]`.

The sequences of `toolkit/testing/labelled.py`, and takes of the simulated suite by name, with sensors on forearms,
shins and pelvis, whose calibration is wrong by 3 degrees and whose clock is off by 10 ms. Each is tracked without and
with them: mean error over joints and frames, of joints that the camera sees, and of hidden ones.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks._options import add_database_options, poses_of
from benchmarks._record import save_figures
from benchmarks._sensors import levelled, wrong_calibration
from benchmarks.stabilise import FIGURES, figures_of, visible
from toolkit.body.body import Body
from toolkit.body.shape import subject_body
from toolkit.database.database import PoseDatabase
from toolkit.fitting.orientation import OrientationSettings
from toolkit.hybrid.tracker import HybridTracker
from toolkit.mocap.clip import PoseClip
from toolkit.pipeline import track_recording
from toolkit.recordings.opening import open_recording
from toolkit.simulation.inertial import NOISE, simulate_sensors
from toolkit.simulation.sensors import make_sensor
from toolkit.simulation.simulate import simulate_recording
from toolkit.testing.labelled import SEQUENCES, record_sequence
from toolkit.testing.suite import RATE, distance_needed, performed, takes
from toolkit.track import Track
from toolkit.tracking.guide import Guide, InertialGuide

CARRIED = ("left_forearm", "right_forearm", "left_shin", "right_shin", "pelvis")


class Scene(NamedTuple):
    """A recording and what happens in it: the clip, whose body, and how the person stands to the camera, degrees."""

    path: Path
    clip: PoseClip
    body: Body
    yaw: float


def scenes(options: argparse.Namespace) -> Iterator[tuple[str, Scene]]:
    """The recordings that were asked for, made if they are not there yet."""
    for sequence in SEQUENCES:
        if options.sequences is None or sequence.name in options.sequences:
            path, done = record_sequence(sequence, options.split, options.work)
            yield sequence.name, Scene(path, done.clip, done.body, sequence.yaw)
    for take in takes("tune") + takes("report"):
        if take.name in (options.takes or ()):
            body = subject_body(take.body, seed=take.seed)
            clip, path = performed(take, body, options.frames), options.work / "fused" / f"{take.name}.npz"
            if not path.exists():
                distance = take.room * distance_needed(take, body, clip, make_sensor(take.sensor).camera)
                simulate_recording(
                    clip, path, body=body, sensor=take.sensor, distance=distance, height=take.height, yaw=take.yaw,
                    seed=take.seed, furnished=take.furnished,
                )  # fmt: skip
            yield take.name, Scene(path, clip, body, take.yaw)


def guide_of(scene: Scene, options: argparse.Namespace, seed: int) -> InertialGuide:
    """Sensors as somebody would carry them, calibrated nearly right."""
    simulated = simulate_sensors(scene.body, levelled(scene.clip.poses, scene.yaw), RATE, CARRIED, NOISE["mtx"], seed)
    rng = np.random.default_rng(seed)
    calibration = wrong_calibration(simulated, "take", options.degrees, 0.001 * options.lag, rng)
    return InertialGuide(simulated.sensors, calibration, "take", replace(OrientationSettings(), weight=options.weight))


def tracked(scene: Scene, poses: PoseDatabase, guide: Guide | None, run: Path) -> list[float]:
    """`FIGURES` of the recording, tracked anew."""
    shutil.rmtree(run, ignore_errors=True)
    recording = open_recording(scene.path)
    track_recording(recording, HybridTracker(poses, guide=guide), run, warm_up=False)
    return figures_of(Track.load(run), np.asarray(recording.joints), visible(recording))


def main() -> None:
    """Simulate, track twice, compare, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--split", choices=("tune", "report"), default="tune", help="report is not for tuning")
    parser.add_argument("--sequences", nargs="*", help="names of some; all")
    parser.add_argument("--takes", nargs="*", help="names of takes of the suite beside them")
    parser.add_argument("--frames", type=int, default=130, help="at most so many of each take")
    parser.add_argument("--degrees", type=float, default=3.0, help="by which calibrations are wrong")
    parser.add_argument("--lag", type=float, default=10.0, help="milliseconds by which the clock is off")
    parser.add_argument("--weight", type=float, default=OrientationSettings.weight, help="of a sensor")
    add_database_options(parser)
    options = parser.parse_args()
    poses, rows = PoseDatabase.load(poses_of(options)), {}
    for seed, (name, scene) in enumerate(scenes(options)):
        run = options.work / "fused" / "runs" / scene.path.stem
        alone = tracked(scene, poses, None, run)
        fused = tracked(scene, poses, guide_of(scene, options, seed), run)
        rows[name] = {"alone": dict(zip(FIGURES, alone, strict=True)), "fused": dict(zip(FIGURES, fused, strict=True))}
        print(name, " | ".join(" ".join(f"{value:.2f}" if value <= 1 else f"{value:.1f}" for value in figures)
                               for figures in (alone, fused)), flush=True)  # fmt: skip
    table: dict[str, Any] = {
        kind: {name: float(np.mean([row[kind][name] for row in rows.values()])) for name in FIGURES}
        for kind in ("alone", "fused")
    }
    for kind, figures in table.items():
        print(kind, figures)
    settings = {"degrees": options.degrees, "lag": options.lag, "weight": options.weight, **asdict(NOISE["mtx"])}
    name = "_".join(["fused", options.split, *["part"] * (options.sequences is not None)])
    print("written:", save_figures(name, {"recordings": rows, **table}, settings))


if __name__ == "__main__":
    main()
