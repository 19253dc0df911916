"""Live sources, dropped frames, recordings and streams of `depthmocap live`; rooms learnt during the run."""

import json
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.fake_tracker import CAMERA, FakeTracker, write_recording
from toolkit.app.cli.main import main
from toolkit.app.pipeline.live import begin_live, track_live
from toolkit.app.pipeline.trackers import TrackerRecipe
from toolkit.io.errors import DepthMocapError, RecordingError
from toolkit.output import live_view
from toolkit.output.pose_stream import SCHEMA, LiveUpdate, PoseStream, joint_names_line
from toolkit.people import live_room
from toolkit.people.evidence import Evidence
from toolkit.people.sighting import Sighting
from toolkit.people.surroundings import Surroundings
from toolkit.recordings import live_sources
from toolkit.recordings.live_sources import RealSenseSource, RecordingSource, live_source
from toolkit.recordings.opening import open_recording
from toolkit.recordings.writer import RecordingWriter
from toolkit.sensing.recording import Recording
from toolkit.sensing.stream import Frame
from toolkit.tracking.live_people import LivePose
from toolkit.tracking.multi_person import Row
from toolkit.tracks import TRACKED, FrameResult

FRAMES = 12


@pytest.fixture
def take(tmp_path: Path) -> Recording:
    return open_recording(write_recording(tmp_path / "take.npz", FRAMES))


class Burst:
    """Source with a frame `every` given seconds; it fails after `broken` of them."""

    name = "burst"

    def __init__(self, recording: Recording, every: float, broken: int | None = None) -> None:
        self._recording, self._every, self._broken = recording, every, broken
        self.first, self.closed = RecordingSource(recording).first, False

    def frames(self) -> Iterator[Frame]:
        for number, frame in enumerate(self._recording.stream()):
            if number == self._broken:
                raise RecordingError("the camera was unplugged; plug it in again")
            time.sleep(self._every)
            yield frame

    def close(self) -> None:
        self.closed = True


class Updates(list[LiveUpdate]):
    """Output that keeps its frames."""

    def send(self, update: LiveUpdate) -> None:
        self.append(update)


def test_frames_that_cannot_be_kept_up_with_are_dropped_and_counted_and_recorded(
    take: Recording, tmp_path: Path
) -> None:
    updates = Updates()
    writer = RecordingWriter(tmp_path / "copy.npz", take.camera)
    summary = track_live(Burst(take, 0.005), FakeTracker(seconds=0.03), writer=writer, outputs=[updates])
    writer.close()
    assert summary.dropped > 0 and summary.frames + summary.dropped == FRAMES
    numbers = [update.frame for update in updates]
    assert all((update.depth_mm == take.depth(update.frame)).all() for update in updates)
    assert numbers == sorted(set(numbers)) and len(numbers) == summary.frames == len(summary.latencies_ms)
    assert numbers[-1] == FRAMES - 1, "the newest frame is never the one that is dropped"
    assert max(summary.latencies_ms) < 1000 * (0.03 + 0.1)
    copy = open_recording(tmp_path / "copy.npz")
    np.testing.assert_array_equal(list(copy.frames()), list(take.frames()))
    np.testing.assert_array_equal(copy.timestamps, take.timestamps)
    assert f"{summary.frames} frames tracked, {summary.dropped} dropped, 1 people" in summary.text()


