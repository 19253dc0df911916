"""The whole frame against the plain pipeline: the same algorithm from SciPy's Dijkstra, SciPy's kd-tree and NumPy.

    python -m benchmarks.plain_pipeline DATABASE [RECORDING ...] [--frames 150]

Both trackers get the same frames in turn and follow their own past. Plain are the landmarks, the correspondences, the
solver, the drawn body and the lookup; cleaning, the joint regressor and the arms' chains of balls are the compiled ones
in both. Without a
recording a rendered subject is tracked at 3,000, 6,000 and 16,000 foreground pixels. Times leave out the first frames,
in which code is compiled and the subject's shape is learnt.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._plain_fitting import PlainObjective, PlainPlacer, PlainScene, plain_refiner
from benchmarks._plain_landmarks import plain_centre, plain_extrema, plain_graph, plain_source
from benchmarks._record import save_figures
from benchmarks._timing import percentiles, pin_to_one_processor
from toolkit.body.body import Body
from toolkit.database.database import PoseDatabase
from toolkit.fitting.scene import Scene
from toolkit.hybrid.settings import HybridSettings
from toolkit.hybrid.tracker import HybridTracker
from toolkit.landmarks.extrema import Extrema
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.recording import Recording
from toolkit.testing.searches import ScipySearch
from toolkit.testing.subjects import write_recording
from toolkit.tracking.follower import Follower
from toolkit.tracking.observation import Observation, Observer
from toolkit.tracking.solo import Solo

SIZES = (3_000, 6_000, 16_000)
WARM_UP = 50
"""Frames without times: the shape is learnt from 45."""


class PlainObservation(Observation):
    """An observation whose landmarks come from SciPy and NumPy."""

    @cached_property
    def centre(self) -> np.ndarray:
        """See `Observation.centre`."""
        return plain_centre(self.cloud.points, self._state.centre, self.observer.landmarks, self.scale)

    @cached_property
    def extrema(self) -> Extrema:
        """See `Observation.extrema`."""
        landmarks, points = self.observer.landmarks, self.cloud.points
        matrix, largest = plain_graph(self.cloud, landmarks)
        source = plain_source(points, largest, self.centre, landmarks, self.scale)
        return plain_extrema(matrix, points, source, self.observer.extrema)

    @cached_property
    def scene(self) -> Scene:
        """See `Observation.scene`."""
        extrema = self.extrema.points.astype(np.float64)
        marks = {"unobserved": self.unobserved, "cut": self.cut, "withheld": self.withheld}
        return PlainScene(self.cloud, extrema, self.observer.samples, self.evidence, **marks)


class PlainObserver(Observer):
    """Looks at sightings by SciPy and NumPy."""

    kind = PlainObservation


class PlainTracker(HybridTracker):
    """The hybrid tracker, from NumPy and SciPy alone; the body is learnt by the compiled code, the same for both."""

    def __init__(self, database: PoseDatabase, settings: HybridSettings | None = None) -> None:
        super().__init__(replace(database, search=ScipySearch), settings)

    def follower(self, camera: Camera, level_rotation: np.ndarray, body: Body | None = None) -> Follower:
        """See `Tracker.follower`."""
        compiled = super().follower(camera, level_rotation, body)
        fitting, objective = self.settings.fitting, compiled.objective
        placer = PlainPlacer.like(objective.placer)
        return self.assembled(
            PlainObjective(placer, fitting, objective.pose_terms),
            plain_refiner(placer, fitting, objective.pose_terms),
            PlainObserver(**vars(compiled.observer)),
            level_rotation,
            compiled.state,
        )


def compare(recording: Recording, database: PoseDatabase, settings: HybridSettings, frames: int) -> dict[str, Any]:
    """Figures of one recording: times of both trackers and how far apart their joints are."""
    trackers = (HybridTracker(database, settings), PlainTracker(database, settings))
    people = [Solo(tracker, recording) for tracker in trackers]
    pixels, results = [], []
    for i in range(min(frames, len(recording))):
        depth = recording.depth(i)
        pixels.append(int((depth > 0).sum()))
        results.append([person.step(depth, float(recording.timestamps[i])) for person in people])
    stage_ms = np.array([[result.stage_ms for result in pair] for pair in results])[min(WARM_UP, len(results) // 2) :]
    joints = np.array([[result.joints for result in pair] for pair in results], dtype=np.float64)
    apart = 1000.0 * np.linalg.norm(joints[:, 0] - joints[:, 1], axis=2).max(axis=1)
    total = stage_ms.sum(axis=2)
    return {
        "recording": recording.name,
        "frames": len(results),
        "pixels": float(np.mean(pixels)),
        "compiled": percentiles(total[:, 0]),
        "plain": percentiles(total[:, 1]),
        "faster": float(np.median(total[:, 1]) / np.median(total[:, 0])),
        "stages_ms": {
            name: np.round(np.median(stage_ms[:, :, s], axis=0), 3).tolist()
            for s, name in enumerate(trackers[0].stage_names)
        },
        "apart_mm": {
            "median": float(np.median(apart)),
            "p99": float(np.percentile(apart, 99)),
            "max": float(apart.max()),
        },
        "within_1_mm": float((apart < 1.0).mean()),
        "equal_sources": float(np.mean([a.source == b.source for a, b in results])),
    }


@contextmanager
def rendered(frames: int) -> Iterator[list[Recording]]:
    """Recordings of a rendered subject, one per size."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"rendered_{size}.npz" for size in SIZES]
        for path, size in zip(paths, SIZES, strict=True):
            write_recording(path, size, frames)
        yield [open_recording(path) for path in paths]


def main() -> None:
    """Track with both, print one line per recording, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("database", type=Path)
    parser.add_argument("recordings", type=Path, nargs="*")
    parser.add_argument("--frames", type=int, default=150)
    parser.add_argument("--max-poses", type=int, default=25_000)
    options = parser.parse_args()
    pin_to_one_processor()
    database = PoseDatabase.load(options.database)
    database = database.limited(min(options.max_poses, len(database)))
    settings = HybridSettings()
    if options.recordings:
        rows = [compare(open_recording(p), database, settings, options.frames) for p in options.recordings]
    else:
        with rendered(options.frames) as recordings:
            rows = [compare(recording, database, settings, options.frames) for recording in recordings]
    print(f"{'recording':<20} {'pixels':>7} {'compiled':>22} {'plain':>10} {'faster':>7} {'apart: median, max':>20}")
    for row in rows:
        print(
            f"{row['recording']:<20} {row['pixels']:7.0f}"
            f" {row['compiled']['median_ms']:8.2f} ms, p99 {row['compiled']['p99_ms']:6.2f}"
            f" {row['plain']['median_ms']:7.1f} ms {row['faster']:6.1f}x"
            f" {row['apart_mm']['median']:9.4f}, {row['apart_mm']['max']:.3f} mm"
        )
    print("written:", save_figures("plain_pipeline", rows, asdict(settings) | {"poses": len(database)}))


if __name__ == "__main__":
    main()
