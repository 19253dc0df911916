"""Frames a second of the particle filter as a whole: `depthmocap bench upper_speed [--counts 64,192,256]`.

One take of each group, its depth doubled to 640x480 as a Kinect gives it, by `configs/lopez2011.yaml` on one core in a
single thread. Times are those of the whole step from the depth image to the row, cutting out the person included and
reading the file not; frames in which a first pose is looked for are counted apart. The first frames, in which code is
compiled, are left out. To quote them, ask for a core: `chrt -f 10 taskset -c 1 depthmocap bench upper_speed`.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._record import save_figures
from benchmarks._timing import percentiles, pin_to_one_processor
from toolkit.lopez2011.tracker import DETECTED, ParticleTracker
from toolkit.pipeline.trackers import load_tracker
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import RecordingWriter
from toolkit.sensing.recording import Recording
from toolkit.testing.scenes import record_scene
from toolkit.testing.suite import WORK
from toolkit.testing.upper import GROUPS, upper_scenes
from toolkit.tracking.solo import Solo

WARM_UP = 5
"""Frames of a take that are left out."""
HEADINGS = ("count", "frames", "median ms", "99 % ms", "frames/s", "first ms")


def doubled(recording: Recording, path: Path, frames: int) -> Recording:
    """The first frames of a recording with every pixel four times."""

    def large(image: np.ndarray) -> np.ndarray:
        return np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)

    background = None if recording.background is None else large(recording.background)
    with RecordingWriter(
        path, recording.camera.scaled(2.0), background=background, up_camera=recording.up_camera
    ) as writer:
        for i in range(min(frames, len(recording))):
            writer.append(large(recording.depth(i)), float(recording.timestamps[i]))
    return open_recording(path)


def times(tracker: ParticleTracker, recording: Recording) -> tuple[list[float], list[float], np.ndarray]:
    """Milliseconds of frames that were followed, and of first ones; and the mean of each stage of the former."""
    solo, followed, first, stages = Solo(tracker, recording), [], [], []
    for i in range(len(recording)):
        depth = recording.depth(i)
        fresh = solo.follower.state.previous is None  # type: ignore[attr-defined]
        begun = time.perf_counter()
        result = solo.step(depth, float(recording.timestamps[i]))
        spent = 1000.0 * (time.perf_counter() - begun)
        if fresh or result.source == DETECTED:
            first.append(spent)
        elif i >= WARM_UP:
            followed.append(spent)
            stages.append(result.stage_ms)
    return followed, first[1:] or first, np.mean(stages, axis=0)


def main() -> None:
    """Time, print, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--counts", default="64,192,256", help="particles in each of the three layers")
    parser.add_argument("--groups", default=",".join(GROUPS))
    parser.add_argument("--frames", type=int, default=90, help="length of each take, at most")
    parser.add_argument("--first", type=int, default=40, help="frames of each take that are timed, at most")
    parser.add_argument("--work", type=Path, default=WORK)
    options = parser.parse_args()
    pin_to_one_processor()
    scenes = upper_scenes("tune", tuple(options.groups.split(",")), 1)
    recordings = []
    for scene in scenes:
        recording = open_recording(record_scene(scene, options.work, options.frames))
        recordings.append(doubled(recording, options.work / f"doubled_{scene.name}.npz", options.first))
    figures: dict[str, Any] = {}
    print(*(f"{heading:>10}" for heading in HEADINGS))
    for count in map(int, options.counts.split(",")):
        tracker = load_tracker("particles", {"particles.count": count, "refined": False})
        assert isinstance(tracker, ParticleTracker)
        measured = [times(tracker, recording) for recording in recordings]
        followed = [value for own, _, _ in measured for value in own]
        values: dict[str, Any] = percentiles(followed)
        values |= {"frames": len(followed), "frame_rate": 1000.0 / values["median_ms"]}
        values["first_ms"] = float(np.median([value for _, first, _ in measured for value in first]))
        stages = np.mean([stage for _, _, stage in measured], axis=0)
        values["stages_ms"] = dict(zip(tracker.stage_names, np.round(stages, 2).tolist(), strict=True))
        figures[str(count)] = values
        print(f"{count:>10}{len(followed):>11}{values['median_ms']:>11.1f}{values['p99_ms']:>11.1f}"
              f"{values['frame_rate']:>11.1f}{values['first_ms']:>11.1f}  {values['stages_ms']}")  # fmt: skip
    whole = options.groups == ",".join(GROUPS)
    print("written:", save_figures(f"upper_speed{'' if whole else '_part'}", figures, {"first": options.first}))


if __name__ == "__main__":
    main()