def test_ctrl_c_ends_after_the_frame_and_the_recording_is_whole(take: Recording, tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "copy.npz", take.camera)

    class Press(Updates):
        def send(self, update: LiveUpdate) -> None:
            super().send(update)
            if len(self) == 4:
                signal.raise_signal(signal.SIGINT)

    summary = track_live(Burst(take, 0.01), FakeTracker(), writer=writer, outputs=[Press()])
    writer.close()
    assert summary.frames == 4
    copy = open_recording(tmp_path / "copy.npz")
    assert 4 <= len(copy) <= FRAMES
    np.testing.assert_array_equal(list(copy.frames()), list(take.frames())[: len(copy)])


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., int]:
    """Run `depthmocap live` in a folder with a fake tracker; return the exit code."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(TrackerRecipe, "build", lambda *_: FakeTracker())

    def typed(*words: str) -> int:
        try:
            main(["live", *words])
        except SystemExit as ended:
            return int(ended.code or 0)
        return 0

    return typed


def test_the_command_plays_a_recording_streams_and_records_it(
    take: Recording, command: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as consumer:
        consumer.bind(("127.0.0.1", 0))
        consumer.settimeout(5.0)
        url = f"udp://127.0.0.1:{consumer.getsockname()[1]}"
        assert command("file:take.npz", "--stream", url, "--record", "copy.npz") == 0
        lines = [json.loads(consumer.recv(65_536)) for _ in range(3)]
    assert lines[0] == json.loads(joint_names_line()) and len(lines[0]["joint_names"]) == 20
    first = lines[1]
    assert (first["schema"], first["frame"], first["dropped"], len(first["people"])) == (SCHEMA, 0, 0, 1)
    person = first["people"][0]
    assert (person["id"], person["state"], person["provisional"]) == (1, "tracked", False)
    assert np.shape(person["joints"]) == (20, 3) and np.shape(person["confidence"]) == (20,)
    assert len(open_recording("copy.npz")) == FRAMES
    assert "from frame to pose" in capsys.readouterr().out


def test_the_command_streams_bundles_of_open_sound_control(take: Recording, command: Callable[..., int]) -> None:
    osc_packet = pytest.importorskip("pythonosc.osc_packet")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as consumer:
        consumer.bind(("127.0.0.1", 0))
        consumer.settimeout(5.0)
        assert command("file:take.npz", "--stream", f"osc://127.0.0.1:{consumer.getsockname()[1]}") == 0
        packet = osc_packet.OscPacket(consumer.recv(65_536))
    messages = {each.message.address: each.message.params for each in packet.messages}
    assert messages["/depthmocap/frame"][1:] == [0.0, 0] and messages["/depthmocap/person/1/state"] == ["tracked", 0]
    joints = [values for address, values in messages.items() if address.count("/") == 4 and len(values) == 4]
    assert len(joints) == 20 == len({tuple(values) for values in joints}) * 20
    assert messages["/depthmocap/person/1/left_hand"][3] == 1.0


@pytest.mark.parametrize(
    ("module", "words", "extra"),
    [("pythonosc", ("--stream", "osc://127.0.0.1:9000"), "osc"), ("rerun", ("--view",), "rerun")],
)
def test_without_its_package_an_output_names_the_command(
    module: str, words: tuple[str, ...], extra: str, take: Recording, command: Callable[..., int],
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setitem(sys.modules, module, None)
    assert command("file:take.npz", *words) == 2
    assert f"pip install 'depthmocap[{extra}]'" in capsys.readouterr().err


def test_the_view_shows_each_frame_and_clears_who_is_gone(
    take: Recording, tmp_path: Path, command: Callable[..., int], monkeypatch: pytest.MonkeyPatch
) -> None:
    rerun = pytest.importorskip("rerun")
    monkeypatch.setattr(live_view, "spawn_viewer", lambda stream: stream.save(str(tmp_path / "live.rrd")))
    assert command("file:take.npz", "--view") == 0
    assert (tmp_path / "live.rrd").stat().st_size > 1000
    logged: list[tuple[str, str]] = []

    def log(self: object, entity: str, *parts: object, static: bool = False) -> None:
        logged.extend((entity, type(part).__name__) for part in parts)

    monkeypatch.setattr(rerun.RecordingStream, "log", log)
    view = live_view.RerunView(RecordingSource(take).first, lambda stream: None)
    result = FrameResult(
        np.zeros(43), np.zeros((20, 3), np.float32), np.ones(20, np.float32), TRACKED, 0, np.zeros(2, np.float32)
    )
    for seconds, people in ((0.0, [1, 2]), (0.1, [2])):
        poses = [LivePose(Row(person, 0, seconds, result), False) for person in people]
        view.send(LiveUpdate(0, seconds, 1.0, 0, poses, take.depth(0)))
    view.close()
    assert [entity for entity, kind in logged if kind == "Clear"] == ["world/person_01"]
    kinds = [kind for entity, kind in logged if entity.startswith("world/person_02")]
    assert kinds == ["Points3D", "LineStrips3D"] * 2
    assert [kind for entity, kind in logged if entity == "world/camera/depth"] == ["DepthImage"] * 2


def test_a_viewer_that_cannot_start_is_one_sentence(
    take: Recording, command: Callable[..., int], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    rerun = pytest.importorskip("rerun")

    def spawn(**options: Any) -> None:
        raise RuntimeError("no display")

    monkeypatch.setattr(rerun, "spawn", spawn)
    assert command("file:take.npz", "--view") == 1
    assert "the viewer rerun cannot be started: no display; leave out --view" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "code", "reason"),
    [
        (("realsense",), 1, "no RealSense camera is connected; plug one in, or give file:RECORDING"),
        (("take.npz",), 2, "give realsense, or file:RECORDING; for a recording type file:take.npz"),
        (("file:none.npz",), 1, "there is no recording at none.npz"),
        (("file:take.npz", "--stream", "tcp://127.0.0.1:9"), 2, "give udp://HOST:PORT"),
        (("file:take.npz", "--stream", "udp://127.0.0.1:99999"), 2, "give udp://HOST:PORT"),
        (("file:take.npz", "--record", "take.npz"), 2, "take.npz"),
        (("file:take.npz", "--people", "0"), 2, "give a number of people, or all"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_one_sentence(
    words: tuple[str, ...], code: int, reason: str, take: Recording, command: Callable[..., int],
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    no_camera(monkeypatch)
    assert command(*words) == code
    error = capsys.readouterr().err
    assert reason in error and "Traceback" not in error
    assert len(open_recording("take.npz")) == FRAMES


def test_an_unplugged_camera_is_reported_and_its_recording_is_whole(
    take: Recording, command: Callable[..., int], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = Burst(take, 0.0, broken=7)
    monkeypatch.setattr(live_sources, "live_source", lambda *_, **__: camera)
    assert command("realsense", "--record", "copy.npz") == 1
    assert "the camera was unplugged; plug it in again" in capsys.readouterr().err
    assert len(open_recording("copy.npz")) == 7 and camera.closed


def test_a_stream_without_a_consumer_never_fails() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as consumer:
        consumer.bind(("127.0.0.1", 0))
        port = consumer.getsockname()[1]
    stream = PoseStream(f"udp://127.0.0.1:{port}")
    for _ in range(5):
        stream.send(LiveUpdate(0, 0.0, 1.0, 0, (), np.zeros((1, 1), np.uint16)))
        time.sleep(0.01)
    stream.close()
    assert stream.lost > 0


def test_a_recording_is_played_at_its_own_pace(take: Recording) -> None:
    source = live_source(f"file:{take.path}")
    begun = time.perf_counter()
    frames = list(source.frames())
    assert time.perf_counter() - begun >= take.timestamps[-1] - take.timestamps[0]
    np.testing.assert_array_equal([frame.depth_mm for frame in frames], list(take.frames()))
    assert source.first.camera == take.camera and len(source.first) == 1


def no_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    import open3d

    monkeypatch.setattr(open3d.t.io, "RealSenseSensor", SimpleNamespace(enumerate_devices=list))


class FakeSensor:
    """Fake of Open3D's sensor: frames of tenths of millimetres, an empty frame set, then a loss."""

    def __init__(self) -> None:
        self.count, self.stopped = 0, False

    @staticmethod
    def enumerate_devices() -> list[str]:
        return ["camera"]

    def init_sensor(self) -> bool:
        return True

    def start_capture(self) -> bool:
        return True

    def get_metadata(self) -> Any:
        matrix = np.array([[100.0, 0, 40], [0, 100, 30], [0, 0, 1]])
        return SimpleNamespace(depth_scale=10_000.0, intrinsics=SimpleNamespace(intrinsic_matrix=matrix))

    def get_timestamp(self) -> int:
        return 33_000 * self.count

    def capture_frame(self, wait: bool, align: bool) -> Any:
        self.count += 1
        if self.count == 4:
            raise RuntimeError("\x1b[1;31m[Open3D Error] somewhere.cpp:1: Frame didn't arrive\ndevice lost\n\x1b[0;m")
        image = np.full(CAMERA.shape, 20_004, np.uint16)
        depth = SimpleNamespace(to_legacy=lambda: image)
        return SimpleNamespace(is_empty=lambda: self.count == 2, depth=depth)

    def stop_capture(self) -> None:
        self.stopped = True


