"""People tracked as the frames of a camera come: newest frame first, frames that cannot be kept up with are dropped."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from toolkit.app.pipeline.watch import stop_request
from toolkit.body import skeleton
from toolkit.body.shape import load_body
from toolkit.fitting.placed import Placer
from toolkit.io.errors import DepthMocapError
from toolkit.output.pose_stream import LiveOutput, LiveUpdate
from toolkit.people.live_room import live_finder
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.people.vertical import floor_of
from toolkit.recordings.live_sources import LiveSource
from toolkit.recordings.writer import RecordingWriter
from toolkit.sensing.camera import Camera, level_rotation
from toolkit.sensing.recording import Recording
from toolkit.sensing.sensing_settings import SensingSettings
from toolkit.sensing.stream import Frame
from toolkit.tracking.live_people import LivePeople
from toolkit.tracking.tracker_protocol import Tracker


def begin_live(first: Recording, tracker: Tracker, people: int | None) -> LivePeople:
    """Return the tracker of the people in the frames after the first one, with all kernels loaded.

    Parameters
    ----------
    first : a recording of the first frame
    tracker : makes a follower for each person
    people : maximum number of tracked people, None = all

    Raises
    ------
    SegmentationError
        The setting of the segmentation needs a whole recording.
    """
    sensing = tracker.settings.sensing
    finder = live_finder(first, sensing, people)
    live_finder(first, sensing, people).find(first.depth(0), 0.0, {})
    _warm_up(tracker, first.camera, first.up_camera)
    return LivePeople(tracker, finder, first.up_camera, floor=floor_of(first))


def _warm_up(tracker: Tracker, camera: Camera, up_camera: np.ndarray) -> None:
    """Load the kernels by tracking a drawn body."""
    straight = Camera(camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)
    body, pose = load_body("neutral"), np.zeros(skeleton.POSE_SIZE)
    rotation = level_rotation(up_camera)
    warm_up_distance = 2.5  # metres from the camera to the drawn body
    pose[skeleton.ROOT_POSITION] = rotation @ np.array([0.0, 0.0, warm_up_distance])
    drawn = Placer(body, straight, rotation).place(body, pose).drawn
    left, top = np.rint(np.array(straight.intrinsics[2:]) - drawn.intrinsics[2:]).astype(int)
    depth = np.zeros(straight.shape, dtype=np.uint16)
    depth[top : top + drawn.depth.shape[0], left : left + drawn.depth.shape[1]] = np.rint(1000.0 * drawn.depth)
    finder = SinglePersonSegmenter(straight, settings=SensingSettings(segment="segmented"), up_camera=up_camera)
    people = LivePeople(tracker, finder, up_camera)
    # Frames of a drawn body that are tracked first, so that all kernels are loaded: each search has its turn in six.
    warm_up_frames = 12
    with suppress(DepthMocapError):  # settings under which a drawn body is no person
        for i in range(warm_up_frames):
            people.advance(Frame(depth, i / 30.0))
        people.finish()


class _Arrived(NamedTuple):
    """A frame, its number and the time (`time.perf_counter`) at which it came."""

    frame: Frame
    number: int
    arrival: float


class _Newest:
    """The newest frame of a source, which is read in a thread; one that is not taken in time is replaced.

    Parameters
    ----------
    source : read until it ends or `stop` is set
    stop : ends the reading
    writer : takes each frame, also those that are replaced
    """

    def __init__(self, source: LiveSource, stop: threading.Event, writer: RecordingWriter | None) -> None:
        self._source, self._stop, self._writer = source, stop, writer
        self._frame: _Arrived | None = None
        self._changed, self._ended = threading.Condition(), False
        self.dropped, self.error = 0, None  # type: int, BaseException | None
        self._thread = threading.Thread(target=self._read, name="depthmocap-source", daemon=True)
        self._thread.start()

    def take(self) -> _Arrived | None:
        """Wait for the next frame; None once the source has ended or is stopped."""
        with self._changed:
            while self._frame is None and not self._ended and not self._stop.is_set():
                self._changed.wait(0.1)
            found, self._frame = self._frame, None
            return None if self._stop.is_set() else found

    def join(self) -> None:
        """Wait for the end of the thread and raise its exception."""
        self._thread.join()
        if self.error is not None:
            raise self.error

    def _read(self) -> None:
        try:
            for number, frame in enumerate(self._source.frames()):
                if self._stop.is_set():
                    break
                arrived = _Arrived(frame, number, time.perf_counter())
                with self._changed:
                    self.dropped += self._frame is not None
                    self._frame = arrived
                    self._changed.notify()
                if self._writer is not None:
                    self._writer.append(frame.depth_mm, frame.timestamp)
        except BaseException as error:
            self.error = error
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify()


@dataclass
class LiveSummary:
    """Result of a live run.

    Attributes
    ----------
    frames : tracked frames
    dropped : frames that came while an earlier one was tracked, and were left out
    latencies_ms : latency of each tracked frame, from its arrival to its poses
    people : numbers of the people who were tracked
    """

    frames: int = 0
    dropped: int = 0
    latencies_ms: list[float] = field(default_factory=list)
    people: set[int] = field(default_factory=set)

    def text(self) -> str:
        """Return one line for people."""
        if not self.latencies_ms:
            return "0 frames came"
        median, late = np.quantile(self.latencies_ms, (0.5, 0.99))
        return (
            f"{self.frames} frames tracked, {self.dropped} dropped, {len(self.people)} people; "
            f"from frame to pose {median:.1f} ms median, {late:.1f} ms p99"
        )


def track_live(
    source: LiveSource,
    tracker: Tracker,
    *,
    people: int | None = 1,
    writer: RecordingWriter | None = None,
    outputs: Sequence[LiveOutput] = (),
) -> LiveSummary:
    """Track the people of a live source until it ends, or until Ctrl-C or a termination signal.

    Parameters
    ----------
    source : source of the frames
    tracker : makes a follower for each person
    people : maximum number of tracked people, None = all
    writer : takes each frame that comes, also the dropped ones; the caller closes it
    outputs : take the poses of each tracked frame

    Raises
    ------
    RecordingError
        The camera is unplugged, or a frame cannot be used.
    OutputError
        The recording cannot be written.
    """
    import cv2

    cv2.setNumThreads(1)  # more threads of a small network wait for each other: 7 ms of a room's frame
    tracked, summary = begin_live(source.first, tracker, people), LiveSummary()
    with stop_request() as stop:
        newest = _Newest(source, stop, writer)
        try:
            while (arrived := newest.take()) is not None:
                poses = tracked.advance(arrived.frame).poses
                latency = 1000.0 * (time.perf_counter() - arrived.arrival)
                summary.frames, summary.dropped = tracked.frames, newest.dropped
                summary.latencies_ms.append(latency)
                summary.people |= {pose.row.person for pose in poses}
                frame = arrived.frame
                update = LiveUpdate(arrived.number, frame.timestamp, latency, newest.dropped, poses, frame.depth_mm)
                for output in outputs:
                    output.send(update)
        finally:
            stop.set()
            newest.join()
    return summary
