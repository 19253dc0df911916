"""Batches in one process and in several; events during tracking, reported once."""

import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest

from tests.fake_tracker import FakeRecipe, FakeTracker, write_recording
from tests.inertial_scenes import RATE
from tests.test_retrieval_online import body, classes, document
from toolkit.app.pipeline import track_recording, track_recordings
from toolkit.app.pipeline.batch import DONE, FAILED, INTERRUPTED, MANIFEST_FILE
from toolkit.app.pipeline.events import EventStream
from toolkit.io.errors import UsageError
from toolkit.recordings.opening import open_recording
from toolkit.tracks import TRACKED, FrameResult, Track


@pytest.fixture
def takes(tmp_path: Path) -> list[Path]:
    (tmp_path / "takes").mkdir()
    (tmp_path / "marks").mkdir()
    return [write_recording(tmp_path / "takes" / f"take{i}.npz") for i in range(4)]


def test_processes_share_the_recordings_and_build_their_tracker_once(tmp_path: Path, takes: list[Path]) -> None:
    told: list[int] = []
    rows = track_recordings(
        takes, FakeRecipe(marks=str(tmp_path / "marks")), tmp_path / "runs", workers=2,
        progress=lambda name, doing, done, total: told.append(done),
    )  # fmt: skip
    assert [row.status for row in rows] == [DONE] * 4 and told == [1, 2, 3, 4]
    assert [Path(row.recording) for row in rows] == takes, "in the order that was asked for"
    assert all(len(Track.load(tmp_path / "runs" / f"take{i}")) == 12 for i in range(4))
    marks = {p.name: p.read_text() for p in (tmp_path / "marks").iterdir()}
    assert len(marks) <= 3 and set(marks.values()) == {"x"}, "one here to check the settings, one in each process"


def test_a_failure_is_in_the_manifest_and_only_that_is_tracked_again(tmp_path: Path, takes: list[Path]) -> None:
    whole = takes[1].read_bytes()
    takes[1].write_bytes(b"nothing")
    runs = tmp_path / "runs"
    rows = track_recordings(takes, FakeRecipe(), runs, workers=2)
    assert [row.status for row in rows] == [DONE, FAILED, DONE, DONE] and "take1.npz" in rows[1].reason
    written = [(runs / f"take{i}" / "track.npz").stat().st_mtime_ns for i in (0, 2, 3)]
    takes[1].write_bytes(whole)
    assert [row.status for row in track_recordings(takes, FakeRecipe(), runs, workers=2)] == [DONE] * 4
    assert written == [(runs / f"take{i}" / "track.npz").stat().st_mtime_ns for i in (0, 2, 3)]
    lines = [json.loads(line) for line in (runs / MANIFEST_FILE).read_text().splitlines()]
    assert [line["status"] for line in lines[1:]] == [DONE] * 4, "of the second batch"


def test_one_failing_recording_does_not_stop_the_others_and_progress_is_printed(
    tmp_path: Path, takes: list[Path]
) -> None:
    takes[1].write_bytes(b"nothing")
    told: list[tuple[str, str]] = []
    rows = track_recordings(
        takes[:3], FakeRecipe(marks=str(tmp_path / "marks")), tmp_path / "runs",
        progress=lambda name, doing, done, total: told.append((name, doing)),
    )  # fmt: skip
    assert [row.status for row in rows] == [DONE, FAILED, DONE]
    assert {("take0", "tracking"), ("take2", "tracking"), ("recordings", "tracked")} <= {*told}
    assert [mark.read_text() for mark in (tmp_path / "marks").iterdir()] == ["x"], "the tracker that is checked is used"


def test_ctrl_c_ends_the_batch_and_the_same_call_goes_on(tmp_path: Path, takes: list[Path]) -> None:
    def stop(name: str, doing: str, done: int, total: int) -> None:
        if (name, doing, done) == ("take1", "tracking", 5):
            os.kill(os.getpid(), signal.SIGINT)

    rows = track_recordings(takes, FakeRecipe(), tmp_path / "runs", progress=stop)
    assert [row.status for row in rows] == [DONE, INTERRUPTED, INTERRUPTED, INTERRUPTED]
    assert rows[1].frames < 12 and "start it again" in rows[2].reason
    assert [row.status for row in track_recordings(takes, FakeRecipe(), tmp_path / "runs")] == [DONE] * 4


def test_equal_stems_and_unknown_options_are_an_error_before_work_starts(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    paths = [write_recording(tmp_path / "take.npz"), write_recording(tmp_path / "x" / "take.npz")]
    with pytest.raises(UsageError, match="same stem 'take'"):
        track_recordings(paths, FakeRecipe(), tmp_path / "runs")
    with pytest.raises(UsageError, match="no recording"):
        track_recordings([], FakeRecipe(), tmp_path / "runs")
    with pytest.raises(UsageError, match="unknown reader option 'colour'"):
        track_recordings(paths[:1], FakeRecipe(), tmp_path / "runs", reader_options={"colour": 1})
    assert not (tmp_path / "runs").exists()


def test_a_run_with_other_settings_is_replaced_only_with_overwrite(tmp_path: Path, takes: list[Path]) -> None:
    runs = tmp_path / "runs"
    track_recordings(takes[:1], FakeRecipe(), runs)
    (runs / "take0" / "config.yaml").write_text("weight: 7\n")
    (refused,) = track_recordings(takes[:1], FakeRecipe(), runs)
    assert refused.status == FAILED and "other settings" in refused.reason
    assert track_recordings(takes[:1], FakeRecipe(), runs, overwrite=True)[0].status == DONE


def test_a_dask_cluster_finishes_though_a_worker_is_killed(tmp_path: Path, takes: list[Path]) -> None:
    distributed = pytest.importorskip("distributed")
    import joblib

    takes += [write_recording(tmp_path / "takes" / f"take{i}.npz") for i in range(4, 8)]
    killed: list[int] = []
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client, joblib.parallel_config(backend="dask"):

            def kill(name: str, doing: str, done: int, total: int) -> None:
                if not killed:
                    killed.append(next(iter(client.run(os.getpid).values())))
                    os.kill(killed[0], signal.SIGKILL)

            rows = track_recordings(takes, FakeRecipe(seconds=0.02), tmp_path / "runs", workers=None, progress=kill)
    assert killed and [row.status for row in rows] == [DONE] * 8
    lines = [json.loads(line) for line in (tmp_path / "runs" / MANIFEST_FILE).read_text().splitlines()]
    assert len(lines) == 9 and len({line["recording"] for line in lines[1:]}) == 8, "nothing lost, nothing done twice"


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
    track_recording(recording, FakeTracker(), tmp_path / "run", watcher=Watcher())
    assert told == [(30, 0), *recording.timestamps.tolist(), "end"]
    with pytest.raises(UsageError, match="events need a single person"):
        track_recording(recording, FakeTracker(), tmp_path / "two", people=2, watcher=Watcher())