def test_a_realsense_camera_gives_millimetres_and_its_loss_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    import open3d

    monkeypatch.setattr(open3d.t.io, "RealSenseSensor", FakeSensor)
    source = RealSenseSource()
    assert (source.first.camera.fx, source.first.camera.shape) == (100.0, CAMERA.shape)
    frames = source.frames()
    frame = next(frames)
    assert frame.depth_mm.dtype == np.uint16 and (frame.depth_mm == 2000).all()
    assert frame.timestamp == pytest.approx(0.099), "the empty frame set is left out"
    with pytest.raises(RecordingError, match="the RealSense camera stopped: device lost; plug it in again"):
        next(frames)
    source.close()


class RoomFinder:
    """Finder of people that keeps the rooms that it receives, and what it is asked for."""

    camera = CAMERA
    coarse, classifier = SimpleNamespace(downsampled=lambda depth: depth), None

    def __init__(self) -> None:
        self.rooms: list[Any] = []
        self.seen: tuple[Sighting, ...] = ()
        self.evidence: dict[int, Evidence] = {}
        self.asked: list[int | None] = []

    def use_room(self, room: Any) -> None:
        self.rooms.append((len(self.rooms), room))

    def find(
        self, depth: np.ndarray, timestamp: float, predicted: Any, *, only: int | None = None
    ) -> tuple[Sighting, ...]:
        self.asked.append(only)
        return tuple(each for each in self.seen if only is None or each.id == only)


