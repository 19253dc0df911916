"""Events during tracking: reported once, also in the file, and not repeated when a run is resumed."""

import json

import numpy as np
import pytest

from tests.fake_tracker import FakeTracker, write_recording
from tests.inertial_scenes import RATE
from tests.test_retrieval_online import body, classes, document
from toolkit.app.pipeline import track_recording
from toolkit.app.pipeline.events import EventStream
from toolkit.io.errors import UsageError
from toolkit.recordings.opening import open_recording
from toolkit.tracks import TRACKED, FrameResult

ROW = np.dtype([("pose", "<f8", (43,)), ("state", "u1"), ("timestamps", "<f8")])


def result_of(pose: np.ndarray, state: int = TRACKED) -> FrameResult:
    return FrameResult(pose, np.zeros((20, 3), np.float32), np.ones(20, np.float32), state, 0, np.ones(1, np.float32))


def rows_of(poses: np.ndarray) -> np.ndarray:
    rows = np.zeros(len(poses), dtype=ROW)
    rows["pose"], rows["timestamps"] = poses, np.arange(len(poses)) / RATE
    return rows


def followed(stream: EventStream, poses: np.ndarray, begin: int = 0) -> None:
    rows = rows_of(poses)
    stream.begin(RATE, body() if begin else None, rows[:begin])
    for row in rows[begin:]:
        stream.row(result_of(row["pose"]), float(row["timestamps"]), body())
    stream.end()


def test_events_are_printed_as_lines_during_tracking(tmp_path, capsys):
    followed(EventStream(classes(), output=tmp_path / "events.jsonl"), document())
    followed(EventStream(classes()), document())
    printed = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [event["label"] for event in printed] == ["kick", "draw", "bow", "kick"]
    assert [json.loads(line) for line in (tmp_path / "events.jsonl").read_text().splitlines()] == printed


@pytest.mark.parametrize("cut", (60, 100, 170))
def test_a_run_that_goes_on_repeats_no_event_and_loses_none(tmp_path, cut):
    whole, broken = tmp_path / "whole.jsonl", tmp_path / "broken.jsonl"
    followed(EventStream(classes(), output=whole), document())
    killed = EventStream(classes(), output=broken)
    killed.begin(RATE, None, rows_of(document())[:0])
    for row in rows_of(document())[: cut + 20]:  # the last twenty rows are later than the state
        killed.row(result_of(row["pose"]), float(row["timestamps"]), body())
    followed(EventStream(classes(), output=broken), document(), begin=cut)
    assert broken.read_text() == whole.read_text()


def test_a_watcher_receives_each_row_of_a_run(tmp_path):
    told = []

    class Watcher:
        def begin(self, frame_rate, body, past):
            told.append((round(frame_rate), len(past)))

        def row(self, result, timestamp, body):
            told.append(timestamp)

        def end(self):
            told.append("end")

    recording = open_recording(write_recording(tmp_path / "take.npz"))
    track_recording(recording, FakeTracker(), tmp_path / "run", warm_up=False, watcher=Watcher())
    assert told == [(30, 0), *recording.timestamps.tolist(), "end"]
    with pytest.raises(UsageError, match="events need a single person"):
        track_recording(recording, FakeTracker(), tmp_path / "two", people=2, watcher=Watcher())
