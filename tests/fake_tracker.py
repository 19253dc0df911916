"""A tracker that finds nobody, but remembers: every result depends on all frames before it."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.errors import RecordingError
from toolkit.pipeline import track_recordings
from toolkit.sensing.camera import Camera
from toolkit.sensing.cleaning import SensingSettings
from toolkit.sensing.recording import Recording, save_recording
from toolkit.track import TRACKED, FrameResult

CAMERA = Camera(100.0, 100.0, 40.0, 30.0, 80, 60)


@dataclass(frozen=True)
class FakeSettings:
    sensing: SensingSettings = field(default_factory=SensingSettings)
    weight: float = 0.5


class FakeTracker:
    """Its pose is a running mean of the depth; `seconds` is how long a frame takes; frame `broken` cannot be used."""

    stage_names = ("clean", "fit")
    source_names = ("local", "database")
    database = ""

    def __init__(self, seconds: float = 0.0, broken: int | None = None, weight: float = 0.5) -> None:
        self.settings = FakeSettings(weight=weight)
        self.seconds, self.broken = seconds, broken
        self.memory: Any = (0, 0.0)
        self.steps = 0

    @property
    def body(self) -> Body:
        joints, sites = np.zeros((len(skeleton.JOINTS), 3)), np.zeros((len(skeleton.SITES), 3))
        one = np.ones((1, 1))
        faces, part, tips = np.zeros((0, 3), np.int32), np.zeros((1, 1), np.int64), np.zeros(5, np.int64)
        return Body(
            "fake", np.zeros((1, 3)), faces, part, one, joints, sites, tips, np.array([0.5]), 1.0 + self.memory[0]
        )

    def start(self, recording: Recording) -> None:
        self.memory = (0, 0.0)

    def step(self, depth_mm: np.ndarray, timestamp: float) -> FrameResult:
        time.sleep(self.seconds)
        self.steps += 1
        count, mean = self.memory
        if count == self.broken:
            raise RecordingError(f"frame {count} cannot be used; leave it out")
        mean += self.settings.weight * (float(depth_mm.mean()) - mean)
        self.memory = (count + 1, mean)
        joints = np.full((20, 3), mean, dtype=np.float32)
        pose = np.full(skeleton.POSE_SIZE, mean)
        return FrameResult(pose, joints, np.ones(20, np.float32), TRACKED, 0, np.array([1.0, 2.0], np.float32))


def write_recording(path: Path, frames: int = 12) -> Path:
    """A recording whose frames all differ."""
    depth = np.zeros((frames, *CAMERA.shape), dtype=np.uint16)
    for i in range(frames):
        depth[i, 20:40, 30:50] = 2000 + 7 * i * i % 1000
    save_recording(path, depth=depth, camera=CAMERA, timestamps=np.arange(frames) / 30, up_camera=(0, -1, 0))
    return path


if __name__ == "__main__":
    recording, output, resume = sys.argv[1:4]
    report = track_recordings(
        [recording],
        FakeTracker(seconds=0.03),
        output,
        resume=resume == "resume",
        progress=lambda name, doing, done, total: print(doing, done, flush=True),
    )
    print("interrupted" if report.interrupted else "complete", report.failed, flush=True)