def room_finder(take: Recording, finder: RoomFinder) -> live_room.RoomLearningFinder:
    return live_room.RoomLearningFinder(finder, FakeTracker().settings.sensing, take, -1.2)  # type: ignore[arg-type]


def test_a_room_is_learned_from_the_samples_so_far_in_parts(take: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    empty = np.zeros((1, 1), np.float32)
    sizes: list[int] = []
    parts: list[int] = []

    def learnt_parts(frames: list[np.ndarray], *_: object) -> Iterator[None]:
        sizes.append(len(frames))
        for _part in range(10):
            parts.append(now)
            yield
        return Surroundings(False, True, empty, empty, empty > 0)

    monkeypatch.setattr(live_room, "learnt_parts", learnt_parts)
    finder = RoomFinder()
    room = room_finder(take, finder)
    depth, changes = take.depth(0), []
    for now in range(800):  # 26.7 s at 30 frames a second
        before = len(finder.rooms)
        room.find(depth, now / 30, {})
        changes += [now] * (len(finder.rooms) > before)
    assert sizes == list(live_room.LEARNED_AFTER)
    # the 8th, 16th and 40th sample are of 3.5, 7.5 and 19.5 s; a part is computed in every fourth frame
    assert changes == [106 + 40, 226 + 40, 586 + 40]
    assert len(set(parts)) == 30 and {part % live_room.LEARNING_PERIOD for part in parts} == {2}
    assert all(learned.floor == -1.2 for _, learned in finder.rooms)


def test_one_person_in_a_room_is_the_largest_and_stays_it_unless_it_is_furniture() -> None:
    def sighting(number: int, pixels: int) -> Sighting:
        depth = np.zeros(CAMERA.shape, np.float32)
        depth.flat[:pixels] = 2.0
        return Sighting(number, depth, None, CAMERA)

    inner = RoomFinder()
    finder = live_room.FirstPersonFinder(inner)  # type: ignore[arg-type]

    def found(*seen: Sighting) -> list[int]:
        inner.seen = seen
        return [int(np.count_nonzero(each.depth)) for each in finder.find(np.zeros(1), 0.0, {}) if each.id == 1]

    assert found() == []
    assert found(sighting(1, 500), sighting(2, 900)) == [900]
    assert found(sighting(1, 950), sighting(2, 400)) == [400]
    assert found(sighting(1, 950)) == [0]
    assert inner.asked == [None, None, 2, 2], "only the selected person is cut out"
    inner.evidence = {2: replace(Evidence(), looks=10, score=-1e6)}
    assert inner.evidence[2].log_odds <= 0
    assert found(sighting(1, 950), sighting(2, 990)) == [950]


def test_a_warm_tracker_has_no_frames_and_refuses_another_size(take: Recording) -> None:
    people = begin_live(RecordingSource(take).first, FakeTracker(), 1)  # type: ignore[arg-type]
    assert people.frames == 0, "the frames of the warm-up are forgotten"
    with pytest.raises(DepthMocapError, match="a frame is uint16"):
        people.advance(Frame(np.zeros((3, 3), np.uint16), 0.0))
    assert people.frames == 0
