"""Tracker without a person whose results depend on all earlier frames."""

from __future__ import annotations

import os
import resource
import signal
import sys
import time
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from toolkit.app.pipeline import TrackerRecipe, track_recording
from toolkit.body import skeleton
from toolkit.body.body import Body
from toolkit.io.errors import RecordingError
from toolkit.people.sighting import PredictedBody, Sighting
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import save_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.tracking.clock import StageClock
from toolkit.tracking.tracker_protocol import Tracker
from toolkit.tracks import EMPTY, TRACKED, FrameResult

CAMERA = Camera(100.0, 100.0, 40.0, 30.0, 80, 60)


@dataclass(frozen=True)
class FakeSettings:
    tracker: str = "fake"
    seed: int = 0
    sensing: SensingSettings = field(default_factory=SensingSettings)
    weight: float = 0.5
    smallest_person: int = 300


class FakeTracker:
    """Fake tracker whose pose is a running mean of the depth; a frame takes `seconds`; frame `broken` raises."""

    stage_names = ("prepare", "fit")
    source_names = ("local", "database")
    joints_wanted: Literal["none", "required"] = "none"
    database = ""

    def __init__(
        self,
        seconds: float = 0.0,
        broken: int | None = None,
        weight: float = 0.5,
        learning_seconds: float = 0.0,
        state: int = TRACKED,
        confidence: float = 1.0,
    ) -> None:
        self.state, self.confidence = state, confidence
        self.settings = FakeSettings(weight=weight)
        self.seconds, self.broken, self.learning_seconds = seconds, broken, learning_seconds
        self.steps = 0
        self.learnt: list[int] = []
        self.observed: list[float] = []
        self.parts = 0

    def learner(self, camera: Camera, level_rotation: np.ndarray, floor: float | None = None) -> FakeLearner:
        return FakeLearner(self)

    def follower(self, camera: Camera, level_rotation: np.ndarray, body: Body | None = None) -> FakeFollower:
        return FakeFollower(self, body)


@dataclass(frozen=True)
class FakeRecipe(TrackerRecipe):
    """Recipe of a fake tracker. A process that builds one leaves a file, is killed if `deadly` names it, and can write
    at most `space` bytes to a file.
    """

    marks: str = ""
    seconds: float = 0.0
    deadly: bool = False
    space: int = 0

    def build(self, guide: object = None) -> Tracker:
        if self.marks:
            mark = Path(self.marks) / str(os.getpid())
            mark.write_text(mark.read_text() + "x" if mark.exists() else "x")
        if self.deadly and os.environ.get("BATCH_PARENT") != str(os.getpid()):
            alive = Path(self.marks) / "killed"
            if not alive.exists():
                alive.write_text("")
                os.kill(os.getpid(), signal.SIGKILL)
        if self.space and os.environ.get("BATCH_PARENT") != str(os.getpid()):
            resource.setrlimit(resource.RLIMIT_FSIZE, (self.space, resource.RLIM_INFINITY))
        return FakeTracker(self.seconds)  # type: ignore[return-value]


class FakeLearner:
    """Learner that counts its frames, for `FakeTracker.learnt`; each person stands in front of the camera."""

    def __init__(self, tracker: FakeTracker) -> None:
        self._tracker, self._seen, self._shown = tracker, 0, 0

    @property
    def found(self) -> bool:
        return self._seen + self._shown > 0

    @property
    def body(self) -> Body | None:
        self._tracker.learnt.append(self._seen)
        return fake_body(7.0)

    def observe(self, sighting: Sighting, timestamp: float) -> None:
        self._seen += 1
        self._tracker.observed.append(timestamp)

    def observe_parts(self, sighting: Sighting, timestamp: float) -> Iterator[None]:
        yield
        self.observe(sighting, timestamp)

    def preview(self, sighting: Sighting | None, timestamp: float) -> FrameResult:
        self._shown += 1
        joints, pose = np.full((20, 3), -1.0, np.float32), np.full(skeleton.POSE_SIZE, -1.0)
        return FrameResult(pose, joints, np.ones(20, np.float32), TRACKED, 0, np.array([1.0, 2.0], np.float32))

    def predicted(self) -> PredictedBody:
        body = fake_body(7.0)
        return PredictedBody(np.full((1, 3), float(self._seen)), np.zeros((0, 3), dtype=np.int32), body.height)


class FakeFollower:
    """See `FakeTracker`."""

    CHECKPOINT = ("_count", "_mean")

    def __init__(self, tracker: FakeTracker, body: Body | None) -> None:
        self._tracker, self._body = tracker, body
        self._count, self._mean = 0, 0.0

    @property
    def body(self) -> Body:
        return self._body or fake_body(1.0 + self._count)

    def step(self, sighting: Sighting | None, timestamp: float, clock: StageClock) -> FrameResult:
        tracker = self._tracker
        time.sleep(tracker.seconds)
        tracker.steps += 1
        if self._count == tracker.broken:
            raise RecordingError(f"frame {self._count} cannot be used; leave it out")
        depth = 0.0 if sighting is None else float(sighting.depth.astype(np.float64).mean())
        self._mean += tracker.settings.weight * (depth - self._mean)
        self._count += 1
        joints = np.full((20, 3), self._mean, dtype=np.float32)
        pose = np.full(skeleton.POSE_SIZE, self._mean)
        state = EMPTY if sighting is None else tracker.state
        confidence = np.full(20, tracker.confidence, np.float32)
        return FrameResult(pose, joints, confidence, state, 0, np.array([1.0, 2.0], np.float32))

    def step_parts(
        self, sighting: Sighting | None, timestamp: float, clock: StageClock
    ) -> Generator[None, None, FrameResult]:
        for _ in range(self._tracker.parts if self._count == 0 else 0):
            yield
        return self.step(sighting, timestamp, clock)

    def predicted(self) -> PredictedBody:
        return PredictedBody(np.full((1, 3), self._mean), np.zeros((0, 3), np.int32), 1.7)


def fake_body(scale: float) -> Body:
    count = len(skeleton.JOINTS)  # each joint carries one vertex
    joints, sites = np.zeros((count, 3)), np.zeros((len(skeleton.SITES), 3))
    faces, part, tips = np.zeros((0, 3), np.int32), np.arange(count)[:, None], np.zeros(5, np.int64)
    return Body(
        "fake", np.zeros((count, 3)), faces, part, np.ones((count, 1)), joints, sites, tips, np.array([0.5]), scale
    )


def write_recording(path: Path, frames: int = 12) -> Path:
    """Write a recording whose frames all differ."""
    depth = np.zeros((frames, *CAMERA.shape), dtype=np.uint16)
    for i in range(frames):
        depth[i, 20:40, 30:50] = 2000 + 7 * i * i % 1000
    save_recording(path, depth=depth, camera=CAMERA, timestamps=np.arange(frames) / 30, up_camera=(0, -1, 0))
    return path


if __name__ == "__main__":
    recording, output, resume = sys.argv[1:4]
    summary = track_recording(
        open_recording(recording),
        FakeTracker(seconds=0.03),
        output,
        resume=resume == "resume",
        progress=lambda name, doing, done, total: print(doing, done, flush=True),
    )
    print("interrupted" if summary.interrupted else "complete", flush=True)
